//! Eight numbers at a time: what several kernels do with AVX2's vectors.

#[allow(clippy::wildcard_imports, reason = "some twenty intrinsics")]
use std::arch::x86_64::*;

use crate::frame::LANES;

/// The over operator.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn over(rgba: &mut [__m256; 4], entry: [__m256; 4]) {
    let through = _mm256_sub_ps(_mm256_set1_ps(1.0), rgba[3]);
    for (sum, c) in rgba.iter_mut().zip(entry) {
        *sum = _mm256_add_ps(*sum, _mm256_mul_ps(through, c));
    }
}

/// The numbers in `0 ..= top` nearest to `x`; 0 for NaN. Of two operands of which one is no number, `max` and `min` give the second.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn clamped(x: __m256, top: __m256) -> __m256 {
    _mm256_min_ps(_mm256_max_ps(x, _mm256_setzero_ps()), top)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn mix(a: __m256, b: __m256, f: __m256) -> __m256 {
    _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), f))
}

/// Whether the highest bit of some lane is set.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn any(mask: __m256i) -> bool {
    _mm256_movemask_ps(_mm256_castsi256_ps(mask)) != 0
}

/// The lanes whose highest bit is set.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn set(mask: __m256i) -> impl Iterator<Item = usize> {
    let bits = _mm256_movemask_ps(_mm256_castsi256_ps(mask));
    (0..LANES).filter(move |lane| bits >> lane & 1 == 1)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn each<V: Copy, const N: usize>(value: impl Fn(usize) -> V) -> [V; N] {
    std::array::from_fn(value)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn spread(value: impl Fn(usize) -> f32) -> __m256 {
    let lanes: [f32; LANES] = std::array::from_fn(value);
    // SAFETY: eight floats.
    unsafe { _mm256_loadu_ps(lanes.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn whole(value: impl Fn(usize) -> i32) -> __m256i {
    let lanes: [i32; LANES] = std::array::from_fn(value);
    // SAFETY: eight numbers of 32 bits.
    unsafe { _mm256_loadu_si256(lanes.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn floats(vector: __m256) -> [f32; LANES] {
    let mut lanes = [0.0; LANES];
    // SAFETY: eight floats.
    unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), vector) };
    lanes
}

#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn wholes(vector: __m256i) -> [i32; LANES] {
    let mut lanes = [0; LANES];
    // SAFETY: eight numbers of 32 bits.
    unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().cast(), vector) };
    lanes
}

/// Indices, which are not negative.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn indices(vector: __m256i) -> [u32; LANES] {
    wholes(vector).map(|i| i as u32)
}

/// Four components in lanes, lane by lane.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) fn transposed(components: [__m256; 4]) -> [[f32; 4]; LANES] {
    let components: [[f32; LANES]; 4] = each(|c| floats(components[c]));
    std::array::from_fn(|lane| std::array::from_fn(|c| components[c][lane]))
}

/// Entries of four floats in lanes, a component a vector.
///
/// # Safety
/// `entry` must give a place of four floats for every lane.
#[inline]
#[target_feature(enable = "avx2")]
pub(crate) unsafe fn gathered(entry: impl Fn(usize) -> *const [f32; 4]) -> [__m256; 4] {
    // SAFETY: as the caller promises.
    let entry = |lane: usize| unsafe { _mm_loadu_ps(entry(lane).cast()) };
    let both = |lane: usize| _mm256_set_m128(entry(lane + 4), entry(lane));
    let [a, b, c, d] = [both(0), both(1), both(2), both(3)];
    let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
    let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
    [
        _mm256_shuffle_ps::<0b01_00_01_00>(ab_low, cd_low),
        _mm256_shuffle_ps::<0b11_10_11_10>(ab_low, cd_low),
        _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
        _mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
    ]
}
