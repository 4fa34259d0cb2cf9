//! Maxima of eight rays at a time: [`crate::cast::mip`] in lanes. A maximum doesn't depend on the order of its values, so that both give the same bytes
//! whatever each of them passes over.
//!
//! The argument for the `unsafe` block: a cell's brick lies in the grid of bricks, of which each has a bound (asserted).

#[allow(clippy::wildcard_imports, reason = "some twenty intrinsics")]
use std::arch::x86_64::*;

use crate::cast::{Cast, Field};
use crate::frame::{LANES, Packet};
use crate::project::{BLOCK_BRICKS, Bounds};

use super::cells::SIDE;
use super::vectors::{any, each, floats, indices, spread};
use super::{Cells, Pairs, Progress, RUN, Rays};

/// What a block's side is two to the power of (cells).
const BLOCK: i32 = SIDE + BLOCK_BRICKS.ilog2() as i32;

/// The greatest `sign · value` along every ray; −∞ where there is none.
#[target_feature(enable = "avx2")]
pub(crate) fn mip<T: Pairs>(
    field: &Field<'_, T>,
    bounds: &Bounds,
    sign: f32,
    skip: bool,
    rays: &Packet,
) -> [(f32, Cast); LANES] {
    let (cells, rays) = (Cells::new(field), Rays::new(rays));
    bounds.check(field.space.bricks());
    let mut seen = Seen { greatest: _mm256_set1_ps(f32::NEG_INFINITY), sign: _mm256_set1_ps(sign) };
    let mut progress = Progress::new();
    loop {
        let open = progress.open(&rays);
        if !any(open) {
            break;
        }
        if skip {
            let cell = cells.cell(rays.at(progress.i));
            let [block, pass] = cells.surpassed(bounds, cell, seen.greatest);
            let pass = _mm256_and_si256(pass, open);
            // Those that were passed over may have come to what is worth a look; the others wait for them only while they do.
            if any(pass) {
                let next = cells.behind(&rays, progress.i, cell, block);
                if progress.pass(&rays, pass, next, open).is_none() {
                    continue;
                }
            }
        }
        for _ in 0..RUN {
            let open = progress.open(&rays);
            seen.look(&cells, rays.at(progress.i), open);
            progress.take(open);
            progress.i = _mm256_sub_epi32(progress.i, open);
        }
    }
    let rest = rays.with_rest();
    if any(rest) {
        seen.look(&cells, rays.rest_at, rest);
        progress.take(rest);
    }
    let greatest = floats(seen.greatest);
    let casts = progress.cast([_mm256_setzero_ps(); 4]);
    std::array::from_fn(|lane| (greatest[lane], casts[lane]))
}

/// What is known of the values along rays.
struct Seen {
    greatest: __m256,
    sign: __m256,
}

impl Seen {
    /// Takes samples in the lanes that `look`.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn look<T: Pairs>(&mut self, cells: &Cells<'_, T>, at: [__m256; 3], look: __m256i) {
        let source = cells.source(at, look);
        let value = cells.value(&cells.site(source.at));
        let known = _mm256_and_si256(source.known, Cells::<T>::finite(value));
        let value = _mm256_mul_ps(self.sign, value);
        let greater =
            _mm256_and_ps(_mm256_castsi256_ps(known), _mm256_cmp_ps::<_CMP_GT_OQ>(value, self.greatest));
        self.greatest = _mm256_blendv_ps(self.greatest, value, greater);
    }
}

impl<T: Pairs> Cells<'_, T> {
    /// The lanes whose block of bricks, and those whose block or brick, has no value above what is known.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn surpassed(&self, bounds: &Bounds, cell: [__m256i; 3], greatest: __m256) -> [__m256i; 2] {
        let at_most = |bounds: &[f32], place: __m256i| {
            let index = indices(place);
            // SAFETY: a brick of the grid, and its block.
            let bound = spread(|lane| unsafe { *bounds.as_ptr().add(index[lane] as usize) });
            _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(bound, greatest))
        };
        let [x, y, z]: [__m256i; 3] = each(|a| _mm256_srli_epi32::<BLOCK>(cell[a]));
        let [by, bz] =
            [bounds.blocks[0], bounds.blocks[0] * bounds.blocks[1]].map(|n| _mm256_set1_epi32(n as i32));
        let block =
            _mm256_add_epi32(x, _mm256_add_epi32(_mm256_mullo_epi32(by, y), _mm256_mullo_epi32(bz, z)));
        let block = at_most(&bounds.of_blocks, block);
        [block, _mm256_or_si256(block, at_most(&bounds.of_bricks, self.brick(cell)))]
    }

    /// Index of a sample behind `i`, in `cell`, beyond its brick, or its block in the lanes that `block` names.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn behind(&self, rays: &Rays, i: __m256i, cell: [__m256i; 3], block: __m256i) -> __m256i {
        let inner = _mm256_blendv_epi8(
            _mm256_set1_epi32((1 << SIDE) - 1),
            _mm256_set1_epi32((1 << BLOCK) - 1),
            block,
        );
        let low: [__m256i; 3] = each(|a| _mm256_andnot_si256(inner, cell[a]));
        let side = _mm256_add_epi32(inner, _mm256_set1_epi32(1));
        self.leave(rays, i, low, each(|a| _mm256_add_epi32(low[a], side)))
    }
}
