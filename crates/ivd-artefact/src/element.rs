use ivd_core::VoxelType;

/// Type of a section's elements, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    /// Of a type that voxels can have.
    Voxel(VoxelType),
    /// Unsigned 64 bit, which no voxel is.
    U64,
}

#[allow(missing_docs, reason = "the names say it")]
impl Element {
    pub const U8: Self = Self::Voxel(VoxelType::U8);
    pub const U16: Self = Self::Voxel(VoxelType::U16);
    pub const U32: Self = Self::Voxel(VoxelType::U32);
    pub const F32: Self = Self::Voxel(VoxelType::F32);
    pub const F64: Self = Self::Voxel(VoxelType::F64);
}

impl Element {
    /// Name in the section table: `u8`, `f32`, …
    pub fn name(self) -> &'static str {
        match self {
            Self::Voxel(voxel) => voxel.name(),
            Self::U64 => "u64",
        }
    }

    /// The type of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        VoxelType::from_name(name).map(Self::Voxel).or_else(|| (name == "u64").then_some(Self::U64))
    }

    /// Bytes of one element.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Voxel(voxel) => voxel.bytes() as u64,
            Self::U64 => 8,
        }
    }
}

impl From<VoxelType> for Element {
    fn from(voxel: VoxelType) -> Self {
        Self::Voxel(voxel)
    }
}
