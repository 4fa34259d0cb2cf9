use ivd_core::VoxelType;
use serde::{Deserialize, Serialize};

use crate::ByteOrder;

/// How a file without a header is laid out; x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawLayout {
    /// Voxels along x, y, z. For a folder of raw slices z may be 0: the number of files is taken.
    pub dims: [usize; 3],
    /// Stored type.
    pub voxel_type: VoxelType,
    /// Distance of voxel centres [mm].
    #[serde(default = "unit_spacing")]
    pub spacing: [f64; 3],
    /// Byte order.
    #[serde(default)]
    pub order: ByteOrder,
    /// Bytes before the first voxel, in each file.
    #[serde(default)]
    pub skip: u64,
}

fn unit_spacing() -> [f64; 3] {
    [1.0; 3]
}
