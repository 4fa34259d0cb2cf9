//! The projections in lanes: see [`crate::project`] for what each of them does.

#[allow(clippy::wildcard_imports, reason = "some twenty intrinsics")]
use std::arch::x86_64::*;

use crate::frame::LANES;
use crate::project::{Attenuated, FARTHEST, FirstPeak, Greatest, Mean, ROUNDED, SERIES};

use super::ProjectLanes;
use super::vectors::{any, floats};

impl ProjectLanes for Greatest {
    type Lanes = __m256;

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn nothing_in_lanes(&self) -> __m256 {
        _mm256_set1_ps(f32::NEG_INFINITY)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn take_lanes(&self, seen: &mut __m256, value: __m256, _: __m256, _: __m256i, known: __m256i) {
        *seen = raised(*seen, value, known);
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn settled_lanes(&self, _: &__m256) -> __m256i {
        _mm256_setzero_si256()
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn passing_lanes(&self, seen: &__m256, bound: __m256) -> __m256i {
        _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(bound, *seen))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn shown_lanes(&self, seen: &__m256) -> [f32; LANES] {
        floats(*seen)
    }
}

/// Sums of values, and the steps that they stand for.
pub(crate) struct Sums {
    values: __m256,
    steps: __m256,
}

impl ProjectLanes for Mean {
    type Lanes = Sums;

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn nothing_in_lanes(&self) -> Sums {
        Sums { values: _mm256_setzero_ps(), steps: _mm256_setzero_ps() }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn take_lanes(
        &self,
        Sums { values, steps: sum }: &mut Sums,
        value: __m256,
        steps: __m256,
        _: __m256i,
        known: __m256i,
    ) {
        let known = _mm256_castsi256_ps(known);
        let more = _mm256_add_ps(*values, _mm256_mul_ps(value, steps));
        *values = _mm256_blendv_ps(*values, more, known);
        *sum = _mm256_add_ps(*sum, _mm256_and_ps(steps, known));
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn settled_lanes(&self, _: &Sums) -> __m256i {
        _mm256_setzero_si256()
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn passing_lanes(&self, _: &Sums, bound: __m256) -> __m256i {
        let nothing = _mm256_set1_ps(f32::NEG_INFINITY);
        _mm256_castps_si256(_mm256_cmp_ps::<_CMP_EQ_OQ>(bound, nothing))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn shown_lanes(&self, Sums { values, steps }: &Sums) -> [f32; LANES] {
        let any = _mm256_cmp_ps::<_CMP_GT_OQ>(*steps, _mm256_setzero_ps());
        floats(_mm256_blendv_ps(_mm256_set1_ps(f32::NEG_INFINITY), _mm256_div_ps(*values, *steps), any))
    }
}

/// How far climbs have come.
pub(crate) struct Climbs {
    greatest: __m256,
    climbing: __m256i,
    settled: __m256i,
}

impl ProjectLanes for FirstPeak {
    type Lanes = Climbs;

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn nothing_in_lanes(&self) -> Climbs {
        let none = _mm256_setzero_si256();
        Climbs { greatest: _mm256_set1_ps(f32::NEG_INFINITY), climbing: none, settled: none }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn take_lanes(
        &self,
        Climbs { greatest, climbing, settled }: &mut Climbs,
        value: __m256,
        _: __m256,
        look: __m256i,
        known: __m256i,
    ) {
        let lower = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(value, *greatest));
        let ends = _mm256_or_si256(_mm256_andnot_si256(known, look), _mm256_and_si256(lower, known));
        let ends = _mm256_and_si256(*climbing, ends);
        *settled = _mm256_or_si256(*settled, ends);
        let known = _mm256_andnot_si256(ends, known);
        *greatest = raised(*greatest, value, known);
        let reaches = _mm256_cmp_ps::<_CMP_GE_OQ>(value, _mm256_set1_ps(self.threshold));
        *climbing = _mm256_or_si256(*climbing, _mm256_and_si256(_mm256_castps_si256(reaches), known));
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn settled_lanes(&self, seen: &Climbs) -> __m256i {
        seen.settled
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn passing_lanes(&self, seen: &Climbs, bound: __m256) -> __m256i {
        let lower = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(bound, seen.greatest));
        _mm256_andnot_si256(seen.climbing, lower)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn shown_lanes(&self, seen: &Climbs) -> [f32; LANES] {
        floats(seen.greatest)
    }
}

/// What is known of dimmed values.
pub(crate) struct Dimmed {
    greatest: __m256,
    before: __m256,
}

impl Attenuated {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn greys(&self, value: __m256) -> __m256 {
        let above = _mm256_sub_ps(value, _mm256_set1_ps(self.low));
        let grey = _mm256_mul_ps(above, _mm256_set1_ps(self.scale));
        let grey = _mm256_add_ps(grey, _mm256_set1_ps(self.bias));
        // Of two operands of which one is no number, `max` gives the second.
        _mm256_min_ps(_mm256_max_ps(grey, _mm256_setzero_ps()), _mm256_set1_ps(1.0))
    }
}

impl ProjectLanes for Attenuated {
    type Lanes = Dimmed;

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn nothing_in_lanes(&self) -> Dimmed {
        Dimmed { greatest: _mm256_set1_ps(f32::NEG_INFINITY), before: _mm256_setzero_ps() }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn take_lanes(
        &self,
        Dimmed { greatest, before }: &mut Dimmed,
        value: __m256,
        steps: __m256,
        _: __m256i,
        known: __m256i,
    ) {
        let grey = self.greys(value);
        let own = _mm256_mul_ps(grey, steps);
        let brighter = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(grey, *greatest));
        let brighter = _mm256_and_si256(brighter, known);
        if any(brighter) {
            let front = _mm256_add_ps(*before, _mm256_mul_ps(_mm256_set1_ps(0.5), own));
            let dimmed = _mm256_mul_ps(grey, decays(_mm256_mul_ps(_mm256_set1_ps(self.of_step), front)));
            *greatest = raised(*greatest, dimmed, brighter);
        }
        *before = _mm256_add_ps(*before, _mm256_and_ps(own, _mm256_castsi256_ps(known)));
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn settled_lanes(&self, _: &Dimmed) -> __m256i {
        _mm256_setzero_si256()
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn passing_lanes(&self, Dimmed { greatest, before }: &Dimmed, bound: __m256) -> __m256i {
        let zero = _mm256_setzero_ps();
        let black = _mm256_cmp_ps::<_CMP_LE_OQ>(self.greys(bound), zero);
        let black = _mm256_and_ps(black, _mm256_cmp_ps::<_CMP_GE_OQ>(*greatest, zero));
        let white = decays(_mm256_mul_ps(_mm256_set1_ps(self.of_step), *before));
        let white = _mm256_mul_ps(white, _mm256_set1_ps(ROUNDED));
        let behind = _mm256_cmp_ps::<_CMP_LT_OQ>(white, *greatest);
        _mm256_castps_si256(_mm256_or_ps(black, behind))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn shown_lanes(&self, seen: &Dimmed) -> [f32; LANES] {
        floats(seen.greatest)
    }
}

/// Greatest values, raised in the lanes that `look`.
#[inline]
#[target_feature(enable = "avx2")]
fn raised(greatest: __m256, value: __m256, look: __m256i) -> __m256 {
    let greater = _mm256_cmp_ps::<_CMP_GT_OQ>(value, greatest);
    _mm256_blendv_ps(greatest, value, _mm256_and_ps(_mm256_castsi256_ps(look), greater))
}

/// [`crate::project::decay`].
#[inline]
#[target_feature(enable = "avx2")]
fn decays(x: __m256) -> __m256 {
    let x = _mm256_min_ps(x, _mm256_set1_ps(FARTHEST));
    let power = _mm256_mul_ps(x, _mm256_set1_ps(-std::f32::consts::LOG2_E));
    let whole = _mm256_cvttps_epi32(_mm256_sub_ps(power, _mm256_set1_ps(0.5)));
    let left = _mm256_sub_ps(power, _mm256_cvtepi32_ps(whole));
    let left = _mm256_mul_ps(left, _mm256_set1_ps(std::f32::consts::LN_2));
    let mut series = _mm256_set1_ps(SERIES[0]);
    for next in &SERIES[1..] {
        series = _mm256_add_ps(_mm256_mul_ps(series, left), _mm256_set1_ps(*next));
    }
    let power = _mm256_slli_epi32::<23>(_mm256_add_epi32(whole, _mm256_set1_epi32(127)));
    _mm256_mul_ps(series, _mm256_castsi256_ps(power))
}
