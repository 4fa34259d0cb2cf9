//! How far balls and vectors reach.

use ivd_core::{Error as CoreError, Grid, VoxelCoord, VoxelIndex};
use ivd_field::vectors::FARTHEST;
use nalgebra::Vector3;

/// Whether a voxel lies in a ball, its centre counted from the grid's origin (mm). Of a ball with many voxels in its box one does.
pub(super) fn reaches(grid: &Grid, centre: Vector3<f64>, radius: f64) -> bool {
    const FEW: usize = 1 << 12;
    let Some(bounds) = bounds(grid, centre, radius) else { return false };
    let range = |a: usize| bounds[a][0]..=bounds[a][1];
    if (0..3).map(|a| range(a).count()).product::<usize>() > FEW {
        return true;
    }
    let near =
        |at: [usize; 3]| (grid.linear_part() * VoxelCoord::from(VoxelIndex(at)).0 - centre).norm() < radius;
    range(2).any(|z| range(1).any(|y| range(0).any(|x| near([x, y, z]))))
}

/// First and last voxel of the box round a ball along each axis, its centre counted from the grid's origin (mm); `None` where there
/// is none.
pub(super) fn bounds(grid: &Grid, centre: Vector3<f64>, radius: f64) -> Option<[[usize; 2]; 3]> {
    let middle = grid.inverse_linear_part() * centre;
    let extent = grid.ball_extent(radius);
    let mut out = [[0; 2]; 3];
    for a in 0..3 {
        let last = grid.dims()[a] as f64 - 1.0;
        let (lo, hi) = ((middle[a] - extent[a]).floor().max(0.0), (middle[a] + extent[a]).ceil().min(last));
        if lo > hi || !(lo.is_finite() && hi.is_finite()) {
            return None;
        }
        out[a] = [lo as usize, hi as usize];
    }
    Some(out)
}

/// What vectors can't hold.
pub(super) fn too_far() -> CoreError {
    CoreError::Untrusted {
        what: "the displacement",
        problem: format!("a motion of more than {FARTHEST:e} mm is more than its vectors hold"),
        remedy: "use smaller motions, factors and rates",
    }
}
