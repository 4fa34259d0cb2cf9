//! Inputs that break marching cubes elsewhere: ties, borders, gaps, mirrored and far-away grids.

use ivd_core::{Exec, Grid, MIN_EDGE_FRACTION, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};

use crate::extract::mesh::{area_and_volume, assert_closed_manifold, euler};
use crate::extract::{cut, cut_volume, noise};

#[test]
fn a_constant_volume_is_empty_or_a_box_closed_outside_its_border() {
    assert_eq!(cut([4, 5, 6], vec![7_u8; 120], Iso::Value(7.5)).triangles().len(), 0);
    let full = cut([4, 5, 6], vec![7_u8; 120], Iso::Value(7.0));
    assert_closed_manifold(&full, "full");
    assert_eq!(euler(&full), 2);
    // A box half a voxel beyond the voxel centres, its edges and corners cut off.
    let (_, volume) = area_and_volume(&full);
    assert!(volume < 120.0 && volume > 120.0 - 12.0 * 6.0 / 8.0 - 8.0, "{volume}");
}

#[test]
fn flat_volumes_are_closed() {
    for dims in [[1, 1, 1], [1, 7, 5], [6, 1, 5], [6, 7, 1], [1, 1, 9]] {
        let len = dims.iter().product();
        for iso in [0.0, 1.0, 1.5, 3.0] {
            assert_closed_manifold(&cut(dims, noise(3, len, 4), Iso::Value(iso)), &format!("{dims:?} {iso}"));
        }
    }
    assert_eq!(cut([1, 1, 1], vec![1_u8], Iso::Value(1.0)).triangles().len(), 8);
}

#[test]
fn a_voxel_on_the_isovalue_is_inside_and_one_ulp_decides() {
    let values = vec![0.0_f32, 0.1, 0.0];
    let iso = f64::from(0.1_f32);
    for (iso, vertices) in [(iso, 6), (iso.next_down(), 6), (iso.next_up(), 0)] {
        let lattice = cut([3, 1, 1], values.clone(), Iso::Value(iso));
        assert_eq!(lattice.keys().len(), vertices, "{iso:e}");
        assert_closed_manifold(&lattice, "ulp");
    }
    let lattice = cut([3, 1, 1], values, Iso::Value(iso));
    let along: Vec<f32> = lattice.places().iter().map(|p| p[0]).filter(|&t| t != 0.0).collect();
    assert_eq!(
        along,
        [1.0 - MIN_EDGE_FRACTION, MIN_EDGE_FRACTION],
        "the surface touches the voxel and keeps its distance"
    );
}

#[test]
fn voxels_without_data_are_outside_with_the_surface_halfway() {
    for missing in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let lattice = cut([3, 1, 1], vec![5.0, missing, 5.0], Iso::Value(1.0));
        assert_closed_manifold(&lattice, "missing");
        assert_eq!(lattice.keys().len(), 12, "{missing}");
        assert!(lattice.places().iter().flatten().all(|&p| p == 0.0 || p == 0.5));
    }
    for seed in 0..100 {
        let mut voxels: Vec<f32> = noise(seed, 216, 4).iter().map(|&v| f32::from(v)).collect();
        for (at, value) in noise(seed + 1, 216, 6).iter().zip(&mut voxels) {
            *value = [f32::NAN, f32::INFINITY, f32::MIN_POSITIVE / 4.0]
                .get(usize::from(*at))
                .copied()
                .unwrap_or(*value);
        }
        assert_closed_manifold(&cut([6, 6, 6], voxels, Iso::Value(1.0)), &format!("seed {seed}"));
    }
}

#[test]
fn extreme_doubles_give_finite_places() {
    let values = [f64::MAX, f64::MIN, 1e-300, -1e-300, 5e-324, 0.0, -0.0, 1e300];
    let voxels: Vec<f64> = noise(4, 125, 8).iter().map(|&v| values[usize::from(v)]).collect();
    for iso in [0.0, 5e-324, 1e300, -1e300] {
        let lattice = cut([5, 5, 5], voxels.clone(), Iso::Value(iso));
        assert_closed_manifold(&lattice, &format!("{iso:e}"));
        assert!(lattice.places().iter().flatten().all(|p| p.is_finite()));
    }
}

#[test]
fn a_negative_slope_turns_inside_into_below() {
    let grid = Grid::with_spacing([5, 4, 6], [1.0; 3]).unwrap();
    let stored = noise(8, 120, 200);
    let turned: Vec<i16> = stored.iter().map(|&v| -i16::from(v)).collect();
    let up = Volume::new(grid.clone(), Voxels::from(stored)).unwrap();
    let down = Volume::with_scale(grid, Voxels::from(turned), -1.0, 0.0).unwrap();
    for iso in [100.0, 57.25] {
        assert_eq!(cut_volume(&up, None, Iso::Value(iso)), cut_volume(&down, None, Iso::Value(iso)));
    }
}

#[test]
fn sixteen_bit_data_with_gaps_and_padding_keeps_exact_signs() {
    let values = [0_u16, 16, 4080, 65520, 65535];
    let voxels: Vec<u16> = noise(5, 343, 5).iter().map(|&v| values[usize::from(v)]).collect();
    for iso in [16.0, 15.999_999, 4080.0, 65534.5, 65535.0] {
        let lattice = cut([7, 7, 7], voxels.clone(), Iso::Value(iso));
        assert_closed_manifold(&lattice, &format!("{iso}"));
        let above = voxels.iter().any(|&v| f64::from(v) >= iso);
        assert_eq!(lattice.triangles().is_empty(), !above);
    }
}

/// The same voxels on four grids: plain, mirrored, far away, and anisotropic with an oblique direction.
fn grids(dims: [usize; 3]) -> Vec<Grid> {
    let (s, c) = 0.3_f64.sin_cos();
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mirrored = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    vec![
        Grid::new(dims, [1.0; 3], [0.0; 3], axes).unwrap(),
        Grid::new(dims, [1.0; 3], [0.0; 3], mirrored).unwrap(),
        Grid::new(dims, [0.7, 0.7, 0.7], [1e6, -1e6, 1e6], axes).unwrap(),
        Grid::new(dims, [1.0, 1.0, 50.0], [3.0, 2.0, 1.0], [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, -1.0]])
            .unwrap(),
    ]
}

#[test]
fn the_outside_is_outside_on_every_grid() {
    let mut voxels = vec![0_u8; 6 * 7 * 8];
    for (i, v) in voxels.iter_mut().enumerate() {
        let [x, y, z] = [i % 6, i / 6 % 7, i / 42];
        *v = u8::from((1..5).contains(&x) && (1..6).contains(&y) && (2..7).contains(&z)) * 10;
    }
    let mut enclosed = Vec::new();
    for grid in grids([6, 7, 8]) {
        let voxel = grid.voxel_volume();
        let lattice =
            cut_volume(&Volume::new(grid, Voxels::from(voxels.clone())).unwrap(), None, Iso::Value(5.0));
        assert_closed_manifold(&lattice, "grid");
        enclosed.push(area_and_volume(&lattice).1 / voxel);
    }
    assert!(enclosed[0] > 90.0, "{enclosed:?}");
    assert!(enclosed.iter().all(|v| (v - enclosed[0]).abs() < 1e-9), "{enclosed:?}");
}

#[test]
fn a_million_millimetres_away_the_places_are_the_same() {
    let [near, far] = [0, 2].map(|g: usize| {
        let grid = grids([5, 5, 5])[g].clone();
        cut_volume(&Volume::new(grid, Voxels::from(noise(6, 125, 250))).unwrap(), None, Iso::Value(99.5))
    });
    assert_eq!((near.keys(), near.places(), near.triangles()), (far.keys(), far.places(), far.triangles()));
}

#[test]
fn any_number_of_threads_gives_the_same_lattice() {
    let grid = Grid::with_spacing([33, 31, 35], [1.0; 3]).unwrap();
    let volume = Volume::new(grid, Voxels::from(noise(9, 33 * 31 * 35, 4))).unwrap();
    let [one, two, three] = [1, 2, 3].map(|threads| {
        extract(
            &volume,
            None,
            &ExtractParams { iso: Iso::Value(2.0) },
            &Exec::default().with_threads(threads),
        )
        .unwrap()
    });
    assert_eq!(one, two);
    assert_eq!(one, three);
}

#[test]
fn a_cancelled_extraction_stops() {
    let grid = Grid::with_spacing([3, 3, 3], [1.0; 3]).unwrap();
    let volume = Volume::new(grid, Voxels::from(vec![1_u8; 27])).unwrap();
    let exec = Exec::default();
    exec.cancel.cancel();
    assert!(extract(&volume, None, &ExtractParams { iso: Iso::Value(1.0) }, &exec).is_err());
}
