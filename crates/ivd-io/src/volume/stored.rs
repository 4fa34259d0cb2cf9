use std::io::Read;
use std::path::Path;

use ivd_core::{Buffer, Exec, VoxelType, Voxels};

use crate::volume::bounded::{self, Declared, Packing};
use crate::volume::{ByteOrder, Error};

/// A file's voxel type. 64-bit integers have no stored type of their own: they are read as 32-bit ones where every
/// value fits, and refused by the first that doesn't.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileType {
    Plain(VoxelType),
    I64,
    U64,
}

impl FileType {
    /// Bytes of one voxel in the file.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::Plain(t) => t.bytes(),
            Self::I64 | Self::U64 => 8,
        }
    }
}

/// Where the voxels lie in a stream and how.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    pub(crate) file_type: FileType,
    pub(crate) count: usize,
    pub(crate) order: ByteOrder,
    pub(crate) packing: Packing,
    /// Bytes of the file from the start of the stream, packed.
    pub(crate) available: u64,
    /// Unpacked bytes between the stream's place and the first voxel.
    pub(crate) skip: u64,
}

impl Layout {
    /// Refuses sizes that the file can't hold, then what the memory limit forbids.
    pub(crate) fn check(&self, path: &Path, exec: &Exec) -> Result<(), Error> {
        self.declared().check(path, self.skip, exec).map(drop)
    }

    /// Refuses a file that can't hold `frames` of such voxels, one after the other.
    pub(crate) fn fits(&self, path: &Path, frames: usize) -> Result<(), Error> {
        let count = self.count.saturating_mul(frames);
        Self { count, ..*self }.declared().fits(path, self.skip).map(drop)
    }

    /// A wide voxel takes the place of an f64 in the file.
    fn declared(&self) -> Declared {
        let voxel_type = match self.file_type {
            FileType::Plain(t) => t,
            FileType::I64 | FileType::U64 => VoxelType::F64,
        };
        let Self { count, order, packing, available, .. } = *self;
        Declared { voxel_type, count, order, packing, available }
    }
}

/// Reads the voxels of a layout; sizes are checked before memory is taken.
pub(crate) fn read(reader: &mut dyn Read, path: &Path, layout: Layout, exec: &Exec) -> Result<Voxels, Error> {
    layout.check(path, exec)?;
    let declared = layout.declared();
    bounded::discard(reader, path, layout.skip)?;
    let voxels = match layout.file_type {
        FileType::Plain(_) => bounded::read_voxels(reader, path, declared, exec)?,
        FileType::I64 => Voxels::I32(narrow(reader, path, declared, exec, i64::from_ne_bytes)?),
        FileType::U64 => Voxels::U32(narrow(reader, path, declared, exec, u64::from_ne_bytes)?),
    };
    if layout.packing == Packing::Deflated {
        bounded::verify_end(reader, path, exec)?;
    }
    Ok(voxels)
}

/// Voxels read while narrowing.
const BATCH: usize = 1 << 16;

fn narrow<W, N>(
    reader: &mut dyn Read,
    path: &Path,
    declared: Declared,
    exec: &Exec,
    decode: fn([u8; 8]) -> W,
) -> Result<Buffer<N>, Error>
where
    W: Copy + std::fmt::Display,
    N: TryFrom<W> + bytemuck::Pod,
{
    let mut values = exec.bulk::<N>("the volume", declared.count)?;
    let mut bytes = vec![0_u8; 8 * BATCH];
    for (batch, out) in values.chunks_mut(BATCH).enumerate() {
        exec.check_cancelled()?;
        let bytes = &mut bytes[..8 * out.len()];
        let got = bounded::read_up_to(reader, path, bytes)?;
        if got < bytes.len() {
            let found = 8 * BATCH * batch + got;
            return Err(Error::truncated(path, "voxels", 8 * declared.count as u64, found as u64));
        }
        if declared.order.is_foreign() {
            crate::order::swap_in_place(bytes, 8);
        }
        for (value, wide) in out.iter_mut().zip(bytes.as_chunks::<8>().0) {
            let wide = decode(*wide);
            *value = N::try_from(wide).map_err(|_| {
                Error::unsupported(
                    path,
                    format!("a 64-bit voxel of {wide}"),
                    "convert the file to f64 or to a narrower integer",
                )
            })?;
        }
    }
    Ok(values.into_buffer())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_wide(bytes: &[u8], file_type: FileType) -> Result<Voxels, Error> {
        let layout = Layout {
            file_type,
            count: bytes.len() / 8,
            order: ByteOrder::Big,
            packing: Packing::Raw,
            available: bytes.len() as u64,
            skip: 0,
        };
        read(&mut &bytes[..], Path::new("x"), layout, &Exec::default())
    }

    #[test]
    fn wide_integers_narrow_where_they_fit_and_are_refused_where_not() {
        let bytes = [(-5_i64).to_be_bytes(), 7_i64.to_be_bytes()].concat();
        assert_eq!(read_wide(&bytes, FileType::I64).unwrap(), Voxels::from(vec![-5_i32, 7]));
        assert!(read_wide(&bytes, FileType::U64).is_err(), "-5 is 2^64 - 5");
        assert!(read_wide(&i64::from(i32::MAX).to_be_bytes(), FileType::I64).is_ok());
        let error = read_wide(&(i64::from(i32::MAX) + 1).to_be_bytes(), FileType::I64).unwrap_err();
        assert!(error.to_string().contains("2147483648"), "{error}");
    }
}
