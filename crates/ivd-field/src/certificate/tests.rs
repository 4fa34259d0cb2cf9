use nalgebra::Matrix3;

use super::*;
use crate::fixtures::{bump, field, middle, sheared_grid};
use crate::sampler::gradient;

fn check(forward: &FieldBricks, grid: &Grid) -> Certificate {
    certify(forward, grid, 0.05, |_| true, &Exec::default()).unwrap()
}

/// Of the cells that don't reach over the border.
fn check_within(forward: &FieldBricks, grid: &Grid, threshold: f64) -> Certificate {
    let within = |c: [i64; 3]| (0..3).all(|a| c[a] >= 0 && c[a] + 1 < grid.dims()[a] as i64);
    certify(forward, grid, threshold, within, &Exec::default()).unwrap()
}

/// Smallest determinant over a dense sampling, in millimetres: an oracle that shares no polynomial with the certificate.
fn sampled(forward: &FieldBricks, grid: &Grid, steps: usize) -> f64 {
    let (a, inverse) = (grid.linear_part(), grid.inverse_linear_part());
    let sampler = Sampler::new(forward, grid);
    let mut least = f64::INFINITY;
    for z in 0..grid.dims()[2] as i64 - 1 {
        for y in 0..grid.dims()[1] as i64 - 1 {
            for x in 0..grid.dims()[0] as i64 - 1 {
                let corners = sampler.corners([x, y, z]);
                for i in 0..(steps + 1).pow(3) {
                    let n = steps + 1;
                    let t =
                        Vector3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) / steps as f64;
                    let world = a * (Matrix3::identity() + gradient(&corners, t)) * inverse;
                    least = least.min(world.determinant());
                }
            }
        }
    }
    least
}

/// A random field, of which many cells fold where `amplitude` is large.
fn drawn(grid: &Grid, seed: u64, amplitude: f64) -> FieldBricks {
    let mut s = seed;
    let random: Vec<Vector3<f64>> = (0..grid.len())
        .map(|_| {
            Vector3::from_fn(|_, _| {
                s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                ((s >> 33) as f64 / (1_u64 << 31) as f64 - 0.5) * amplitude
            })
        })
        .collect();
    field(grid, |p| {
        let v = grid.inverse_linear_part() * p;
        let at = ivd_core::VoxelIndex([0, 1, 2].map(|a| v[a].round() as usize));
        // Some of a large one stands still.
        if v.z > 12.0 && seed.is_multiple_of(3) {
            Vector3::zeros()
        } else {
            grid.linear_part() * random[grid.linear(at)]
        }
    })
}

#[test]
fn bound_lies_just_below_a_dense_sampling_of_random_fields() {
    let grid = sheared_grid([9, 8, 7]);
    let mut folded = 0;
    for seed in 0..12_u64 {
        let forward = drawn(&grid, seed + 1, 0.1 + 0.05 * seed as f64);
        let proof = check_within(&forward, &grid, 10.0);
        let dense = sampled(&forward, &grid, 6);
        assert!(proof.min_det <= dense.min(1.0) + 1e-9, "seed {seed}: bound {} above {dense}", proof.min_det);
        if proof.holds() {
            assert!(dense > 0.0);
            assert!(proof.min_det > dense - 0.05, "seed {seed}: bound {} far below {dense}", proof.min_det);
        } else {
            folded += 1;
        }
    }
    assert!((1..12).contains(&folded), "both outcomes occur: {folded} folded");
}

#[test]
fn affine_maps_have_their_own_determinant() {
    let grid = sheared_grid([9, 10, 11]);
    let centre = middle(&grid);
    for m in [
        Matrix3::new(0.05, 0.2, 0.0, -0.1, -0.08, 0.03, 0.02, 0.0, 0.1),
        nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 0.7).matrix() - Matrix3::identity(),
    ] {
        let forward = field(&grid, |p| m * (p - centre));
        let proof = check_within(&forward, &grid, 0.05);
        let det = (Matrix3::identity() + m).determinant();
        assert!((proof.min_det - det.min(1.0)).abs() < 1e-4, "{} for {det}", proof.min_det);
    }
    let mirror = field(&grid, |p| Vector3::new(-2.0 * (p - centre).x, 0.0, 0.0));
    assert!(!check(&mirror, &grid).holds(), "a reflection is no deformation");
}

#[test]
fn gaussian_push_is_caught_exactly_from_its_fold_limit_on() {
    // u = A exp(−r²/2s²) along z has its steepest fall A / (s √e) at r = s: it folds from A = s √e on.
    let grid = Grid::with_spacing([40, 40, 80], [1.0, 1.0, 0.5]).unwrap();
    let (centre, s) = (middle(&grid), 5.0);
    let push = |a: f64| {
        field(&grid, move |p| {
            let r2 = (p - centre).norm_squared();
            Vector3::new(
                0.0,
                0.0,
                if r2 < (3.7 * s) * (3.7 * s) { a * (-r2 / (2.0 * s * s)).exp() } else { 0.0 },
            )
        })
    };
    let limit = s * std::f64::consts::E.sqrt();
    let below = check(&push(0.97 * limit), &grid);
    assert!(below.holds() && below.min_det < 0.05, "just below: {}", below.min_det);
    let above = check(&push(1.03 * limit), &grid);
    assert!(!above.holds());
    let depth = (above.worst.unwrap().cell[2] as f64 + 0.5) * 0.5 - centre.z;
    assert!((depth - s).abs() < 1.5, "the fold is found where it is: {depth}");
}

#[test]
fn inverted_cell_is_found_though_all_its_corners_are_fine() {
    // One voxel pushed past its neighbour folds the cells around it, in every brick position.
    let grid = Grid::with_spacing([20, 20, 20], [1.0; 3]).unwrap();
    for at in [[7.0, 7.0, 7.0], [8.0, 8.0, 8.0], [0.0, 5.0, 19.0], [19.0, 19.0, 19.0]] {
        for (push, folds) in [(1.2, true), (0.8, false)] {
            let way = if at[0] > 10.0 { -push } else { push };
            let forward = field(&grid, |p| {
                if (p - Vector3::from(at)).norm() < 0.5 {
                    Vector3::new(way, 0.0, 0.0)
                } else {
                    Vector3::zeros()
                }
            });
            assert_eq!(!check(&forward, &grid).holds(), folds, "push {push} at {at:?}");
        }
    }
}

#[test]
fn nothing_moving_is_certified_with_determinant_one() {
    let grid = sheared_grid([1, 20, 3]);
    let proof = check(&FieldBricks::zero(grid.dims()), &grid);
    assert_eq!((proof.min_det, proof.cells, proof.worst), (1.0, 0, None));
    assert!(proof.holds());
}

#[test]
fn one_slice_is_a_plane_that_can_fold() {
    let grid = Grid::with_spacing([32, 32, 1], [1.0, 1.0, 5.0]).unwrap();
    let fine = field(&grid, bump(middle(&grid), 10.0, Vector3::new(3.0, 0.0, 0.0)));
    assert!(check(&fine, &grid).holds());
    let folded = field(&grid, bump(middle(&grid), 10.0, Vector3::new(9.0, 0.0, 0.0)));
    assert!(!check(&folded, &grid).holds());
}

#[test]
fn histogram_counts_every_cell_once_on_any_number_of_threads() {
    let grid = sheared_grid([33, 30, 17]);
    let forward = field(&grid, bump(middle(&grid), 5.0, Vector3::new(1.0, 0.5, 0.0)));
    let one = certify(&forward, &grid, 0.05, |_| true, &Exec::default().with_threads(1)).unwrap();
    assert_eq!(one.histogram.counts.iter().sum::<u64>(), one.cells);
    for threads in [2, 3] {
        assert_eq!(
            one,
            certify(&forward, &grid, 0.05, |_| true, &Exec::default().with_threads(threads)).unwrap()
        );
    }
}

#[test]
fn least_bound_and_thin_cells_are_the_same_whatever_is_passed_over() {
    let grid = sheared_grid([19, 17, 26]);
    let centre = middle(&grid);
    let push = |height| field(&grid, bump(centre, 7.0, Vector3::new(0.2, 0.1, height)));
    let fields = (0..24).map(|i| drawn(&grid, i + 1, 0.02 + 0.07 * i as f64));
    let smooth = [0.1, 2.0, 5.0, 9.0].map(push);
    let huge = [1e-30, 1e6, 1e20, 1e37].map(|a| drawn(&grid, 5, a));
    let exec = Exec::default();
    for forward in fields.chain(smooth).chain(huge).chain([FieldBricks::zero(grid.dims())]) {
        for threshold in [0.0, 0.05, 0.7] {
            let counts = |cell: [i64; 3]| cell[0] % 5 != 3;
            let of = |detail| {
                certify_bricks(&forward, &grid, threshold, &counts, &touched(&forward), detail, &exec)
                    .unwrap()
            };
            let (all, least) = (of(Detail::All), of(Detail::Least));
            assert_eq!(all.min_det.to_bits(), least.min_det.to_bits());
            assert_eq!((all.worst, &all.folded, &all.thin), (least.worst, &least.folded, &least.thin));
            assert!(least.cells <= all.cells);
        }
    }
    let all = check(&push(2.0), &grid);
    let forward = push(2.0);
    let least =
        certify_bricks(&forward, &grid, 0.05, &|_| true, &touched(&forward), Detail::Least, &exec).unwrap();
    assert!(10 * least.cells < all.cells, "{} of {} cells are looked at", least.cells, all.cells);
}

#[test]
fn cells_squeezed_to_nothing_are_the_same_whether_others_are_passed_over_or_not() {
    let grid = Grid::with_spacing([2, 2, 2], [1.0; 3]).unwrap();
    let mut folded = 0;
    for k in [0.0, 1e-6, 4e-5, 4.5e-5, 1e-4, 1e-3] {
        let forward = field(&grid, |p| (p - Vector3::repeat(0.5)) * (k - 1.0));
        let exec = Exec::default();
        let of = |detail| {
            certify_bricks(&forward, &grid, 0.0, &|_| true, &touched(&forward), detail, &exec).unwrap()
        };
        let (all, least) = (of(Detail::All), of(Detail::Least));
        assert_eq!(all.min_det.to_bits(), least.min_det.to_bits(), "squeezed to {k}");
        assert_eq!((all.worst, &all.folded), (least.worst, &least.folded), "squeezed to {k}");
        folded += usize::from(!all.holds());
    }
    assert!((1..6).contains(&folded), "both outcomes occur: {folded} folded");
}
