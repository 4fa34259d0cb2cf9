//! Reading that a hostile header can't turn into a hostile allocation.
//!
//! Sizes are multiplied with overflow checks, compared with the bytes that the file really has (or, for deflated
//! data, with the most that its bytes could inflate to) and with the memory limit; only then is memory taken, once,
//! for exactly the declared voxels, and filled in place.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use ivd_core::{Exec, Scalar, VoxelType, Voxels};

use crate::order::swap_in_place;
use crate::volume::{ByteOrder, Error};

/// Bytes read between two looks at the cancel flag.
const CHUNK: usize = 4 << 20;

/// Deflate can't expand its input by more than this factor: the shortest code, 2 bits a match of 258 bytes
/// (RFC 1951), makes 1032. A little is added for what follows the last whole byte.
const DEFLATE_MOST: u64 = 1032;

/// Voxels that are deflated more than this are taken beside the memory limit by nobody: scans deflate to a half or a tenth,
/// label volumes to a hundredth; bombs come close to [`DEFLATE_MOST`].
const DEFLATE_PLAUSIBLE: u64 = 120;

/// Number of voxels; refuses what doesn't fit into memory addresses, naming `field`.
pub(crate) fn voxel_count(path: &Path, field: &str, dims: [usize; 3]) -> Result<usize, Error> {
    dims.iter()
        .try_fold(1_usize, |n, &d| n.checked_mul(d))
        .filter(|&n| n > 0 && n <= isize::MAX as usize / 64)
        .ok_or_else(|| {
            Error::field(
                path,
                field,
                format!(
                    "{dims:?} voxels: every size must be at least 1 and their product must be addressable"
                ),
            )
        })
}

/// A header's size as `usize`; refuses zero and what doesn't fit.
pub(crate) fn size(path: &Path, field: &str, value: i64) -> Result<usize, Error> {
    usize::try_from(value)
        .ok()
        .filter(|&n| n > 0)
        .ok_or_else(|| Error::field(path, field, format!("{value} is not a size of at least 1")))
}

/// The length in bytes of a regular file; refuses what may have no end, and what would wait for a writer.
pub(crate) fn regular(path: &Path) -> Result<u64, Error> {
    let meta = std::fs::metadata(path).map_err(|e| Error::io(path, "open", e))?;
    if !meta.is_file() {
        let problem = io::Error::new(io::ErrorKind::InvalidInput, "not a regular file");
        return Err(Error::io(path, "open", problem));
    }
    Ok(meta.len())
}

/// Opens a regular file; gives it and its length in bytes.
pub(crate) fn open(path: &Path) -> Result<(File, u64), Error> {
    let length = regular(path)?;
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    Ok((file, length))
}

/// Up to `most` bytes from the start of a file.
pub(crate) fn head(path: &Path, most: usize) -> Result<Vec<u8>, Error> {
    let (file, length) = open(path)?;
    let mut bytes = Vec::with_capacity(most.min(length as usize));
    file.take(most as u64).read_to_end(&mut bytes).map_err(|e| Error::io(path, "read", e))?;
    Ok(bytes)
}

/// Moves to `offset` in the file.
pub(crate) fn seek(file: &mut File, path: &Path, offset: u64) -> Result<(), Error> {
    file.seek(SeekFrom::Start(offset)).map(drop).map_err(|e| Error::io(path, "seek in", e))
}

/// How the voxels lie in the bytes that follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    /// As they are.
    Raw,
    /// Deflated, with a gzip or zlib frame.
    Deflated,
}

/// What is to be read: `count` voxels of `voxel_type` in `order`, `packing` in at most `available` bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Declared {
    pub(crate) voxel_type: VoxelType,
    pub(crate) count: usize,
    pub(crate) order: ByteOrder,
    pub(crate) packing: Packing,
    pub(crate) available: u64,
}

impl Declared {
    /// Bytes of the voxels once unpacked; refuses what the file can't hold, then what the memory limit forbids.
    /// `skipped` bytes come before the voxels in the unpacked stream.
    pub(crate) fn check(&self, path: &Path, skipped: u64, exec: &Exec) -> Result<u64, Error> {
        let needed = self.fits(path, skipped)?;
        let fits = exec.check_memory("the volume", needed - skipped);
        if exec.spill.is_none() || !self.is_plausible(needed) {
            fits?;
        }
        Ok(needed - skipped)
    }

    /// Whether so many bytes may be put aside where they don't fit into memory: no more than the file has, or than it is
    /// likely to unpack to.
    fn is_plausible(&self, needed: u64) -> bool {
        match self.packing {
            Packing::Raw => true,
            Packing::Deflated => needed <= self.available.saturating_mul(DEFLATE_PLAUSIBLE),
        }
    }

    /// Bytes of the voxels and of what comes before them, once unpacked; refuses more than the file can hold.
    pub(crate) fn fits(&self, path: &Path, skipped: u64) -> Result<u64, Error> {
        let needed = (self.count as u64)
            .checked_mul(self.voxel_type.bytes() as u64)
            .and_then(|n| n.checked_add(skipped))
            .ok_or_else(|| Error::field(path, "size", format!("{} voxels overflow", self.count)))?;
        let most = match self.packing {
            Packing::Raw => self.available,
            Packing::Deflated => self.available.saturating_mul(DEFLATE_MOST).saturating_add(DEFLATE_MOST),
        };
        if needed > most {
            return Err(Error::truncated(path, "voxels", needed, most));
        }
        Ok(needed)
    }
}

/// Reads the declared voxels from `reader`, which stands at the first of them. [`Declared::check`] is called first.
pub(crate) fn read_voxels(
    reader: &mut dyn Read,
    path: &Path,
    declared: Declared,
    exec: &Exec,
) -> Result<Voxels, Error> {
    declared.check(path, 0, exec)?;
    match declared.voxel_type {
        VoxelType::U8 => typed::<u8>(reader, path, declared, exec),
        VoxelType::I8 => typed::<i8>(reader, path, declared, exec),
        VoxelType::U16 => typed::<u16>(reader, path, declared, exec),
        VoxelType::I16 => typed::<i16>(reader, path, declared, exec),
        VoxelType::U32 => typed::<u32>(reader, path, declared, exec),
        VoxelType::I32 => typed::<i32>(reader, path, declared, exec),
        VoxelType::F32 => typed::<f32>(reader, path, declared, exec),
        VoxelType::F64 => typed::<f64>(reader, path, declared, exec),
    }
}

fn typed<T: Scalar>(
    reader: &mut dyn Read,
    path: &Path,
    declared: Declared,
    exec: &Exec,
) -> Result<Voxels, Error> {
    let mut values = exec.bulk::<T>("the volume", declared.count)?;
    fill(reader, path, bytemuck::cast_slice_mut(&mut values), exec)?;
    if declared.order.is_foreign() {
        swap_in_place(bytemuck::cast_slice_mut(&mut values), size_of::<T>());
    }
    Ok(T::wrap(values.into_buffer()))
}

/// `count` zeros, without an abort where memory is short. Pages are taken as they are first written.
pub(crate) fn zeroed<T: bytemuck::Zeroable>(count: usize) -> Result<Vec<T>, Error> {
    bytemuck::allocation::try_zeroed_vec(count).map_err(|()| {
        let needed = (count as u64).saturating_mul(size_of::<T>() as u64);
        ivd_core::Error::MemoryLimit { what: "the volume".into(), needed, limit: 0 }.into()
    })
}

/// Fills `bytes`; too few are [`Error::Truncated`] with the number that were there.
pub(crate) fn fill(reader: &mut dyn Read, path: &Path, bytes: &mut [u8], exec: &Exec) -> Result<(), Error> {
    let needed = bytes.len();
    exec.observer().begin("read", needed as u64);
    let mut done = 0;
    while done < needed {
        exec.check_cancelled()?;
        let end = needed.min(done + CHUNK);
        let got = read_up_to(reader, path, &mut bytes[done..end])?;
        exec.observer().advance("read", got as u64);
        if done + got < end {
            return Err(Error::truncated(path, "voxels", needed as u64, (done + got) as u64));
        }
        done = end;
    }
    exec.observer().end("read");
    Ok(())
}

/// Reads until `bytes` is full or the data ends; gives the number read.
pub(crate) fn read_up_to(reader: &mut dyn Read, path: &Path, bytes: &mut [u8]) -> Result<usize, Error> {
    let mut done = 0;
    while done < bytes.len() {
        match reader.read(&mut bytes[done..]) {
            Ok(0) => break,
            Ok(n) => done += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            // flate2 reports a stream that ends too early this way.
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => break,
            Err(e) if matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData) => {
                return Err(Error::corrupt(path, "compressed data", e));
            }
            Err(e) => return Err(Error::io(path, "read", e)),
        }
    }
    Ok(done)
}

/// Passes over `count` bytes of a stream that can't seek.
pub(crate) fn discard(reader: &mut dyn Read, path: &Path, count: u64) -> Result<(), Error> {
    let mut buffer = [0_u8; 16 << 10];
    let mut left = count;
    while left > 0 {
        let part = left.min(buffer.len() as u64) as usize;
        let got = read_up_to(reader, path, &mut buffer[..part])?;
        if got < part {
            return Err(Error::truncated(path, "bytes before the voxels", count, count - left + got as u64));
        }
        left -= part as u64;
    }
    Ok(())
}

/// Most surplus that is unpacked in search of a stream's end.
const SURPLUS: usize = 256 << 20;

/// Drives a decompressor to the end of its stream, so that it verifies its checksum. More data than declared is passed
/// over, as every reader passes over it; where that is very much, unverified.
pub(crate) fn verify_end(reader: &mut dyn Read, path: &Path, exec: &Exec) -> Result<(), Error> {
    let mut buffer = [0_u8; 16 << 10];
    let mut surplus = 0;
    loop {
        exec.check_cancelled()?;
        match reader.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(n) => {
                surplus += n;
                if surplus > SURPLUS {
                    return Ok(());
                }
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(Error::corrupt(path, "end of the compressed data", e)),
        }
    }
}

/// What to do with a file of so many values a voxel, where one is wanted.
pub(crate) fn vectors_remedy(values: usize) -> &'static str {
    if values == 3 {
        "a displacement field is taken by `ivd import --displacement`; of other vectors extract one component into a file of its own"
    } else {
        "extract one component into a file of its own"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::Classified;

    fn declared(count: usize, available: u64, packing: Packing) -> Declared {
        Declared { voxel_type: VoxelType::U16, count, order: ByteOrder::Big, packing, available }
    }

    #[test]
    fn voxels_are_read_in_their_order() {
        let voxels = read_voxels(
            &mut &[1_u8, 2, 3, 4][..],
            Path::new("x"),
            declared(2, 4, Packing::Raw),
            &Exec::default(),
        )
        .unwrap();
        assert_eq!(voxels, Voxels::from(vec![0x0102_u16, 0x0304]));
    }

    #[test]
    fn sizes_beyond_the_file_are_refused_before_memory_is_taken() {
        let exec = Exec::default();
        let huge = isize::MAX as usize / 64;
        let raw = declared(huge, 1 << 20, Packing::Raw).check(Path::new("x"), 0, &exec);
        assert!(matches!(raw, Err(Error::Truncated { .. })));
        let packed = declared(huge, 1 << 20, Packing::Deflated).check(Path::new("x"), 0, &exec);
        assert!(matches!(packed, Err(Error::Truncated { .. })));
        assert!(declared(1000, 2, Packing::Deflated).check(Path::new("x"), 0, &exec).is_ok());
    }

    #[test]
    fn the_memory_limit_holds_for_what_is_declared() {
        let exec = Exec::default().with_memory_limit(Some(100));
        let error = declared(51, 200, Packing::Raw).check(Path::new("x"), 0, &exec).unwrap_err();
        assert_eq!(error.error_class(), ivd_core::ErrorClass::Limit);
        assert!(declared(50, 200, Packing::Raw).check(Path::new("x"), 100, &exec).is_ok());
    }

    #[test]
    fn what_a_file_really_holds_may_be_put_aside_and_a_bomb_may_not() {
        struct Nowhere;
        impl ivd_core::Spill for Nowhere {
            fn space(&self, _: usize) -> io::Result<Box<dyn ivd_core::SpillSpace>> {
                Err(io::Error::other("nowhere"))
            }
        }
        let exec = Exec::default().with_memory_limit(Some(100)).with_spill(std::sync::Arc::new(Nowhere));
        let check =
            |count, available, packing| declared(count, available, packing).check(Path::new("x"), 0, &exec);
        assert!(check(5000, 10_000, Packing::Raw).is_ok());
        assert!(check(5000, 1000, Packing::Deflated).is_ok());
        let bomb = check(5000, 20, Packing::Deflated).unwrap_err();
        assert_eq!(bomb.error_class(), ivd_core::ErrorClass::Limit);
    }

    #[test]
    fn too_few_bytes_are_counted() {
        let mut bytes = [0; 8];
        let error = fill(&mut &[1_u8, 2, 3][..], Path::new("x"), &mut bytes, &Exec::default()).unwrap_err();
        assert!(matches!(error, Error::Truncated { needed: 8, found: 3, .. }));
    }
}
