//! Projections of eight rays at a time: [`crate::project::project`] in lanes. Lanes pass over more than single rays do, never what changes a projection, so
//! that both give the same bytes.
//!
//! The argument for the `unsafe` blocks: a cell's brick lies in the grid of bricks, of which each has a bound (asserted); and these functions have AVX2.

#[allow(clippy::wildcard_imports, reason = "some twenty intrinsics")]
use std::arch::x86_64::*;

use crate::cast::{Cast, Field};
use crate::frame::{LANES, Packet};
use crate::project::{BLOCK_BRICKS, Bounds, Project};

use super::cells::SIDE;
use super::vectors::{any, each, indices, spread};
use super::{Cells, Pairs, Progress, RUN, Rays};

/// What a block's side is two to the power of (cells).
const BLOCK: i32 = SIDE + BLOCK_BRICKS.ilog2() as i32;

/// A projection in lanes: what its [`Project`] does, with the same operations in the same order.
pub(crate) trait ProjectLanes: Project {
    /// What is known of the values so far, of every lane.
    type Lanes;

    /// [`Project::nothing`].
    ///
    /// # Safety
    /// AVX2 must be there, as for all that follow.
    unsafe fn nothing_in_lanes(&self) -> Self::Lanes;

    /// [`Project::take`] in the lanes that `look`, of which those that are `known` have data.
    ///
    /// # Safety
    /// As above.
    unsafe fn take_lanes(
        &self,
        seen: &mut Self::Lanes,
        value: __m256,
        steps: __m256,
        look: __m256i,
        known: __m256i,
    );

    /// The lanes that [`Project::is_settled`].
    ///
    /// # Safety
    /// As above.
    unsafe fn settled_lanes(&self, seen: &Self::Lanes) -> __m256i;

    /// The lanes that [`Project::passes`].
    ///
    /// # Safety
    /// As above.
    unsafe fn passing_lanes(&self, seen: &Self::Lanes, bound: __m256) -> __m256i;

    /// [`Project::shown`].
    ///
    /// # Safety
    /// As above.
    unsafe fn shown_lanes(&self, seen: &Self::Lanes) -> [f32; LANES];
}

/// Projects the values along every ray; −∞ where there is none.
#[target_feature(enable = "avx2")]
pub(crate) fn project<T: Pairs, P: ProjectLanes>(
    field: &Field<'_, T>,
    projection: &P,
    bounds: &Bounds,
    sign: f32,
    skip: bool,
    rays: &Packet,
) -> [(f32, Cast); LANES] {
    let (cells, rays) = (Cells::new(field), Rays::new(rays));
    bounds.check(field.space.bricks());
    // SAFETY: this function has AVX2.
    let seen = unsafe { projection.nothing_in_lanes() };
    let mut seen = Seen { projection, of_rays: seen, sign: _mm256_set1_ps(sign) };
    let mut progress = Progress::new();
    loop {
        let open = _mm256_andnot_si256(seen.settled(), progress.open(&rays));
        if !any(open) {
            break;
        }
        if skip {
            let cell = cells.cell(rays.at(progress.i));
            let [block, pass] = cells.surpassed(bounds, cell, &seen);
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
            let open = _mm256_andnot_si256(seen.settled(), progress.open(&rays));
            seen.look(&cells, rays.at(progress.i), _mm256_set1_ps(1.0), open);
            progress.take(open);
            progress.i = _mm256_sub_epi32(progress.i, open);
        }
    }
    let rest = _mm256_andnot_si256(seen.settled(), rays.with_rest());
    if any(rest) {
        seen.look(&cells, rays.rest_at, rays.rest, rest);
        progress.take(rest);
    }
    // SAFETY: this function has AVX2.
    let shown = unsafe { projection.shown_lanes(&seen.of_rays) };
    let casts = progress.cast([_mm256_setzero_ps(); 4]);
    std::array::from_fn(|lane| (shown[lane], casts[lane]))
}

/// What is known of the values along rays.
struct Seen<'a, P: ProjectLanes> {
    projection: &'a P,
    of_rays: P::Lanes,
    sign: __m256,
}

impl<P: ProjectLanes> Seen<'_, P> {
    /// Takes samples in the lanes that `look`.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn look<T: Pairs>(&mut self, cells: &Cells<'_, T>, at: [__m256; 3], steps: __m256, look: __m256i) {
        let source = cells.source(at, look);
        let value = cells.value(&cells.site(source.at));
        let known = _mm256_and_si256(source.known, Cells::<T>::finite(value));
        let value = _mm256_mul_ps(self.sign, value);
        // SAFETY: this function has AVX2.
        unsafe { self.projection.take_lanes(&mut self.of_rays, value, steps, look, known) };
    }

    /// The lanes of which no later sample changes anything.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn settled(&self) -> __m256i {
        // SAFETY: this function has AVX2.
        unsafe { self.projection.settled_lanes(&self.of_rays) }
    }

    /// The lanes in which samples that don't exceed `bound` change nothing.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn passes(&self, bound: __m256) -> __m256i {
        // SAFETY: this function has AVX2.
        unsafe { self.projection.passing_lanes(&self.of_rays, bound) }
    }
}

impl<T: Pairs> Cells<'_, T> {
    /// The lanes whose block of bricks, and those whose block or brick, has no value that changes what is known.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn surpassed<P: ProjectLanes>(
        &self,
        bounds: &Bounds,
        cell: [__m256i; 3],
        seen: &Seen<'_, P>,
    ) -> [__m256i; 2] {
        let passes = |bounds: &[f32], place: __m256i| {
            let index = indices(place);
            // SAFETY: a brick of the grid, and its block.
            seen.passes(spread(|lane| unsafe { *bounds.as_ptr().add(index[lane] as usize) }))
        };
        let [x, y, z]: [__m256i; 3] = each(|a| _mm256_srli_epi32::<BLOCK>(cell[a]));
        let [by, bz] =
            [bounds.blocks[0], bounds.blocks[0] * bounds.blocks[1]].map(|n| _mm256_set1_epi32(n as i32));
        let block =
            _mm256_add_epi32(x, _mm256_add_epi32(_mm256_mullo_epi32(by, y), _mm256_mullo_epi32(bz, z)));
        let block = passes(&bounds.of_blocks, block);
        [block, _mm256_or_si256(block, passes(&bounds.of_bricks, self.brick(cell)))]
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
