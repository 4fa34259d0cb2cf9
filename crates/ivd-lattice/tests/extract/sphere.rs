//! An analytic surface: errors of area and volume fall with the square of the voxel size.

use ivd_core::{Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::Iso;

use crate::extract::cut_volume;
use crate::extract::mesh::{area_and_volume, assert_closed_manifold, euler};

/// A ball of radius 35 mm sampled with `n` voxels over 100 mm, its centre off the grid; ½ at the surface.
fn ball(n: usize) -> Lattice {
    let grid = Grid::with_spacing([n; 3], [100.0 / n as f64; 3]).unwrap();
    let centre = [0.13, -0.21, 0.37].map(|shift| (n - 1) as f64 / 2.0 + shift);
    let value = |i: usize| {
        let v = [i % n, i / n % n, i / n / n];
        let r = (0..3).map(|a| (v[a] as f64 - centre[a]).powi(2)).sum::<f64>().sqrt();
        (0.5 - (r - 0.35 * n as f64) / 8.0).clamp(0.0, 1.0) as f32
    };
    let voxels: Vec<f32> = (0..n * n * n).map(value).collect();
    cut_volume(&Volume::new(grid, Voxels::from(voxels)).unwrap(), None, Iso::Value(0.5))
}

#[test]
fn area_and_volume_converge_with_the_square_of_the_voxel() {
    let r: f64 = 35.0;
    let area = 4.0 * std::f64::consts::PI * r * r;
    let errors = [32, 64, 128].map(|n| {
        let lattice = ball(n);
        assert_eq!(euler(&lattice), 2);
        let (a, v) = area_and_volume(&lattice);
        [(a - area).abs() / area, (v - area * r / 3.0).abs() / (area * r / 3.0)]
    });
    for (coarse, fine) in errors.iter().zip(&errors[1..]) {
        for k in 0..2 {
            let order = (coarse[k] / fine[k]).log2();
            assert!(order > 1.7, "order {order} from {errors:?}");
        }
    }
    assert!(errors[2][0] < 5e-4 && errors[2][1] < 5e-4, "{errors:?}");
}

#[test]
fn every_vertex_of_a_ball_lies_on_it() {
    let lattice = ball(48);
    assert_closed_manifold(&lattice, "ball");
    let centre = [0.13, -0.21, 0.37].map(|shift| 23.5 + shift);
    for i in 0..lattice.keys().len() {
        let v = lattice.voxel(i).0;
        let r = (0..3).map(|a| (v[a] - centre[a]).powi(2)).sum::<f64>().sqrt();
        assert!((r - 0.35 * 48.0).abs() < 0.02, "vertex {i} at radius {r}");
    }
}
