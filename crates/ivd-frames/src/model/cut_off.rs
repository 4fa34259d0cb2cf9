//! What leaves the scan: beyond its edge there are no voxels to show it.

use ivd_core::{Grid, Lattice, Motion};
use nalgebra::Vector3;

/// How far a motion takes any vertex beyond the voxels' outer faces, further than it lay at rest (mm).
pub(super) fn cut_off(lattice: &Lattice, motion: Option<&Motion>) -> f64 {
    let Some(frame) = motion.and_then(|motion| motion.frames().last()) else { return 0.0 };
    let beyond = beyond(lattice.grid());
    let moved = frame.displacement.iter().enumerate().filter(|(_, by)| **by != [0.0; 3]);
    let further = |(v, by): (usize, &[f64; 3])| {
        let rest = lattice.world(v).0;
        beyond(rest + Vector3::from(*by)) - beyond(rest)
    };
    moved.map(further).fold(0.0, f64::max)
}

/// Tells how far a place (mm, RAS) lies beyond a grid's outer faces (mm).
fn beyond(grid: &Grid) -> impl Fn(Vector3<f64>) -> f64 {
    let (to_voxels, origin) = (grid.inverse_linear_part(), Vector3::from(grid.origin()));
    let (dims, spacing) = (grid.dims(), grid.spacing());
    move |place| {
        let at = to_voxels * (place - origin);
        let over = |a: usize| (-0.5 - at[a]).max(at[a] - (dims[a] as f64 - 0.5)).max(0.0) * spacing[a];
        Vector3::from_fn(|a, _| over(a)).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_beyond_the_outer_faces_is_outside_and_by_its_distance() {
        let grid = Grid::new(
            [10, 20, 30],
            [1.0, 2.0, 0.5],
            [5.0, 0.0, 0.0],
            [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        )
        .unwrap();
        let beyond = beyond(&grid);
        let at = |voxel: [f64; 3]| beyond(grid.world(ivd_core::VoxelCoord(voxel.into())).0);
        assert_eq!(at([-0.4, 19.4, 29.4]), 0.0);
        assert!((at([4.0, 21.5, 10.0]) - 4.0).abs() < 1e-9, "two voxels of 2 mm");
        assert!((at([-3.5, 21.5, 10.0]) - 5.0).abs() < 1e-9, "3 and 4 mm at a corner");
    }
}
