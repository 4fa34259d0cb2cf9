use std::io::BufReader;
use std::path::Path;

use ::png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations};
use ivd_core::{Exec, VoxelType, Voxels};

use super::pile::Pile;
use crate::order::swap_in_place;
use crate::volume::bounded::{self, Declared, Packing};
use crate::volume::{ByteOrder, Error};

/// Adds a PNG to the pile: 8 or 16 bit grey, no colour, no alpha.
pub(super) fn read(path: &Path, pile: &mut Pile, exec: &Exec) -> Result<(), Error> {
    let (file, length) = bounded::open(path)?;
    let limit = exec.memory_limit.map_or(usize::MAX, |m| usize::try_from(m).unwrap_or(usize::MAX));
    let mut decoder = Decoder::new_with_limits(BufReader::new(file), Limits { bytes: limit });
    // Nothing reads them, and a few bytes of them may unpack to anything.
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_transformations(Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(|e| failure(path, e))?;
    let info = reader.info();
    let voxel_type = match (info.color_type, info.bit_depth) {
        (ColorType::Grayscale, BitDepth::Eight) => VoxelType::U8,
        (ColorType::Grayscale, BitDepth::Sixteen) => VoxelType::U16,
        (color, depth) => {
            return Err(Error::unsupported(
                path,
                format!("PNG of type {color:?} with {} bit", depth as u8),
                "convert the slices to 8 or 16 bit grey without alpha",
            ));
        }
    };
    let size = [info.width as usize, info.height as usize];
    pile.expect(path, size)?;
    let count = bounded::voxel_count(path, "IHDR", [size[0], size[1], pile.depth() + 1])?;
    let declared = Declared {
        voxel_type,
        count: size[0] * size[1],
        order: ByteOrder::Big,
        packing: Packing::Deflated,
        available: length,
    };
    let bytes = declared.check(path, 0, exec)?;
    exec.check_memory("the volume", (count * voxel_type.bytes()) as u64)?;
    // Rows of 8 or 16 bit pixels aren't padded.
    if reader.output_buffer_size() != Some(bytes as usize) {
        return Err(Error::field(path, "IHDR", format!("{size:?} pixels don't make {bytes} bytes")));
    }
    let slice = if voxel_type == VoxelType::U8 {
        let mut pixels = bounded::zeroed::<u8>(declared.count)?;
        reader.next_frame(&mut pixels).map_err(|e| failure(path, e))?;
        Voxels::from(pixels)
    } else {
        let mut pixels = bounded::zeroed::<u16>(declared.count)?;
        let raw = bytemuck::cast_slice_mut(&mut pixels);
        reader.next_frame(raw).map_err(|e| failure(path, e))?;
        if declared.order.is_foreign() {
            swap_in_place(raw, 2);
        }
        Voxels::from(pixels)
    };
    pile.push(path, &slice)
}

fn failure(path: &Path, error: DecodingError) -> Error {
    match error {
        DecodingError::LimitsExceeded => {
            Error::unsupported(path, "a PNG beyond the memory limit", "raise --memory-limit")
        }
        // What the system says has a number; the decoder's own words are about the data.
        DecodingError::IoError(e) if e.raw_os_error().is_some() => Error::io(path, "read", e),
        other => Error::corrupt(path, "PNG data", other),
    }
}
