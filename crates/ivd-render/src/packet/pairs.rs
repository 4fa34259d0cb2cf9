//! Neighbours along x, of eight places at once.

#[allow(clippy::wildcard_imports, reason = "some ten intrinsics")]
use std::arch::x86_64::*;

use crate::frame::LANES;
use crate::samples::Stored;

use super::vectors::{spread, whole};

/// Two neighbours along x at once.
pub(crate) trait Pairs: Stored {
    /// Values at an index and the next one in every lane, as `f32`. Inserts, as a gather takes longer on many processors.
    ///
    /// # Safety
    /// AVX2 must be there, and for every `index` two values from `first + index`.
    unsafe fn pairs(first: *const Self, index: &[u32; LANES]) -> [__m256; 2];

    /// Values at an index and the next three.
    ///
    /// # Safety
    /// As [`Pairs::pairs`], of four values.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn fours(first: *const Self, index: &[u32; LANES]) -> [__m256; 4] {
        // SAFETY: two and two of the four.
        let ([a, b], [c, d]) = unsafe { (Self::pairs(first, index), Self::pairs(first.add(2), index)) };
        [a, b, c, d]
    }
}

/// Pairs of values of 16 bits, in the halves of a lane.
///
/// # Safety
/// As [`Pairs::pairs`].
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn halves<T>(first: *const T, index: &[u32; LANES]) -> __m256i {
    // SAFETY: four bytes from `index` are it and the next value.
    whole(|lane| unsafe { first.add(index[lane] as usize).cast::<i32>().read_unaligned() })
}

impl Pairs for u8 {
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn pairs(first: *const Self, index: &[u32; LANES]) -> [__m256; 2] {
        let pairs: [i16; LANES] = std::array::from_fn(|lane| {
            // SAFETY: two bytes from `index` are it and the next value.
            unsafe { first.add(index[lane] as usize).cast::<i16>().read_unaligned() }
        });
        // SAFETY: eight numbers of 16 bits.
        let pairs = _mm256_cvtepu16_epi32(unsafe { _mm_loadu_si128(pairs.as_ptr().cast()) });
        [
            _mm256_cvtepi32_ps(_mm256_and_si256(pairs, _mm256_set1_epi32(0xff))),
            _mm256_cvtepi32_ps(_mm256_srli_epi32::<8>(pairs)),
        ]
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn fours(first: *const Self, index: &[u32; LANES]) -> [__m256; 4] {
        // SAFETY: four bytes from `index` are it and the next three.
        let fours = whole(|lane| unsafe { first.add(index[lane] as usize).cast::<i32>().read_unaligned() });
        let byte = _mm256_set1_epi32(0xff);
        [
            _mm256_cvtepi32_ps(_mm256_and_si256(fours, byte)),
            _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32::<8>(fours), byte)),
            _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32::<16>(fours), byte)),
            _mm256_cvtepi32_ps(_mm256_srli_epi32::<24>(fours)),
        ]
    }
}

impl Pairs for u16 {
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn pairs(first: *const Self, index: &[u32; LANES]) -> [__m256; 2] {
        // SAFETY: as the caller promises.
        let pairs = unsafe { halves(first, index) };
        [
            _mm256_cvtepi32_ps(_mm256_and_si256(pairs, _mm256_set1_epi32(0xffff))),
            _mm256_cvtepi32_ps(_mm256_srli_epi32::<16>(pairs)),
        ]
    }
}

impl Pairs for i16 {
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn pairs(first: *const Self, index: &[u32; LANES]) -> [__m256; 2] {
        // SAFETY: as the caller promises.
        let pairs = unsafe { halves(first, index) };
        [
            _mm256_cvtepi32_ps(_mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(pairs))),
            _mm256_cvtepi32_ps(_mm256_srai_epi32::<16>(pairs)),
        ]
    }
}

impl Pairs for f32 {
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn pairs(first: *const Self, index: &[u32; LANES]) -> [__m256; 2] {
        // SAFETY: both are values.
        let at = |lane: usize, next: usize| unsafe { *first.add(index[lane] as usize + next) };
        [spread(|lane| at(lane, 0)), spread(|lane| at(lane, 1))]
    }
}
