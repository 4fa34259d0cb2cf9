//! Which class a vertex is made of.

use nalgebra::Vector3;

use crate::{Error, Labels, Lattice, VoxelIndex};

/// Labels must lie on the lattice's grid.
///
/// # Errors
/// [`Error::GridMismatch`].
pub fn check(lattice: &Lattice, labels: &Labels) -> Result<(), Error> {
    lattice.grid().require(labels.grid(), "lattice", "labels")
}

/// The label of the voxel just inside the surface at a vertex: of the voxels round it, the one that lies furthest against
/// the surface's normal `outward` (mm, any length), the first of several. 0 where there is none, or no normal.
pub fn inside(lattice: &Lattice, labels: &Labels, vertex: usize, outward: Vector3<f64>) -> u16 {
    let at = lattice.voxel(vertex).0;
    let linear = lattice.grid().linear_part();
    let mut best = (0.0, 0);
    for (voxel, index) in round(lattice, vertex) {
        let label = labels.ids()[lattice.grid().linear(index)];
        let depth = -(linear * (voxel - at)).dot(&outward);
        if depth > best.0 && label != 0 {
            best = (depth, label);
        }
    }
    best.1
}

/// Whether a vertex lies beside a voxel of a class: at an end of its grid edge, a corner of its face or cell.
pub fn beside(lattice: &Lattice, labels: &Labels, vertex: usize, class: u16) -> bool {
    round(lattice, vertex).any(|(_, index)| labels.ids()[lattice.grid().linear(index)] == class)
}

/// The voxels round a vertex, less than one away along every axis: its grid edge's ends, its face's or cell's corners.
pub fn round(lattice: &Lattice, vertex: usize) -> impl Iterator<Item = (Vector3<f64>, VoxelIndex)> {
    let dims = lattice.grid().dims();
    let at = lattice.voxel(vertex).0;
    (0..8_usize).filter_map(move |corner| {
        let voxel = Vector3::from_fn(|a, _| at[a].floor() + f64::from(u8::from(corner >> a & 1 == 1)));
        let beside = (0..3).all(|a| (voxel[a] - at[a]).abs() < 1.0);
        let within = (0..3).all(|a| voxel[a] >= 0.0 && voxel[a] < dims[a] as f64);
        let index = || VoxelIndex([voxel.x as usize, voxel.y as usize, voxel.z as usize]);
        (beside && within).then(|| (voxel, index()))
    })
}
