//! Grids, fields and lattices that several tests share.

use ivd_core::{Displacement, Exec, FieldBricks, Grid, VoxelCoord, VoxelIndex};
use nalgebra::Vector3;

use crate::inverse::from_bricks;
use crate::sampler::{brick_at, brick_voxels};

/// A grid with unequal spacing, a rotated and sheared direction, left-handed, far from the origin.
pub(crate) fn sheared_grid(dims: [usize; 3]) -> Grid {
    let x = Vector3::new(0.96, 0.28, 0.0);
    let y = Vector3::new(-0.28, 0.96, 0.0);
    let z = Vector3::new(0.1, 0.2, -1.0).normalize();
    Grid::new(dims, [0.5, 0.7, 2.0], [1e4, -300.0, 42.0], [x.into(), y.into(), z.into()]).unwrap()
}

/// The field `u` [mm] of a world position relative to the grid's origin [mm], sampled at every voxel.
pub(crate) fn field(grid: &Grid, u: impl Fn(Vector3<f64>) -> Vector3<f64>) -> FieldBricks {
    let bricks = grid.dims().map(|n| n.div_ceil(8));
    let all: Vec<usize> = (0..bricks.iter().product()).collect();
    let vectors = all.iter().map(|&b| {
        let mut out = vec![[0.0_f32; 3]; FieldBricks::VOXELS].into_boxed_slice();
        for (slot, voxel) in brick_voxels(grid.dims(), brick_at(bricks, b)) {
            out[slot] = u(grid.linear_part() * VoxelCoord::from(voxel).0).map(|c| c as f32).into();
        }
        out
    });
    from_bricks(grid.dims(), &all, vectors).unwrap()
}

/// A displacement with its inverse, uncertified.
pub(crate) fn displacement(grid: &Grid, forward: FieldBricks) -> Displacement {
    let inverse = crate::inverse::invert(&forward, grid, &Exec::default()).unwrap();
    Displacement {
        grid: grid.clone(),
        time: 0.0,
        forward,
        inverse: inverse.field,
        inverse_residual_max: inverse.residual_max_voxels,
        min_det_j: 0.0,
        vacated: Vec::new().into(),
    }
}

/// A smooth bump: `push` at `centre` (relative to the origin), 0 with its slope from `radius` on [mm].
pub(crate) fn bump(
    centre: Vector3<f64>,
    radius: f64,
    push: Vector3<f64>,
) -> impl Fn(Vector3<f64>) -> Vector3<f64> {
    move |p| {
        let t = (p - centre).norm() / radius;
        if t < 1.0 { push * (1.0 - t * t).powi(3) } else { Vector3::zeros() }
    }
}

/// Position of the middle of a grid relative to its origin [mm].
pub(crate) fn middle(grid: &Grid) -> Vector3<f64> {
    grid.linear_part() * Vector3::from(grid.dims()).map(|n| (n as f64 - 1.0) / 2.0)
}

/// All voxels of a grid.
pub(crate) fn voxels(grid: &Grid) -> impl Iterator<Item = VoxelIndex> + '_ {
    (0..grid.len()).map(|i| grid.index(i))
}
