//! Voxels without a header that were most likely read in the wrong byte order.

use std::path::Path;

use ivd_core::{Exec, Scalar, Voxels, with_voxels};

use crate::volume::{ByteOrder, RawLayout};

/// Rows that are looked at, evenly spread.
const ROWS: usize = 64;
/// Fewer pairs of neighbours than these tell nothing.
const FEWEST: usize = 256;
/// The order that was given is suspected where its values are at least so many times as rough as those of the other. Of fifteen real volumes of
/// two bytes and more, read in their own order, none is rougher than in the other; in the wrong order scans are so 2.3 to 9.3 times (labels as floats
/// 1.0 times: those are told by their sizes). Lower, and noise of a small volume would be suspected; higher, and MR of 35 voxels a row wouldn't be.
const SUSPICIOUS: f64 = 2.0;
/// Sizes that measured numbers have; of a floating-point number in the wrong order the exponent is made of the last digits.
const PLAUSIBLE: std::ops::Range<f64> = 1e-20..1e20;

/// Share of such sizes that a volume in its own order may have.
const RARE: f64 = 0.01;

/// Tells a person where the other byte order would give a much smoother volume, or numbers of a likely size.
///
/// - `row`: voxels along x.
pub(in crate::volume) fn note(path: &Path, layout: &RawLayout, row: usize, voxels: &Voxels, exec: &Exec) {
    if with_voxels!(voxels, values => is_suspicious(values, row)) {
        let [given, other] = match layout.order {
            ByteOrder::Little => ["little", "big"],
            ByteOrder::Big => ["big", "little"],
        };
        exec.observer().note(&format!(
            "{}: read as {} in {given} byte order its values jump from voxel to voxel, and in {other} order they run smoothly: it is most likely of \
             that; give --raw-order {other} (in a scene order = \"{other}\" of input.raw)",
            path.display(),
            layout.voxel_type.name(),
        ));
    }
}

fn is_suspicious<T: Scalar>(values: &[T], row: usize) -> bool {
    if size_of::<T>() == 1 || row < 2 {
        return false;
    }
    let swapped = |value: T| {
        let mut value = value;
        bytemuck::bytes_of_mut(&mut value).reverse();
        value.to_f64()
    };
    let rows: Vec<&[T]> = values.chunks_exact(row).collect();
    let looked_at = || rows.iter().step_by(rows.len().div_ceil(ROWS).max(1));
    if looked_at().count() * (row - 1) < FEWEST {
        return false;
    }
    let given = || looked_at().map(|row| row.iter().map(|v| v.to_f64()).collect::<Vec<f64>>());
    let other = || looked_at().map(|row| row.iter().map(|v| swapped(*v)).collect::<Vec<f64>>());
    if !T::TYPE.is_integer() {
        let [given, other] = [odd_share(given()), odd_share(other())];
        if other > RARE {
            return false;
        }
        if given > 0.1 {
            return true;
        }
    }
    match (roughness(given()), roughness(other())) {
        (Some(given), Some(other)) => given >= SUSPICIOUS * other,
        _ => false,
    }
}

/// Mean difference of neighbours over the mean distance from the mean: small of a body, 1.4 of noise. `None` of what is all alike.
fn roughness(rows: impl Iterator<Item = Vec<f64>> + Clone) -> Option<f64> {
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) =
            values.filter(|v| v.is_finite()).fold((0.0, 0_u64), |(sum, n), v| (sum + v, n + 1));
        (count > 0).then(|| sum / count as f64)
    };
    let middle = mean(&mut rows.clone().flatten())?;
    let spread = mean(&mut rows.clone().flatten().map(|v| (v - middle).abs()))?;
    let steps = |row: Vec<f64>| row.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect::<Vec<f64>>();
    let step = mean(&mut rows.flat_map(steps))?;
    (spread > 0.0).then(|| step / spread)
}

/// Share of the numbers that aren't 0 whose size no measured number has.
fn odd_share(rows: impl Iterator<Item = Vec<f64>>) -> f64 {
    let (mut odd, mut all) = (0_u64, 0_u64);
    for value in rows.flatten().filter(|v| *v != 0.0) {
        all += 1;
        odd += u64::from(!PLAUSIBLE.contains(&value.abs()));
    }
    odd as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of 12 bits in the middle of air, with noise of a few steps.
    fn body(row: usize) -> Vec<u16> {
        let edge = |i: usize| (i % row > row / 4 && i % row < 3 * row / 4) as u16;
        (0..64 * row).map(|i| 1000 * edge(i) + (i as u16).wrapping_mul(40_503) % 13 + 250).collect()
    }

    #[test]
    fn the_wrong_order_is_suspected_and_the_right_one_is_not() {
        let right = body(64);
        let wrong: Vec<u16> = right.iter().map(|v| v.swap_bytes()).collect();
        assert!(is_suspicious(&wrong, 64) && !is_suspicious(&right, 64));
        // Whole numbers as floats: in the wrong order their sizes are those of no measurement.
        let floats: Vec<f32> = right.iter().map(|v| f32::from(*v)).collect();
        let wrong: Vec<f32> = floats.iter().map(|v| f32::from_bits(v.to_bits().swap_bytes())).collect();
        assert!(is_suspicious(&wrong, 64) && !is_suspicious(&floats, 64));
    }

    #[test]
    fn what_tells_nothing_is_not_suspected() {
        let noise: Vec<u16> = (0..4096_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u16).collect();
        assert!(!is_suspicious(&noise, 64));
        assert!(!is_suspicious(&[7_u16; 4096], 64), "all alike");
        assert!(!is_suspicious(&[7_u16; 4096], 1), "no neighbours");
        let wrong: Vec<u16> = body(64).iter().map(|v| v.swap_bytes()).collect();
        assert!(!is_suspicious(&wrong[..128], 64), "too few");
        assert!(!is_suspicious(&[1_u8; 4096], 64));
    }
}
