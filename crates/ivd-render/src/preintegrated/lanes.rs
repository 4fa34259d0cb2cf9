//! Steps by the values at their ends, eight rays at a time with AVX2: what [`Field::end`] and [`Field::stretch`] do, with the same operations in the
//! same order, for the same bytes.
//!
//! The argument for the `unsafe` blocks: a place in the table is a value's, clamped to the table's side as [`Preintegrated::index`](super::Preintegrated::index) does, or 0 in a
//! lane without one; a table holds every pair of places.

#[allow(clippy::wildcard_imports, reason = "some ten intrinsics")]
use std::arch::x86_64::*;

use crate::axis::ValueAxis;
use crate::cast::Field;
use crate::frame::LANES;
use crate::packet::vectors::{any, each, floats, gathered, set, spread, transposed, wholes};
use crate::packet::{Cells, Lanes, Looks, Pairs, Source};

use super::AtEnds;

impl<T: Pairs, const SHADED: bool> Looks<T> for AtEnds<'_, SHADED> {
    fn axis(&self) -> &ValueAxis {
        self.0.axis()
    }

    /// Places in the table; −1 where there is no data.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn end(lanes: &Lanes<'_, T, Self>, at: [__m256; 3]) -> __m256i {
        let source = lanes.cells.source(at, _mm256_set1_epi32(-1));
        let sample = lanes.sample(source.at);
        let known = _mm256_and_si256(source.known, Cells::<T>::finite(sample.value));
        _mm256_blendv_epi8(_mm256_set1_epi32(-1), sample.index, known)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn look(
        lanes: &Lanes<'_, T, Self>,
        [front, back]: [__m256i; 2],
        at: [__m256; 3],
        look: __m256i,
    ) -> [__m256; 4] {
        let higher = _mm256_max_epi32(front, back);
        if !any(_mm256_and_si256(_mm256_cmpgt_epi32(higher, lanes.clear), look)) {
            return [_mm256_setzero_ps(); 4];
        }
        let known = _mm256_andnot_si256(_mm256_or_si256(front, back), look);
        let table = lanes.looks.0;
        let zero = _mm256_setzero_si256();
        let (fronts, backs) = (wholes(_mm256_max_epi32(front, zero)), wholes(_mm256_max_epi32(back, zero)));
        // SAFETY: places in the table.
        let entry = unsafe { gathered(|lane| table.entry(fronts[lane] as u32, backs[lane] as u32)) };
        // The highest bit of a lane tells whether it is known.
        let known = _mm256_srai_epi32::<31>(known);
        let mut entry = each(|c| _mm256_and_ps(entry[c], _mm256_castsi256_ps(known)));
        let seen = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(entry[3], _mm256_setzero_ps()));
        let half_known = _mm256_andnot_si256(known, _mm256_andnot_si256(higher, look));
        let mut alone = half_known;
        if SHADED && any(seen) {
            let Source { at: before, known: from, moved } = lanes.cells.source(at, seen);
            let site = lanes.cells.site(before);
            let lit = _mm256_and_si256(_mm256_and_si256(seen, from), lanes.cells.deep(&site));
            if any(lit) {
                entry = lanes.cells.lit(entry, &site, moved.as_ref(), lit);
            }
            alone = _mm256_or_si256(half_known, _mm256_andnot_si256(lit, seen));
        }
        if any(alone) {
            entry = one_by_one::<T, SHADED>(lanes, [front, back], at, alone, entry);
        }
        entry
    }
}

/// What lanes can't do together: light, and steps of which an end has no data.
#[inline(never)]
#[target_feature(enable = "avx2")]
fn one_by_one<T: Pairs, const SHADED: bool>(
    lanes: &Lanes<'_, T, AtEnds<'_, SHADED>>,
    ends: [__m256i; 2],
    at: [__m256; 3],
    look: __m256i,
    entry: [__m256; 4],
) -> [__m256; 4] {
    let field: &Field<'_, T> = lanes.cells.field;
    let bricks = wholes(lanes.cells.brick(lanes.cells.cell(at)));
    let (ends, mut entries) = (ends.map(|end| wholes(end)), transposed(entry));
    let at: [[f32; LANES]; 3] = each(|a| floats(at[a]));
    for lane in set(look) {
        let ends = ends.map(|end| u32::try_from(end[lane]).ok());
        let moves = field.moves(bricks[lane] as usize);
        entries[lane] = field.stretch::<SHADED>(lanes.looks.0, ends, each(|a| at[a][lane]), moves);
    }
    each(|c| spread(|lane| entries[lane][c]))
}
