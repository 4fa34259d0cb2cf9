//! The voxels of a bone, which a map is told to move with it.

use ivd_core::{Labels, Lattice, VoxelCoord};
use nalgebra::Vector3;

use super::BoneSpec;

/// Points of a bone that are told at most: beyond it every second voxel is, in the order of memory, or every third, …
const MOST: usize = 20_000;

/// The voxels (voxel coordinates) that belong to a bone: of its class, in its region. None where it has no class, which alone
/// tells bone from what is beside it.
pub(super) fn voxels(lattice: &Lattice, labels: Option<&Labels>, part: &BoneSpec) -> Vec<Vector3<f64>> {
    let (Some(class), Some(labels)) = (part.class, labels) else { return Vec::new() };
    let grid = lattice.grid();
    let origin = Vector3::from(grid.origin());
    let linear = grid.linear_part();
    let mine = || {
        let of_class = labels.ids().iter().enumerate().filter(|(_, id)| **id == class);
        let at = of_class.map(|(i, _)| VoxelCoord::from(grid.index(i)).0);
        at.filter(|at| part.region.is_none_or(|region| region.holds(linear * at, origin)))
    };
    let every = mine().count().div_ceil(MOST).max(1);
    mine().step_by(every).collect()
}
