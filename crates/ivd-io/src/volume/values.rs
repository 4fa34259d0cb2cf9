use std::io::Write;
use std::path::Path;

use ivd_core::{Exec, Scalar, Volume, VoxelType, with_voxels};

use crate::order::swap_in_place;
use crate::volume::replace::put;
use crate::volume::{ByteOrder, Error};

/// Bytes written between two looks at the cancel flag.
const CHUNK: usize = 1 << 20;

/// What a format keeps of a volume's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Values {
    /// The stored voxels; slope and intercept are in the header, or (1, 0).
    Stored,
    /// Real values as `f32`.
    Real,
}

impl Values {
    /// For a format without slope and intercept: real values as `f32` where the two change anything.
    pub(crate) fn without_scale(volume: &Volume) -> Self {
        if volume.slope() == 1.0 && volume.intercept() == 0.0 { Self::Stored } else { Self::Real }
    }

    /// Type of the written voxels.
    pub(crate) fn voxel_type(self, volume: &Volume) -> VoxelType {
        match self {
            Self::Stored => volume.voxel_type(),
            Self::Real => VoxelType::F32,
        }
    }

    /// Writes the voxels, least significant byte first, without a second whole copy of them.
    pub(crate) fn write(
        self,
        to: &mut dyn Write,
        path: &Path,
        volume: &Volume,
        exec: &Exec,
    ) -> Result<(), Error> {
        match self {
            Self::Stored => stored(to, path, volume, exec),
            Self::Real => real(to, path, volume, exec),
        }
    }
}

fn stored(to: &mut dyn Write, path: &Path, volume: &Volume, exec: &Exec) -> Result<(), Error> {
    let width = volume.voxel_type().bytes();
    for part in volume.voxels().as_bytes().chunks(CHUNK) {
        exec.check_cancelled()?;
        if ByteOrder::Little.is_foreign() {
            let mut swapped = part.to_vec();
            swap_in_place(&mut swapped, width);
            put(to, path, &swapped)?;
        } else {
            put(to, path, part)?;
        }
    }
    Ok(())
}

fn real(to: &mut dyn Write, path: &Path, volume: &Volume, exec: &Exec) -> Result<(), Error> {
    let mut bytes = Vec::with_capacity(CHUNK);
    with_voxels!(volume.voxels(), slice => {
        for part in slice.chunks(CHUNK / 4) {
            exec.check_cancelled()?;
            bytes.clear();
            for &value in part {
                let real = volume.real(value.to_f64()) as f32;
                bytes.extend_from_slice(&real.to_le_bytes());
            }
            put(to, path, &bytes)?;
        }
    });
    Ok(())
}
