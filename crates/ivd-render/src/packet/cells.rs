//! The cells and bricks of a volume, and rays among them, in lanes.
//!
//! The argument for the `unsafe` blocks is that of the [module above](super).

#[allow(clippy::wildcard_imports, reason = "some thirty intrinsics")]
use std::arch::x86_64::*;

use ivd_core::BRICK;

use crate::camera::Ray;
use crate::cast::{Cast, Field};
use crate::frame::{LANES, Packet};

use super::vectors::{any, clamped, each, indices, mix, spread, transposed, whole, wholes};
use super::{Pairs, serves};

/// What a brick's side is two to the power of (cells).
pub(super) const SIDE: i32 = BRICK.ilog2() as i32;

/// The rays of a packet; those that are none have no steps.
pub(crate) struct Rays {
    pub(crate) start: [__m256; 3],
    pub(crate) delta: [__m256; 3],
    inverse: [__m256; 3],
    /// Whole steps.
    pub(crate) steps: __m256i,
    /// What is left after them: its middle, and its length in steps.
    pub(crate) rest_at: [__m256; 3],
    pub(crate) rest: __m256,
}

impl Rays {
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn new(rays: &Packet) -> Self {
        let of = |value: fn(&Ray) -> f32| spread(|lane| rays[lane].as_ref().map_or(0.0, value));
        Self {
            start: [of(|ray| ray.start[0]), of(|ray| ray.start[1]), of(|ray| ray.start[2])],
            delta: [of(|ray| ray.delta[0]), of(|ray| ray.delta[1]), of(|ray| ray.delta[2])],
            inverse: [of(|ray| ray.inverse[0]), of(|ray| ray.inverse[1]), of(|ray| ray.inverse[2])],
            steps: whole(|lane| rays[lane].as_ref().map_or(0, |ray| ray.steps as i32)),
            rest_at: [of(|ray| ray.rest_at[0]), of(|ray| ray.rest_at[1]), of(|ray| ray.rest_at[2])],
            rest: of(|ray| ray.rest),
        }
    }

    /// Places of samples.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn at(&self, i: __m256i) -> [__m256; 3] {
        self.along(_mm256_cvtepi32_ps(i))
    }

    /// Where steps begin.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn end_at(&self, i: __m256i) -> [__m256; 3] {
        self.along(_mm256_sub_ps(_mm256_cvtepi32_ps(i), _mm256_set1_ps(0.5)))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn along(&self, t: __m256) -> [__m256; 3] {
        each(|a| _mm256_add_ps(self.start[a], _mm256_mul_ps(t, self.delta[a])))
    }

    /// The lanes that have a shorter step at the end.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn with_rest(&self) -> __m256i {
        _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(self.rest, _mm256_setzero_ps()))
    }
}

/// How far the rays of a packet have come.
pub(crate) struct Progress {
    /// The sample that each is at.
    pub(crate) i: __m256i,
    taken: __m256i,
    skipped: __m256i,
}

impl Progress {
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn new() -> Self {
        let zero = _mm256_setzero_si256();
        Self { i: zero, taken: zero, skipped: zero }
    }

    /// The lanes that have whole steps left.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn open(&self, rays: &Rays) -> __m256i {
        _mm256_cmpgt_epi32(rays.steps, self.i)
    }

    /// Goes on to the sample `next` in the lanes that `pass`. What is left of the `open` lanes; nothing where all of them passed.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn pass(
        &mut self,
        rays: &Rays,
        pass: __m256i,
        next: __m256i,
        open: __m256i,
    ) -> Option<__m256i> {
        let next = _mm256_blendv_epi8(self.i, next, pass);
        self.skipped = _mm256_add_epi32(self.skipped, _mm256_sub_epi32(next, self.i));
        self.i = next;
        any(_mm256_andnot_si256(pass, open)).then(|| _mm256_and_si256(open, self.open(rays)))
    }

    /// Counts samples: one in each of the lanes.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn take(&mut self, lanes: __m256i) {
        self.taken = _mm256_sub_epi32(self.taken, lanes);
    }

    /// Counts as many samples as lanes say.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn take_many(&mut self, samples: __m256i) {
        self.taken = _mm256_add_epi32(self.taken, samples);
    }

    /// What came of the rays.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn cast(self, rgba: [__m256; 4]) -> [Cast; LANES] {
        let (rgba, taken, skipped) = (transposed(rgba), wholes(self.taken), wholes(self.skipped));
        std::array::from_fn(|lane| Cast {
            rgba: rgba[lane],
            taken: taken[lane] as usize,
            skipped: skipped[lane] as usize,
        })
    }
}

/// Where places lie among the voxels.
#[derive(Clone, Copy)]
pub(crate) struct Site {
    pub(crate) cell: [__m256i; 3],
    /// First voxels of the cells.
    pub(crate) base: __m256i,
    /// Where in the cells.
    pub(crate) within: [__m256; 3],
}

/// What all packets of a picture share, in every lane.
pub(crate) struct Cells<'a, T> {
    pub(crate) field: &'a Field<'a, T>,
    top: [__m256; 3],
    end: [__m256; 3],
    /// Distances of voxels, and of bricks, along y and z.
    pub(crate) voxels: [__m256i; 2],
    bricks: [__m256i; 2],
}

impl<'a, T: Pairs> Cells<'a, T> {
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn new(field: &'a Field<'a, T>) -> Self {
        let shape = &field.samples.shape;
        let [nx, ny, _] = shape.dims;
        assert!(serves(shape.dims));
        let bricks = field.space.bricks();
        assert!(bricks == shape.dims.map(|n| n.div_ceil(BRICK)), "bricks of this grid");
        assert_eq!(field.space.leaps().len(), bricks.iter().product::<usize>(), "a leap for every brick");
        let of = |n: usize| _mm256_set1_epi32(n as i32);
        let [top, end] = shape.ends();
        Self {
            field,
            top: each(|a| _mm256_set1_ps(top[a])),
            end: each(|a| _mm256_set1_ps(end[a])),
            voxels: [of(nx), of(nx * ny)],
            bricks: [of(bricks[0]), of(bricks[0] * bricks[1])],
        }
    }

    /// The cells of places, as [`Shape::place`](crate::samples::Shape::place) finds them.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn cell(&self, at: [__m256; 3]) -> [__m256i; 3] {
        each(|a| _mm256_cvttps_epi32(clamped(at[a], self.top[a])))
    }

    /// Linear index of each cell's brick.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn brick(&self, cell: [__m256i; 3]) -> __m256i {
        let [x, y, z]: [__m256i; 3] = each(|a| _mm256_srli_epi32::<SIDE>(cell[a]));
        let [by, bz] = self.bricks;
        _mm256_add_epi32(x, _mm256_add_epi32(_mm256_mullo_epi32(by, y), _mm256_mullo_epi32(bz, z)))
    }

    /// Leaps over clear bricks in the `open` lanes. What is left of them; nothing where all leapt.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn leap_over(&self, rays: &Rays, progress: &mut Progress, open: __m256i) -> Option<__m256i> {
        let cell = self.cell(rays.at(progress.i));
        let leap = self.leap(self.brick(cell));
        let clear = _mm256_and_si256(_mm256_cmpgt_epi32(leap, _mm256_setzero_si256()), open);
        if !any(clear) {
            return Some(open);
        }
        let next = self.landing(rays, progress.i, cell, leap);
        progress.pass(rays, clear, next, open)
    }

    /// How many bricks on, less one, everything is clear; 0 for none.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn leap(&self, brick: __m256i) -> __m256i {
        let index = indices(brick);
        let leaps = self.field.space.leaps().as_ptr();
        // SAFETY: there is a leap for every brick.
        whole(|lane| unsafe { i32::from(*leaps.add(index[lane] as usize)) })
    }

    /// Index of the next sample to be looked at in lanes whose sample `i`, in `cell`, is in a clear brick: beyond the bricks that may be leapt over.
    /// As [`Space::leap`](crate::empty_space::Space::leap), never further.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn landing(&self, rays: &Rays, i: __m256i, cell: [__m256i; 3], leap: __m256i) -> __m256i {
        let one = _mm256_set1_epi32(1);
        let brick: [__m256i; 3] = each(|a| _mm256_srli_epi32::<SIDE>(cell[a]));
        // `leap` is one more than the bricks on either side that are clear.
        let first: [__m256i; 3] = each(|a| _mm256_sub_epi32(_mm256_add_epi32(brick[a], one), leap));
        let after: [__m256i; 3] = each(|a| _mm256_add_epi32(brick[a], leap));
        self.leave(
            rays,
            i,
            each(|a| _mm256_slli_epi32::<SIDE>(first[a])),
            each(|a| _mm256_slli_epi32::<SIDE>(after[a])),
        )
    }

    /// Index of a sample behind `i` up to which all lie in the cells from `low` to before `high`, in which sample `i` is: at best the first that doesn't,
    /// never further.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn leave(&self, rays: &Rays, i: __m256i, low: [__m256i; 3], high: [__m256i; 3]) -> __m256i {
        let Rays { start, delta, inverse, steps, .. } = rays;
        let one = _mm256_set1_epi32(1);
        let next = _mm256_add_epi32(i, one);
        let mut exit = _mm256_cvtepi32_ps(_mm256_sub_epi32(*steps, one));
        for a in 0..3 {
            let count = _mm256_set1_epi32((self.field.space.bricks()[a] << SIDE) as i32);
            let rises = _mm256_cmp_ps::<_CMP_GT_OQ>(delta[a], _mm256_setzero_ps());
            let rising = _mm256_castps_si256(rises);
            let plane = _mm256_blendv_epi8(low[a], high[a], rising);
            // Beyond the last brick there is none to look at.
            let inside = _mm256_blendv_epi8(
                _mm256_cmpgt_epi32(low[a], _mm256_setzero_si256()),
                _mm256_cmpgt_epi32(count, high[a]),
                rising,
            );
            let there = _mm256_mul_ps(_mm256_sub_ps(_mm256_cvtepi32_ps(plane), start[a]), inverse[a]);
            // A ray that runs along the planes meets none of them.
            let crosses = _mm256_cmp_ps::<_CMP_NEQ_OQ>(delta[a], _mm256_setzero_ps());
            let nearer = _mm256_and_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(there, exit), _mm256_castsi256_ps(inside));
            let nearer = _mm256_and_ps(nearer, crosses);
            exit = _mm256_blendv_ps(exit, there, nearer);
        }
        // The estimate is put to the test by the sample itself: coordinates are monotone along a ray, so that all samples before one that is
        // inside are.
        let last = _mm256_max_epi32(_mm256_cvttps_epi32(exit), i);
        let cell = self.cell(rays.at(last));
        let mut inside = _mm256_set1_epi32(-1);
        for a in 0..3 {
            inside = _mm256_and_si256(inside, _mm256_cmpgt_epi32(high[a], cell[a]));
            inside = _mm256_andnot_si256(_mm256_cmpgt_epi32(low[a], cell[a]), inside);
        }
        _mm256_blendv_epi8(next, _mm256_add_epi32(last, one), inside)
    }

    /// Where places lie among the voxels.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn site(&self, at: [__m256; 3]) -> Site {
        let cell = self.cell(at);
        let [cx, cy, cz] = cell;
        let within = each(|a| _mm256_sub_ps(clamped(at[a], self.end[a]), _mm256_cvtepi32_ps(cell[a])));
        let [ny, nz] = self.voxels;
        let base =
            _mm256_add_epi32(cx, _mm256_add_epi32(_mm256_mullo_epi32(ny, cy), _mm256_mullo_epi32(nz, cz)));
        Site { cell, base, within }
    }

    /// The lanes whose value is a number.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn finite(value: __m256) -> __m256i {
        if T::TYPE.is_integer() {
            return _mm256_set1_epi32(-1);
        }
        let size = _mm256_andnot_ps(_mm256_set1_ps(-0.0), value);
        _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(size, _mm256_set1_ps(f32::INFINITY)))
    }

    /// [`Samples::value`](crate::samples::Samples::value) at sites.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn value(&self, site: &Site) -> __m256 {
        let ([fx, fy, fz], index) = (site.within, indices(site.base));
        let voxels = self.field.samples.voxels().as_ptr();
        let [_, dy, dz] = self.field.samples.shape.next();
        let along = |further: usize| {
            // SAFETY: rows of a cell's voxels.
            let [a, b] = unsafe { T::pairs(voxels.add(further), &index) };
            mix(a, b, fx)
        };
        mix(mix(along(0), along(dy), fy), mix(along(dz), along(dz + dy), fy), fz)
    }
}
