use ivd_core::{Exec, Scalar, Voxels, parallel, with_voxels};

use super::element;
use super::geometry::Layer;
use super::header::{Bits, Slice};
use super::{codec, syntax::Syntax};
use crate::order::swap_in_place;
use crate::volume::{ByteOrder, Error, bounded};

/// Compressed pixels that claim to unpack to more than this times their size, beyond [`EXPANSION_FREE`], are refused
/// before memory is taken. A slice of nothing but air, which codecs pack best, stays below.
const MOST_EXPANSION: u64 = 1 << 16;
const EXPANSION_FREE: u64 = 16 << 20;

/// The stored values of all slices.
pub(super) fn stored(slices: &[Slice], exec: &Exec) -> Result<Voxels, Error> {
    let Bits { allocated, signed, .. } = slices[0].bits;
    for slice in slices {
        if (slice.bits.allocated, slice.bits.signed) != (allocated, signed) {
            let problem = "differs from the first slice's";
            return Err(Error::field(&slice.path, "BitsAllocated, PixelRepresentation", problem));
        }
    }
    match (allocated, signed) {
        (8, false) => typed::<u8>(slices, exec),
        (8, true) => typed::<i8>(slices, exec),
        (16, false) => typed::<u16>(slices, exec),
        (16, true) => typed::<i16>(slices, exec),
        (_, false) => typed::<u32>(slices, exec),
        (_, true) => typed::<i32>(slices, exec),
    }
}

/// The real values of all slices, each with its own slope and intercept.
pub(super) fn real(slices: &[Slice], exec: &Exec) -> Result<Voxels, Error> {
    let pixels = check(slices, 4, exec)?;
    let mut values: Vec<f32> = bounded::zeroed(pixels * slices.len())?;
    each(slices, &mut values, pixels, exec, |slice, out| {
        let own = stored(std::slice::from_ref(slice), &Exec::default())?;
        for (i, to) in out.iter_mut().enumerate() {
            *to = (slice.slope * own.get(i) + slice.intercept) as f32;
        }
        Ok(())
    })?;
    Ok(values.into())
}

fn typed<T: Scalar>(slices: &[Slice], exec: &Exec) -> Result<Voxels, Error> {
    let pixels = check(slices, size_of::<T>(), exec)?;
    let mut values: Vec<T> = bounded::zeroed(pixels * slices.len())?;
    each(slices, &mut values, pixels, exec, |slice, out| {
        let bytes = bytemuck::cast_slice_mut(out);
        fill(slice, bytes)?;
        extract(slice.bits, bytes);
        Ok(())
    })?;
    Ok(T::wrap(values.into()))
}

/// Layers that lie between slices, by linear interpolation of what is stored there: bit for bit where a layer lies on a slice.
pub(super) fn between(
    slices: &Voxels,
    layers: &[Layer],
    pixels: usize,
    exec: &Exec,
) -> Result<Voxels, Error> {
    fn typed<T: Scalar>(from: &[T], layers: &[Layer], pixels: usize) -> Result<Voxels, Error> {
        let mut values: Vec<T> = bounded::zeroed(pixels * layers.len())?;
        parallel::map_pieces_mut(&mut values, pixels, &|z, out: &mut [T]| {
            let Layer { slice, part } = layers[z];
            let below = &from[slice * pixels..][..pixels];
            if part == 0.0 {
                out.copy_from_slice(below);
                return;
            }
            let above = &from[(slice + 1) * pixels..][..pixels];
            for ((to, a), b) in out.iter_mut().zip(below).zip(above) {
                *to = T::from_f64(a.to_f64() * (1.0 - part) + b.to_f64() * part);
            }
        });
        Ok(T::wrap(values.into()))
    }
    exec.check_cancelled()?;
    let width = slices.voxel_type().bytes();
    exec.check_memory("the resampled volume", ((slices.len() + pixels * layers.len()) * width) as u64)?;
    with_voxels!(slices, from => typed(from, layers, pixels))
}

/// Runs `work` for every slice in parallel; the first failing slice in order speaks.
fn each<T: Send>(
    slices: &[Slice],
    values: &mut [T],
    pixels: usize,
    exec: &Exec,
    work: impl Fn(&Slice, &mut [T]) -> Result<(), Error> + Sync,
) -> Result<(), Error> {
    exec.observer().begin("read", slices.len() as u64);
    let results = parallel::map_pieces_mut(values, pixels, &|i, out| {
        exec.check_cancelled()?;
        work(&slices[i], out)?;
        exec.observer().advance("read", 1);
        Ok(())
    });
    exec.observer().end("read");
    results.into_iter().collect()
}

/// Checks what the headers declare against what the files hold and the memory limit; gives the pixels of a slice.
fn check(slices: &[Slice], width: usize, exec: &Exec) -> Result<usize, Error> {
    let first = &slices[0];
    let count =
        bounded::voxel_count(&first.path, "Rows, Columns", [first.columns, first.rows, slices.len()])?;
    for slice in slices {
        let needed = slice.rows as u64 * slice.columns as u64 * u64::from(slice.bits.allocated / 8);
        let (declared, most) = match slice.pixel_data.length {
            Some(length) if !slice.syntax.is_encapsulated() => (u64::from(length), slice.available),
            None if slice.syntax.is_encapsulated() => {
                let most = slice.available.saturating_mul(MOST_EXPANSION).saturating_add(EXPANSION_FREE);
                (needed, most)
            }
            _ => {
                let problem = "its length doesn't go with the transfer syntax";
                return Err(Error::field(&slice.path, "PixelData", problem));
            }
        };
        if needed > declared {
            return Err(Error::truncated(&slice.path, "PixelData", needed, declared));
        }
        if needed > most {
            return Err(Error::truncated(&slice.path, "PixelData", needed, most));
        }
    }
    exec.check_memory("the volume", count as u64 * width as u64)?;
    Ok(count / slices.len())
}

/// Fills the words of one slice, in native byte order.
fn fill(slice: &Slice, out: &mut [u8]) -> Result<(), Error> {
    let path = &slice.path;
    if slice.syntax.is_encapsulated() {
        let packed = element::fragments(path, slice.pixel_data.offset)?;
        if slice.syntax != Syntax::EncapsulatedLittle {
            return codec::decode(slice, &packed, out);
        }
        let needed = out.len();
        let raw = packed
            .get(..needed)
            .ok_or_else(|| Error::truncated(path, "PixelData", needed as u64, packed.len() as u64))?;
        out.copy_from_slice(raw);
    } else {
        let (mut file, _) = bounded::open(path)?;
        bounded::seek(&mut file, path, slice.pixel_data.offset)?;
        let got = bounded::read_up_to(&mut file, path, out)?;
        if got < out.len() {
            return Err(Error::truncated(path, "PixelData", out.len() as u64, got as u64));
        }
    }
    let order = slice.syntax.order();
    let width = usize::from(slice.bits.allocated / 8);
    if width == 1 && slice.pixel_data.words && order == ByteOrder::Big {
        // Two pixels a word, the first in its low byte.
        swap_in_place(out, 2);
    } else if order.is_foreign() {
        swap_in_place(out, width);
    }
    Ok(())
}

/// Shifts the stored bits down, clears the rest of the word or extends the sign into it.
fn extract(bits: Bits, bytes: &mut [u8]) {
    if bits.stored == bits.allocated {
        return;
    }
    let up = u32::from(bits.allocated - 1 - bits.high);
    let down = u32::from(bits.allocated - bits.stored);
    match bits.allocated {
        8 if bits.signed => bytes.iter_mut().for_each(|b| *b = (((*b << up) as i8) >> down) as u8),
        8 => bytes.iter_mut().for_each(|b| *b = (*b << up) >> down),
        16 => bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|b| {
            let word = u16::from_ne_bytes(*b) << up;
            *b = if bits.signed {
                ((word as i16) >> down).to_ne_bytes()
            } else {
                (word >> down).to_ne_bytes()
            };
        }),
        _ => bytes.as_chunks_mut::<4>().0.iter_mut().for_each(|b| {
            let word = u32::from_ne_bytes(*b) << up;
            *b = if bits.signed {
                ((word as i32) >> down).to_ne_bytes()
            } else {
                (word >> down).to_ne_bytes()
            };
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_shifted_masked_and_signed() {
        let bits = |stored, high, signed| Bits { allocated: 16, stored, high, signed };
        let one = |bits, word: u16| {
            let mut bytes = word.to_ne_bytes();
            extract(bits, &mut bytes);
            i16::from_ne_bytes(bytes)
        };
        assert_eq!(one(bits(12, 11, false), 0xf123), 0x0123, "overlay bits are cleared");
        assert_eq!(one(bits(12, 11, true), 0x0fff), -1);
        assert_eq!(one(bits(12, 15, true), 0xfff7), -1);
        assert_eq!(one(bits(12, 15, false), 0x1237), 0x0123);
        assert_eq!(one(bits(16, 15, true), 0xffff), -1);
        let mut bytes = [0xff, 0x7f];
        extract(Bits { allocated: 8, stored: 7, high: 6, signed: true }, &mut bytes);
        assert_eq!(bytes, [0xff, 0xff]);
    }
}
