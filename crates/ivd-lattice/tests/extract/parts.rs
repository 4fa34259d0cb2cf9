//! Intervals and masks.

use ivd_core::{Classified, ErrorClass, Exec, Grid, MIN_EDGE_FRACTION, Mask, Volume, Voxels};
use ivd_lattice::Error;
use ivd_lattice::extract::{ExtractParams, Iso, extract};

use crate::extract::mesh::{area_and_volume, assert_closed_manifold, euler};
use crate::extract::{cut_volume, noise};

fn line(values: &[f32]) -> Volume {
    let grid = Grid::with_spacing([values.len(), 1, 1], [1.0; 3]).unwrap();
    Volume::new(grid, Voxels::from(values.to_vec())).unwrap()
}

fn mask_on(volume: &Volume, inside: &[u8]) -> Mask {
    Mask::new(volume.grid().clone(), inside.to_vec().into()).unwrap()
}

/// Ascending x coordinates of the crossings on the x axis.
fn crossings(volume: &Volume, mask: Option<&Mask>, iso: Iso) -> Vec<f64> {
    let lattice = cut_volume(volume, mask, iso);
    assert_closed_manifold(&lattice, "line");
    let on_axis = (0..lattice.keys().len()).filter(|&i| lattice.keys()[i].element() == 0);
    on_axis.map(|i| lattice.voxel(i).0.x).collect()
}

#[test]
fn an_interval_is_crossed_at_both_of_its_ends() {
    let volume = line(&[0.0, 2.0, 6.0, 2.0]);
    let iso = Iso::Interval { lower: Some(1.0), upper: Some(3.0) };
    assert_eq!(crossings(&volume, None, iso), [0.5, 1.25, 2.75, 3.5]);
    let open = Iso::Interval { lower: None, upper: Some(3.0) };
    assert_eq!(crossings(&volume, None, open), [-0.5, 1.25, 2.75, 3.5]);
    let upper_end_is_outside = Iso::Interval { lower: Some(1.0), upper: Some(2.0) };
    assert_eq!(cut_volume(&volume, None, upper_end_is_outside).keys().len(), 0);
}

#[test]
fn an_interval_open_above_is_a_value() {
    let grid = Grid::with_spacing([7, 6, 5], [1.0; 3]).unwrap();
    let volume = Volume::with_scale(grid, Voxels::from(noise(1, 210, 9)), -0.3, 1.0).unwrap();
    let value = cut_volume(&volume, None, Iso::Value(-0.2));
    let interval = cut_volume(&volume, None, Iso::Interval { lower: Some(-0.2), upper: None });
    assert_eq!(
        (value.keys(), value.places(), value.triangles()),
        (interval.keys(), interval.places(), interval.triangles())
    );
}

#[test]
fn a_mask_wins_and_the_field_places_the_surface_where_it_agrees() {
    let volume = line(&[0.0, 4.0, 4.0, 4.0, 1.0, 0.0]);
    let iso = Iso::Value(3.0);
    assert_eq!(crossings(&volume, None, iso), [0.75, 3.0 + f64::from(1.0_f32 / 3.0)]);
    // Voxel 3 is cut off although its field is inside, voxel 4 and 5 are filled in although theirs isn't.
    let cut_off = mask_on(&volume, &[0, 1, 1, 0, 0, 0]);
    assert_eq!(crossings(&volume, Some(&cut_off), iso), [0.75, 2.5]);
    let filled = mask_on(&volume, &[0, 1, 1, 1, 1, 0]);
    assert_eq!(crossings(&volume, Some(&filled), iso), [0.75, 4.5]);
}

#[test]
fn a_mask_without_data_is_outside() {
    let volume = line(&[0.0, 4.0, f32::NAN, 0.0]);
    let mask = mask_on(&volume, &[0, 1, 1, 0]);
    assert_eq!(crossings(&volume, Some(&mask), Iso::Value(2.0)), [0.5, 1.5]);
}

#[test]
fn the_border_of_a_mask_is_halfway_or_where_its_level_is_zero() {
    let volume = line(&[9.0; 5]);
    let mask = mask_on(&volume, &[0, 1, 1, 0, 0]);
    assert_eq!(crossings(&volume, Some(&mask), Iso::Mask), [0.5, 2.5]);
    let level: Vec<f32> = vec![-3.0, 1.0, 0.5, -0.5, -9.0];
    let levelled = mask.clone().with_level(level.into()).unwrap();
    assert_eq!(crossings(&volume, Some(&levelled), Iso::Mask), [0.75, 2.5]);
    // A level of 0 touches the surface from either side; one of the wrong sign says nothing.
    let zero = mask.clone().with_level(vec![0.0, 1.0, 0.0, -0.5, -9.0].into()).unwrap();
    assert_eq!(
        crossings(&volume, Some(&zero), Iso::Mask),
        [f64::from(MIN_EDGE_FRACTION), 2.0 + f64::from(MIN_EDGE_FRACTION)]
    );
    let wrong = mask.with_level(vec![2.0, 1.0, 1.0, 3.0, 0.0].into()).unwrap();
    assert_eq!(crossings(&volume, Some(&wrong), Iso::Mask), [0.5, 2.5]);
}

#[test]
fn random_masks_over_random_fields_stay_closed_and_manifold() {
    for seed in 0..200_u64 {
        let dims = [4 + (seed % 5) as usize, 5, 6];
        let len = dims.iter().product();
        let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
        let volume = Volume::new(grid.clone(), Voxels::from(noise(seed, len, 4))).unwrap();
        let mask = Mask::new(grid, noise(seed + 999, len, 2).into()).unwrap();
        let level: Vec<f32> = noise(seed + 77, len, 7).iter().map(|&v| f32::from(v) - 3.0).collect();
        for iso in [Iso::Value(1.5), Iso::Interval { lower: Some(1.0), upper: Some(3.0) }, Iso::Mask] {
            let lattice = cut_volume(&volume, Some(&mask), iso);
            assert_closed_manifold(&lattice, &format!("seed {seed}, {iso:?}"));
        }
        let levelled = mask.with_level(level.into()).unwrap();
        assert_closed_manifold(&cut_volume(&volume, Some(&levelled), Iso::Mask), &format!("level {seed}"));
    }
}

#[test]
fn a_mask_of_one_voxel_is_an_octahedron_of_half_a_voxel() {
    let grid = Grid::with_spacing([3, 3, 3], [2.0, 1.0, 1.0]).unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![0_i16; 27])).unwrap();
    let mut inside = vec![0_u8; 27];
    inside[13] = 1;
    let lattice = cut_volume(&volume, Some(&Mask::new(grid, inside.into()).unwrap()), Iso::Mask);
    assert_eq!((lattice.keys().len(), euler(&lattice)), (6, 2));
    // Half axes 1, ½, ½ mm: 4/3 · a b c.
    assert!((area_and_volume(&lattice).1 - 1.0 / 3.0).abs() < 1e-12);
}

#[test]
fn wrong_requests_are_named() {
    let volume = line(&[1.0, 2.0]);
    let run = |mask: Option<&Mask>, iso| {
        extract(&volume, mask, &ExtractParams { iso }, &Exec::default()).unwrap_err()
    };
    assert!(matches!(run(None, Iso::Mask), Error::MissingInput { .. }));
    for iso in [
        Iso::Value(f64::NAN),
        Iso::Interval { lower: None, upper: None },
        Iso::Interval { lower: Some(2.0), upper: Some(2.0) },
        Iso::Interval { lower: Some(f64::INFINITY), upper: None },
    ] {
        assert!(
            matches!(run(None, iso), Error::Core(ivd_core::Error::Param(ref e)) if e.field == "iso"),
            "{iso:?}"
        );
    }
    let elsewhere = Mask::new(Grid::with_spacing([2, 1, 1], [3.0; 3]).unwrap(), vec![0, 1].into()).unwrap();
    assert_eq!(run(Some(&elsewhere), Iso::Mask).error_class(), ErrorClass::Usage);
}
