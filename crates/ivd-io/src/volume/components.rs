//! What a file of three numbers a voxel holds.

use ivd_core::{Grid, Voxels};

use crate::Space;

/// The numbers of a field as a file has them.
pub(crate) struct Components {
    pub(crate) grid: Grid,
    pub(crate) voxels: Voxels,
    /// Whether a voxel's three numbers stand together; else all of a component do.
    pub(crate) together: bool,
    /// What the numbers are along.
    pub(crate) space: Space,
    /// What the file says of itself.
    pub(crate) says: String,
}
