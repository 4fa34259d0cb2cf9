//! Compressed pixels of one slice, as words in native byte order.

use std::path::Path;

use jpeg_decoder::PixelFormat;

use super::header::Slice;
use super::syntax::Syntax;
use crate::volume::Error;

/// Decodes `packed` into `out`, which has `bits.allocated / 8` bytes a pixel.
pub(super) fn decode(slice: &Slice, packed: &[u8], out: &mut [u8]) -> Result<(), Error> {
    let path = &slice.path;
    let result = match slice.syntax {
        Syntax::Rle => return rle(path, slice, packed, out),
        // The decoders are large; a fault in them on damaged data must not end the program.
        Syntax::Jpeg { .. } => std::panic::catch_unwind(|| jpeg(slice, packed)),
        Syntax::Jpeg2000 { .. } => std::panic::catch_unwind(|| jpeg2000(slice, packed)),
        Syntax::ImplicitLittle
        | Syntax::ExplicitLittle
        | Syntax::ExplicitBig
        | Syntax::EncapsulatedLittle => {
            unreachable!("uncompressed syntaxes are copied")
        }
    };
    let words = result.unwrap_or_else(|_| Err(damaged(path, "the decoder gave up")))?;
    match slice.bits.allocated {
        8 => out.iter_mut().zip(words).for_each(|(to, v)| *to = v as u8),
        16 => out
            .as_chunks_mut::<2>()
            .0
            .iter_mut()
            .zip(words)
            .for_each(|(to, v)| *to = (v as u16).to_ne_bytes()),
        _ => out.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(to, v)| *to = v.to_ne_bytes()),
    }
    Ok(())
}

fn damaged(path: &Path, problem: impl Into<String>) -> Error {
    Error::corrupt(path, "PixelData", problem.into())
}

fn check_size(slice: &Slice, width: usize, height: usize, components: usize) -> Result<(), Error> {
    if (width, height) != (slice.columns, slice.rows) || components != 1 {
        let problem = format!(
            "{width}×{height} pixels of {components} components, but the header says {}×{} of 1",
            slice.columns, slice.rows
        );
        return Err(damaged(&slice.path, problem));
    }
    Ok(())
}

fn jpeg(slice: &Slice, packed: &[u8]) -> Result<Vec<i32>, Error> {
    let mut decoder = jpeg_decoder::Decoder::new(packed);
    let failure = |e: jpeg_decoder::Error| damaged(&slice.path, e.to_string());
    decoder.set_max_decoding_buffer_size(slice.rows * slice.columns * 2);
    decoder.read_info().map_err(failure)?;
    let info = decoder.info().ok_or_else(|| damaged(&slice.path, "a JPEG stream without a frame"))?;
    let components = if matches!(info.pixel_format, PixelFormat::L8 | PixelFormat::L16) { 1 } else { 3 };
    check_size(slice, usize::from(info.width), usize::from(info.height), components)?;
    let bytes = decoder.decode().map_err(failure)?;
    let words: Vec<i32> = match info.pixel_format {
        PixelFormat::L16 => {
            bytes.as_chunks::<2>().0.iter().map(|b| i32::from(u16::from_ne_bytes(*b))).collect()
        }
        _ => bytes.into_iter().map(i32::from).collect(),
    };
    enough(slice, words)
}

fn enough(slice: &Slice, words: Vec<i32>) -> Result<Vec<i32>, Error> {
    let needed = slice.rows * slice.columns;
    if words.len() < needed {
        return Err(Error::truncated(&slice.path, "PixelData", needed as u64, words.len() as u64));
    }
    Ok(words)
}

fn jpeg2000(slice: &Slice, packed: &[u8]) -> Result<Vec<i32>, Error> {
    let (width, height, components) =
        codestream_size(packed).ok_or_else(|| damaged(&slice.path, "no JPEG 2000 codestream"))?;
    check_size(slice, width, height, components)?;
    let image = jpeg2k::Image::from_bytes(packed).map_err(|e| damaged(&slice.path, e.to_string()))?;
    let [component] = image.components() else {
        return Err(damaged(&slice.path, "no single component"));
    };
    check_size(slice, component.width() as usize, component.height() as usize, 1)?;
    enough(slice, component.data().to_vec())
}

/// Width, height and components from a codestream's SIZ marker (ISO 15444-1, A.5.1), before anything is allocated.
fn codestream_size(bytes: &[u8]) -> Option<(usize, usize, usize)> {
    // A codestream alone starts with SOC and SIZ; in a JP2 file they stand inside a box.
    let at = bytes.windows(4).position(|w| w == [0xff, 0x4f, 0xff, 0x51])?;
    let siz = bytes.get(at + 8..at + 8 + 34)?;
    let word = |i: usize| Some(u32::from_be_bytes(siz.get(i..i + 4)?.try_into().ok()?));
    let (width, height) = (word(0)?.checked_sub(word(8)?)?, word(4)?.checked_sub(word(12)?)?);
    Some((width as usize, height as usize, usize::from(u16::from_be_bytes(siz[32..34].try_into().ok()?))))
}

/// RLE Lossless (PS3.5, annex G): a header of 16 words, then a PackBits segment for each byte of a pixel, the most
/// significant first.
fn rle(path: &Path, slice: &Slice, packed: &[u8], out: &mut [u8]) -> Result<(), Error> {
    let width = usize::from(slice.bits.allocated / 8);
    let word = |i: usize| -> Result<usize, Error> {
        let bytes =
            packed.get(4 * i..4 * i + 4).ok_or_else(|| damaged(path, "the RLE header is cut short"))?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize)
    };
    let segments = word(0)?;
    if segments != width {
        return Err(damaged(path, format!("{segments} RLE segments for {width} bytes a pixel")));
    }
    for segment in 0..segments {
        let start = word(1 + segment)?;
        let end = if segment + 1 < segments { word(2 + segment)? } else { packed.len() };
        let bytes = packed
            .get(start..end)
            .ok_or_else(|| damaged(path, format!("RLE segment {segment} leaves the data")))?;
        let significance = segments - 1 - segment;
        let place = if cfg!(target_endian = "big") { segment } else { significance };
        if !unpack_bits(bytes, &mut out[place..], width) {
            return Err(damaged(path, format!("RLE segment {segment} is cut short")));
        }
    }
    Ok(())
}

/// Fills every `stride`-th byte; false where the packed bytes end before.
fn unpack_bits(mut packed: &[u8], out: &mut [u8], stride: usize) -> bool {
    let mut places = out.iter_mut().step_by(stride);
    let mut left = places.len();
    while left > 0 {
        let Some((&control, rest)) = packed.split_first() else { return false };
        packed = rest;
        match control {
            0..=127 => {
                let count = usize::from(control) + 1;
                let Some((literal, rest)) = packed.split_at_checked(count) else { return false };
                packed = rest;
                places.by_ref().take(count).zip(literal).for_each(|(to, &v)| *to = v);
                left = left.saturating_sub(count);
            }
            128 => {}
            129.. => {
                let count = 257 - usize::from(control);
                let Some((&value, rest)) = packed.split_first() else { return false };
                packed = rest;
                places.by_ref().take(count).for_each(|to| *to = value);
                left = left.saturating_sub(count);
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_bits_unpack_to_their_places() {
        let mut out = [0; 10];
        assert!(unpack_bits(&[2, 1, 2, 3, 128, 255, 9], &mut out, 2));
        assert_eq!(out, [1, 0, 2, 0, 3, 0, 9, 0, 9, 0]);
        assert!(!unpack_bits(&[2, 1, 2], &mut out, 2));
        assert!(!unpack_bits(&[200], &mut out, 2));
    }
}
