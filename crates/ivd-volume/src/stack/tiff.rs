use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::tiff::decoder::ifd::Value;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::tags::Tag;
use ::tiff::{ColorType, TiffError};
use ivd_core::{Exec, Voxels};

use super::pile::Pile;
use crate::{Error, bounded};

/// No codec of TIFF expands its input by more than this factor (LZW's longest code, 12 bits for 4 kB, comes first).
const MOST_EXPANSION: u64 = 4096;

/// Adds the pages of a TIFF to the pile; `most` pages are allowed. Gives x and y spacing [mm] where the first page
/// has a resolution with a unit.
pub(super) fn read_pages(
    path: &Path,
    pile: &mut Pile,
    most: Option<usize>,
    exec: &Exec,
) -> Result<Option<[f64; 2]>, Error> {
    let (file, length) = bounded::open(path)?;
    let bound = length.saturating_mul(MOST_EXPANSION).min(exec.memory_limit.unwrap_or(u64::MAX));
    let mut limits = Limits::default();
    limits.decoding_buffer_size = usize::try_from(bound).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    limits.ifd_value_size = usize::try_from(length).unwrap_or(usize::MAX);
    let decoder = Decoder::new(BufReader::new(file)).map_err(|e| failure(path, 0, e))?;
    let mut decoder = decoder.with_limits(limits);
    let spacing = resolution(&mut decoder);
    let mut page = 0;
    loop {
        exec.check_cancelled()?;
        if most.is_some_and(|most| page >= most) {
            let remedy = "keep one page a file, or one file a folder";
            return Err(Error::unsupported(path, "a TIFF of several pages among other files", remedy));
        }
        read_page(path, page, &mut decoder, pile, bound, exec)?;
        page += 1;
        if !decoder.more_images() {
            return Ok(spacing);
        }
        decoder.next_image().map_err(|e| failure(path, page, e))?;
    }
}

fn read_page(
    path: &Path,
    page: usize,
    decoder: &mut Decoder<BufReader<File>>,
    pile: &mut Pile,
    bound: u64,
    exec: &Exec,
) -> Result<(), Error> {
    let bits = match decoder.colortype().map_err(|e| failure(path, page, e))? {
        ColorType::Gray(bits @ (8 | 16 | 32 | 64)) => bits,
        other => {
            return Err(Error::unsupported(
                path,
                format!("page {} of type {other:?}", page + 1),
                "convert the pages to 8, 16 or 32 bit grey",
            ));
        }
    };
    let (width, height) = decoder.dimensions().map_err(|e| failure(path, page, e))?;
    let size = [width as usize, height as usize];
    pile.expect(path, size)?;
    let count = bounded::voxel_count(path, "ImageWidth, ImageLength", [size[0], size[1], pile.depth() + 1])?;
    let bytes = u64::from(bits / 8);
    let needed = (size[0] * size[1]) as u64 * bytes;
    exec.check_memory("the volume", count as u64 * bytes)?;
    if needed > bound {
        return Err(Error::truncated(path, format!("page {}", page + 1), needed, bound));
    }
    let slice = match decoder.read_image().map_err(|e| failure(path, page, e))? {
        DecodingResult::U8(v) => Voxels::from(v),
        DecodingResult::I8(v) => Voxels::from(v),
        DecodingResult::U16(v) => Voxels::from(v),
        DecodingResult::I16(v) => Voxels::from(v),
        DecodingResult::U32(v) => Voxels::from(v),
        DecodingResult::I32(v) => Voxels::from(v),
        DecodingResult::F32(v) => Voxels::from(v),
        DecodingResult::F64(v) => Voxels::from(v),
        _ => {
            let what = format!("page {} with a sample format other than u8…u32, i8…i32, f32, f64", page + 1);
            return Err(Error::unsupported(path, what, "convert the pages to 16 bit or f32 grey"));
        }
    };
    pile.push(path, &slice)
}

/// Pixel size [mm] from the resolution tags; `None` without a unit.
fn resolution(decoder: &mut Decoder<BufReader<File>>) -> Option<[f64; 2]> {
    let unit = decoder.find_tag_unsigned::<u16>(Tag::ResolutionUnit).ok()?.unwrap_or(2);
    let mm = match unit {
        2 => 25.4,
        3 => 10.0,
        _ => return None,
    };
    let mut size = |tag| {
        let Value::Rational(above, below) = decoder.find_tag(tag).ok()?? else { return None };
        let size = mm * f64::from(below) / f64::from(above);
        (size.is_finite() && size > 0.0).then_some(size)
    };
    Some([size(Tag::XResolution)?, size(Tag::YResolution)?])
}

fn failure(path: &Path, page: usize, error: TiffError) -> Error {
    match error {
        TiffError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Error::io(path, "read", e),
        TiffError::UnsupportedError(e) => {
            Error::unsupported(path, format!("page {}: {e}", page + 1), "save the stack without that feature")
        }
        other => Error::corrupt(path, format!("page {}", page + 1), other),
    }
}
