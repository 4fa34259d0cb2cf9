use ivd_core::{Classified, VoxelCoord};

use super::*;
use crate::fixtures::{bump, field, middle, sheared_grid, voxels};

/// A bump that stays away from the border and stretches cells well, yet doesn't fold.
fn bumped(grid: &Grid) -> FieldBricks {
    let radius = 7.0 * grid.spacing()[0].max(grid.spacing()[1]);
    let push = Vector3::new(0.7, -0.5, 0.4) * 0.45 * radius;
    field(grid, bump(middle(grid), radius, push))
}

#[test]
fn zero_field_has_a_zero_inverse_without_bricks() {
    let grid = sheared_grid([20, 9, 1]);
    let inverse = invert(&FieldBricks::zero([20, 9, 1]), &grid, &Exec::default()).unwrap();
    assert_eq!(inverse.field.stored(), 0);
    assert_eq!((inverse.residual_max_voxels, inverse.worst), (0.0, None));
}

#[test]
fn smooth_bump_on_a_sheared_grid_is_inverted_to_rounding() {
    for grid in [sheared_grid([33, 30, 17]), Grid::with_spacing([30, 30, 30], [1.0; 3]).unwrap()] {
        let forward = bumped(&grid);
        let inverse = invert(&forward, &grid, &Exec::default()).unwrap();
        assert!(inverse.residual_max_voxels < 1e-5, "residual {}", inverse.residual_max_voxels);
        let worst = voxels(&grid)
            .map(|v| {
                let y = VoxelCoord::from(v).0;
                let psi = Vector3::from(inverse.field.at(v)).map(f64::from);
                let x = y + grid.inverse_linear_part() * psi;
                // The library's own sampler is not used here.
                (x + grid.inverse_linear_part() * forward.sample(x) - y).norm()
            })
            .fold(0.0, f64::max);
        assert!(worst < 1e-5, "independent residual {worst}");
        let still =
            voxels(&grid).filter(|v| forward.at(*v) == [0.0; 3]).all(|v| inverse.field.at(v) == [0.0; 3]);
        assert!(still, "an unmoved voxel is its own origin");
    }
}

#[test]
fn affine_map_is_inverted_exactly_inside() {
    let grid = sheared_grid([24, 24, 24]);
    let centre = middle(&grid);
    let m = Matrix3::new(0.05, 0.2, 0.0, -0.1, -0.08, 0.03, 0.02, 0.0, 0.1);
    let forward = field(&grid, |p| m * (p - centre));
    let inverse = invert(&forward, &grid, &Exec::default()).unwrap();
    let back = (Matrix3::identity() + m).try_inverse().unwrap();
    for v in voxels(&grid) {
        let y = grid.linear_part() * VoxelCoord::from(v).0;
        let x = back * (y - centre) + centre;
        let at = grid.inverse_linear_part() * x;
        if (0..3).all(|a| (0.0..=23.0).contains(&at[a])) {
            let found = y + Vector3::from(inverse.field.at(v)).map(f64::from);
            assert!((found - x).norm() < 2e-5, "{v:?}: {found} for {x}");
        }
    }
}

#[test]
fn rough_random_fields_just_short_of_folding_are_inverted() {
    let grid = Grid::with_spacing([17, 16, 9], [1.0, 2.0, 0.5]).unwrap();
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
    };
    let noise: Vec<Vector3<f64>> = (0..grid.len()).map(|_| Vector3::from_fn(|_, _| 0.3 * random())).collect();
    let forward = field(&grid, |p| {
        let v = grid.inverse_linear_part() * p;
        let at = VoxelIndex([0, 1, 2].map(|a| v[a].round() as usize));
        let border = (0..3).any(|a| at.0[a] == 0 || at.0[a] + 1 == grid.dims()[a]);
        if border { Vector3::zeros() } else { grid.linear_part() * noise[grid.linear(at)] }
    });
    let inverse = invert(&forward, &grid, &Exec::default()).unwrap();
    assert!(inverse.residual_max_voxels < 1e-5, "residual {}", inverse.residual_max_voxels);
}

#[test]
fn shift_takes_its_origins_from_beyond_the_border() {
    let grid = Grid::with_spacing([8, 8, 8], [1.0; 3]).unwrap();
    let forward = field(&grid, |_| Vector3::new(3.0, 0.0, 0.0));
    let inverse = invert(&forward, &grid, &Exec::default()).unwrap();
    assert!(voxels(&grid).all(|v| inverse.field.at(v) == [-3.0, 0.0, 0.0]));
}

#[test]
fn scale_of_the_scene_does_not_matter() {
    for scale in [1e-3, 1.0, 1e3] {
        let grid = Grid::with_spacing([24, 24, 24], [scale, 1.5 * scale, scale]).unwrap();
        let inverse = invert(&bumped(&grid), &grid, &Exec::default()).unwrap();
        assert!(inverse.residual_max_voxels < 1e-5, "scale {scale}: {}", inverse.residual_max_voxels);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_inverse() {
    let grid = sheared_grid([33, 30, 17]);
    let forward = bumped(&grid);
    let one = invert(&forward, &grid, &Exec::default().with_threads(1)).unwrap();
    for threads in [2, 3] {
        assert_eq!(one, invert(&forward, &grid, &Exec::default().with_threads(threads)).unwrap());
    }
}

#[test]
fn a_folded_field_shows_in_no_false_residual() {
    let grid = Grid::with_spacing([24, 24, 24], [1.0; 3]).unwrap();
    let forward = field(&grid, bump(middle(&grid), 6.0, Vector3::new(9.0, 0.0, 0.0)));
    let inverse = invert(&forward, &grid, &Exec::default()).unwrap();
    assert!(inverse.residual_max_voxels < 1e-5, "some preimage exists for every voxel of a continuous map");
}

#[test]
fn cancelled_work_stops() {
    let grid = Grid::with_spacing([24, 24, 24], [1.0; 3]).unwrap();
    let exec = Exec::default();
    exec.cancel.cancel();
    let error = invert(&bumped(&grid), &grid, &exec).unwrap_err();
    assert_eq!(error.error_class(), ivd_core::ErrorClass::Cancelled);
}

use nalgebra::Matrix3;

#[test]
fn motions_of_very_many_voxels_are_inverted_without_a_search_through_all_of_space() {
    // A shift far out of the grid, steep enough that the origin isn't where the motion at the voxel itself would have it.
    let grid = Grid::with_spacing([12, 11, 10], [0.5, 1.0, 2.0]).unwrap();
    for shift in [300.0, 1e5, 1e9] {
        let forward = field(&grid, |p| Vector3::new(shift + 0.3 * p.y, -shift, 0.1 * p.x));
        let inverse = invert(&forward, &grid, &Exec::default()).unwrap();
        // What `f32` keeps of such a vector, in voxels of half a millimetre.
        let kept = 4.0 * f64::from(f32::EPSILON) * shift / 0.5;
        let residual = inverse.residual_max_voxels;
        assert!(residual <= 1e-5 + kept, "{residual} voxels for a shift of {shift} mm");
    }
}

#[test]
fn bricks_at_once_are_the_plain_solver_voxel_by_voxel_and_the_same_bytes_on_any_processor() {
    for grid in [sheared_grid([33, 30, 17]), Grid::with_spacing([9, 30, 21], [1.0; 3]).unwrap()] {
        // Smooth, kinked at every voxel, up to the border, and folded.
        let kinked =
            field(&grid, |p| Vector3::new((3.0 * p.x).sin(), (5.0 * p.y).cos(), (4.0 * p.z).sin()) * 0.2);
        let centre = middle(&grid);
        let turned = field(&grid, |p| Vector3::new(-(p.y - centre.y), p.x - centre.x, 0.0) * 0.4);
        let folded = field(&grid, bump(centre, 7.0, Vector3::new(9.0, 0.0, 0.0)));
        for (forward, folds) in [(bumped(&grid), false), (kinked, false), (turned, false), (folded, true)] {
            let found = invert(&forward, &grid, &Exec::default()).unwrap();
            assert_eq!(found, invert(&forward, &grid, &Exec::default().with_simd(false)).unwrap());
            let solver = Solver::new(&forward, &grid);
            for v in voxels(&grid).filter(|v| forward.at(*v) != [0.0; 3] && !folds) {
                let y = VoxelCoord::from(v).0;
                let plain = solver.solve(y, y - solver.sampler().at(y));
                let here = y + grid.inverse_linear_part() * Vector3::from(found.field.at(v)).map(f64::from);
                assert!((here - plain).norm() < 1e-6 * (1.0 + plain.norm()), "{v:?}: {here} for {plain}");
            }
        }
    }
}
