use ivd_core::VoxelType;

/// Type of a section's elements, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Element {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    F32,
    F64,
}

impl Element {
    const ALL: [Self; 9] =
        [Self::U8, Self::I8, Self::U16, Self::I16, Self::U32, Self::I32, Self::U64, Self::F32, Self::F64];

    /// Name in the section table: `u8`, `f32`, …
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|e| e.name() == name)
    }

    /// Bytes of one element.
    pub fn bytes(self) -> u64 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::F64 => 8,
        }
    }
}

impl From<VoxelType> for Element {
    fn from(voxel: VoxelType) -> Self {
        match voxel {
            VoxelType::U8 => Self::U8,
            VoxelType::I8 => Self::I8,
            VoxelType::U16 => Self::U16,
            VoxelType::I16 => Self::I16,
            VoxelType::U32 => Self::U32,
            VoxelType::I32 => Self::I32,
            VoxelType::F32 => Self::F32,
            VoxelType::F64 => Self::F64,
        }
    }
}
