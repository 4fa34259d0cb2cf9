use std::io::Read;
use std::path::Path;

use flate2::bufread::ZlibDecoder;
use ivd_core::{Exec, Scalar, VoxelType, Voxels, parallel};

use super::header::Header;
use crate::order::swap_in_place;
use crate::volume::bounded::{self, Declared, Packing};
use crate::volume::{ByteOrder, Error};
use crate::vtk::{Base64, Coding, Content};

/// The voxels of the chosen array.
pub(super) fn read(path: &Path, header: &Header, exec: &Exec) -> Result<Voxels, Error> {
    let count = bounded::voxel_count(path, "Piece Extent", header.dims)?;
    match header.content {
        Content::Ascii(text) => ascii(path, header.voxel_type, count, text, exec),
        Content::Base64(text) => binary(path, header, count, &mut Base64::new(text), text.len(), exec),
        Content::Raw(bytes) => binary(path, header, count, &mut &bytes[..], bytes.len(), exec),
    }
}

fn ascii(
    path: &Path,
    voxel_type: VoxelType,
    count: usize,
    text: &[u8],
    exec: &Exec,
) -> Result<Voxels, Error> {
    // A number takes a digit, and a space before the next.
    let most = text.len().div_ceil(2);
    if count > most {
        return Err(Error::truncated(
            path,
            "DataArray",
            (2 * count as u64).saturating_sub(1),
            text.len() as u64,
        ));
    }
    exec.check_memory("the volume", (count * voxel_type.bytes()) as u64)?;
    let text = std::str::from_utf8(text).map_err(|e| Error::corrupt(path, "DataArray", e))?;
    match voxel_type {
        VoxelType::U8 => numbers::<u8>(path, count, text),
        VoxelType::I8 => numbers::<i8>(path, count, text),
        VoxelType::U16 => numbers::<u16>(path, count, text),
        VoxelType::I16 => numbers::<i16>(path, count, text),
        VoxelType::U32 => numbers::<u32>(path, count, text),
        VoxelType::I32 => numbers::<i32>(path, count, text),
        VoxelType::F32 => numbers::<f32>(path, count, text),
        VoxelType::F64 => numbers::<f64>(path, count, text),
    }
}

fn numbers<T: Scalar + std::str::FromStr>(path: &Path, count: usize, text: &str) -> Result<Voxels, Error> {
    let mut values = Vec::with_capacity(count);
    for word in text.split_ascii_whitespace() {
        let value: T = word.parse().map_err(|_| {
            Error::field(path, "DataArray", format!("`{}` is no {}", word.escape_debug(), T::TYPE.name()))
        })?;
        if values.len() == count {
            return Err(Error::field(path, "DataArray", format!("more than the extent's {count} numbers")));
        }
        values.push(value);
    }
    if values.len() < count {
        return Err(Error::field(path, "DataArray", format!("{} numbers for {count} points", values.len())));
    }
    Ok(T::wrap(values.into()))
}

/// `length`: bytes of the encoded array and what follows it.
fn binary(
    path: &Path,
    header: &Header,
    count: usize,
    reader: &mut dyn Read,
    length: usize,
    exec: &Exec,
) -> Result<Voxels, Error> {
    let declared = Declared {
        voxel_type: header.voxel_type,
        count,
        order: header.coding.order,
        packing: if header.coding.zlib { Packing::Deflated } else { Packing::Raw },
        available: length as u64,
    };
    let needed = declared.check(path, 0, exec)?;
    if header.coding.zlib {
        let blocks = Blocks::read(path, header.coding, reader, length, needed)?;
        return match header.voxel_type {
            VoxelType::U8 => blocks.inflate::<u8>(path, declared, exec),
            VoxelType::I8 => blocks.inflate::<i8>(path, declared, exec),
            VoxelType::U16 => blocks.inflate::<u16>(path, declared, exec),
            VoxelType::I16 => blocks.inflate::<i16>(path, declared, exec),
            VoxelType::U32 => blocks.inflate::<u32>(path, declared, exec),
            VoxelType::I32 => blocks.inflate::<i32>(path, declared, exec),
            VoxelType::F32 => blocks.inflate::<f32>(path, declared, exec),
            VoxelType::F64 => blocks.inflate::<f64>(path, declared, exec),
        };
    }
    let bytes = word(path, header.coding, reader)?;
    if bytes != needed {
        let problem = format!("{bytes} bytes, but the extent needs {needed}");
        return Err(Error::field(path, "DataArray length", problem));
    }
    bounded::read_voxels(reader, path, declared, exec)
}

/// A word of a block header.
fn word(path: &Path, coding: Coding, reader: &mut dyn Read) -> Result<u64, Error> {
    let width = coding.word.bytes();
    let mut bytes = [0; 8];
    let got = bounded::read_up_to(reader, path, &mut bytes[..width])?;
    if got < width {
        return Err(Error::truncated(path, "block header", width as u64, got as u64));
    }
    Ok(match (coding.order, width) {
        (ByteOrder::Little, _) => u64::from_le_bytes(bytes),
        (ByteOrder::Big, 4) => u64::from_be_bytes(bytes) >> 32,
        (ByteOrder::Big, _) => u64::from_be_bytes(bytes),
    })
}

/// Zlib streams, each of which unpacks to `size` bytes, the last one to what is left.
struct Blocks {
    size: usize,
    /// End of each stream in `packed`.
    ends: Vec<usize>,
    packed: Vec<u8>,
}

impl Blocks {
    /// The header is the number of blocks, a block's size, the last one's size (0 for a whole one), and the packed
    /// size of each.
    fn read(
        path: &Path,
        coding: Coding,
        reader: &mut dyn Read,
        length: usize,
        needed: u64,
    ) -> Result<Self, Error> {
        let blocks = word(path, coding, reader)?;
        let (size, last) = (word(path, coding, reader)?, word(path, coding, reader)?);
        // Each block has a word in the header.
        if blocks > length as u64 / coding.word.bytes() as u64 {
            return Err(Error::truncated(path, "block header", blocks.saturating_mul(4), length as u64));
        }
        let missing = if last == 0 { Some(0) } else { size.checked_sub(last) };
        let total = blocks.checked_mul(size).zip(missing).and_then(|(all, missing)| all.checked_sub(missing));
        if total != Some(needed) {
            let problem =
                format!("{blocks} blocks of {size} bytes, the last of {last}, aren't {needed} bytes");
            return Err(Error::field(path, "block header", problem));
        }
        let mut ends = Vec::new();
        let mut end = 0_usize;
        for _ in 0..blocks {
            let packed = word(path, coding, reader)?;
            end = usize::try_from(packed)
                .ok()
                .and_then(|n| end.checked_add(n))
                .filter(|&end| end <= length)
                .ok_or_else(|| Error::truncated(path, "compressed blocks", packed, length as u64))?;
            ends.push(end);
        }
        let mut packed = bounded::zeroed::<u8>(end)?;
        let got = bounded::read_up_to(reader, path, &mut packed)?;
        if got < end {
            return Err(Error::truncated(path, "compressed blocks", end as u64, got as u64));
        }
        Ok(Self { size: size as usize, ends, packed })
    }

    fn inflate<T: Scalar>(&self, path: &Path, declared: Declared, exec: &Exec) -> Result<Voxels, Error> {
        let mut values: Vec<T> = bounded::zeroed(declared.count)?;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        exec.observer().begin("inflate", self.ends.len() as u64);
        // The first failing block speaks, whichever thread met it first.
        let results = parallel::map_pieces_mut(bytes, self.size, &|i, block| {
            exec.check_cancelled()?;
            let start = if i == 0 { 0 } else { self.ends[i - 1] };
            exec.observer().advance("inflate", 1);
            inflate_block(path, i, &self.packed[start..self.ends[i]], block)
        });
        exec.observer().end("inflate");
        results.into_iter().collect::<Result<(), Error>>()?;
        if declared.order.is_foreign() {
            swap_in_place(bytes, size_of::<T>());
        }
        Ok(T::wrap(values.into()))
    }
}

fn inflate_block(path: &Path, index: usize, packed: &[u8], block: &mut [u8]) -> Result<(), Error> {
    let mut decoder = ZlibDecoder::new(packed);
    let damaged = |problem: String| Error::corrupt(path, format!("compressed block {index}"), problem);
    decoder.read_exact(block).map_err(|e| damaged(e.to_string()))?;
    // The end verifies the checksum, and shows bytes that the header doesn't speak of.
    match decoder.read(&mut [0]) {
        Ok(0) => Ok(()),
        Ok(_) => Err(damaged(format!("more than the declared {} bytes", block.len()))),
        Err(e) => Err(damaged(e.to_string())),
    }
}
