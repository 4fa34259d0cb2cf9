use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::tiff::decoder::ifd::Value;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::tags::Tag;
use ::tiff::{ColorType, TiffError};
use ivd_core::{Exec, Voxels};

use super::directory;
use super::pile::Pile;
use crate::volume::{Error, bounded};

/// No codec of TIFF expands its input by more than this factor (LZW's longest code, 12 bits for 4 kB, comes first).
const MOST_EXPANSION: u64 = 4096;

/// What a picture tells of its spacing (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PixelSize {
    pub(super) xy: [f64; 2],
    /// Distance of the pages.
    pub(super) z: Option<f64>,
}

/// Adds the pages of a TIFF to the pile; `most` pages are allowed. Gives the spacing where the first page has a
/// resolution with a unit.
pub(super) fn read_pages(
    path: &Path,
    pile: &mut Pile,
    most: Option<usize>,
    exec: &Exec,
) -> Result<Option<PixelSize>, Error> {
    let (file, length) = bounded::open(path)?;
    let bound = length.saturating_mul(MOST_EXPANSION).min(exec.memory_limit.unwrap_or(u64::MAX));
    let mut file = BufReader::new(file);
    directory::check_first(path, &mut file, length)?;
    // A value of a tag takes 32 bytes in memory and at least one in the file.
    let of_tags = limits(length.saturating_mul(32).saturating_add(1 << 16), length);
    let of_pixels = limits(bound, length);
    let decoder = Decoder::new(file).map_err(|e| failure(path, 0, e))?;
    let mut decoder = decoder.with_limits(of_tags.clone());
    let spacing = resolution(&mut decoder);
    let mut page = 0;
    loop {
        exec.check_cancelled()?;
        if most.is_some_and(|most| page >= most) {
            let remedy = "keep one page a file, or one file a folder";
            return Err(Error::unsupported(path, "a TIFF of several pages among other files", remedy));
        }
        decoder = decoder.with_limits(of_pixels.clone());
        read_page(path, page, &mut decoder, pile, bound, exec)?;
        decoder = decoder.with_limits(of_tags.clone());
        page += 1;
        if !decoder.more_images() {
            return Ok(spacing);
        }
        decoder.next_image().map_err(|e| failure(path, page, e))?;
    }
}

/// Limits of the decoder: `most` bytes of any buffer, in a file of `length`.
fn limits(most: u64, length: u64) -> Limits {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = usize::try_from(most).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    limits.ifd_value_size = usize::try_from(length).unwrap_or(usize::MAX);
    limits
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
    check_stored(path, page, decoder, needed)?;
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

/// Refuses a page whose strips or tiles are too short for its pixels, where they are stored as they are: the decoder would
/// take what follows them.
fn check_stored(
    path: &Path,
    page: usize,
    decoder: &mut Decoder<BufReader<File>>,
    needed: u64,
) -> Result<(), Error> {
    let plain = decoder.find_tag_unsigned::<u16>(Tag::Compression).map_err(|e| failure(path, page, e))?;
    if plain.is_some_and(|compression| compression != 1) {
        return Ok(());
    }
    for tag in [Tag::StripByteCounts, Tag::TileByteCounts] {
        let counts = decoder.find_tag_unsigned_vec::<u64>(tag).map_err(|e| failure(path, page, e))?;
        let stored = counts.map(|counts| counts.iter().fold(0_u64, |sum, n| sum.saturating_add(*n)));
        if let Some(stored) = stored.filter(|stored| *stored < needed) {
            return Err(Error::truncated(path, format!("page {}", page + 1), needed, stored));
        }
    }
    Ok(())
}

/// Pixel size from the resolution tags and ImageJ's description; `None` without a unit.
fn resolution(decoder: &mut Decoder<BufReader<File>>) -> Option<PixelSize> {
    let description = match decoder.find_tag(Tag::ImageDescription) {
        Ok(Some(Value::Ascii(text))) if text.starts_with("ImageJ=") => text,
        _ => String::new(),
    };
    let said = |key: &str| {
        description.lines().find_map(|line| line.split_once('=').filter(|(k, _)| *k == key)).map(|(_, v)| v)
    };
    // ImageJ's unit is that of the resolution tags, too.
    let mm = match said("unit").and_then(unit_mm) {
        Some(mm) => mm,
        None => match decoder.find_tag_unsigned::<u16>(Tag::ResolutionUnit).ok()?.unwrap_or(2) {
            2 => 25.4,
            3 => 10.0,
            _ => return None,
        },
    };
    let length = |size: f64| (size.is_finite() && size > 0.0).then_some(size);
    let mut size = |tag| {
        let Value::Rational(above, below) = decoder.find_tag(tag).ok()?? else { return None };
        length(mm * f64::from(below) / f64::from(above))
    };
    let xy = [size(Tag::XResolution)?, size(Tag::YResolution)?];
    Some(PixelSize { xy, z: said("spacing").and_then(|z| z.parse().ok()).and_then(|z: f64| length(mm * z)) })
}

/// Millimetres of a unit in the words of ImageJ.
fn unit_mm(unit: &str) -> Option<f64> {
    Some(match unit.trim() {
        "m" => 1e3,
        "cm" => 10.0,
        "mm" => 1.0,
        "micron" | "um" | "\\u00B5m" | "µm" => 1e-3,
        "nm" => 1e-6,
        "inch" | "in" => 25.4,
        _ => return None,
    })
}

fn failure(path: &Path, page: usize, error: TiffError) -> Error {
    match error {
        // What the system says has a number; a codec's own words have none, and are about the data.
        TiffError::IoError(e) if e.raw_os_error().is_some() => Error::io(path, "read", e),
        TiffError::UnsupportedError(e) => {
            Error::unsupported(path, format!("page {}: {e}", page + 1), "save the stack without that feature")
        }
        other => Error::corrupt(path, format!("page {}", page + 1), other),
    }
}
