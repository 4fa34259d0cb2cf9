//! Direct volume rendering of eight rays at a time with AVX2: [`crate::dvr`] in lanes.
//!
//! Each lane does what the plain loop does, with the same operations in the same order (no fused multiplication), so that both give the
//! same bytes. A packet leaps where all its rays are in clear bricks; else all its lanes sample together for a [`RUN`], those in clear bricks as
//! well: a sample there adds nothing, and to sort lanes costs more than to take it. Hence its counts of samples are a little above the plain loop's.
//!
//! The argument for the `unsafe` blocks, which read voxels and tables without checks:
//!
//! - *Voxels.* [`Lanes::cell`] clamps as [`Shape::place`](crate::samples::Shape::place) does, in lanes whose ray has ended or that hold none as well, so that
//!   a cell's eight voxels are in the grid. [`serves`] demands two voxels along every axis and fewer than 2³⁰ of them, so that their indices
//!   are whole numbers of 32 bits.
//! - *Leaps.* A cell's brick lies in the grid of bricks, and [`Space::leaps`](crate::empty_space::Space::leaps) holds one for each of them (asserted).
//! - *Entries* of the transfer function: an index is clamped to a row as [`ValueAxis::index`] does, and rows lie in the table whole.

pub(crate) mod vectors;

#[allow(clippy::wildcard_imports, reason = "some fifty intrinsics")]
use std::arch::x86_64::*;

use ivd_core::BRICK;

use crate::axis::ValueAxis;
use crate::camera::Ray;
use crate::cast::{Cast, Field};
use crate::classify::of_part;
use crate::dvr::{AtMiddle, Optics};
use crate::frame::{LANES, Packet};
use crate::samples::Stored;

use vectors::{
    any, clamped, each, floats, gathered, indices, mix, over, set, spread, transposed, whole, wholes,
};

/// Steps beyond which a packet doesn't serve a ray: up to here their numbers are exact in `f32`.
const MOST_STEPS: usize = 1 << 24;

/// Whether packets serve a grid.
pub(crate) fn serves(dims: [usize; 3]) -> bool {
    dims.iter().all(|&n| n >= 2) && dims.iter().product::<usize>() < 1 << 30
}

/// Whether a packet serves these rays.
pub(crate) fn serves_rays(rays: &Packet) -> bool {
    rays.iter().flatten().all(|ray| ray.steps < MOST_STEPS)
}

/// Two neighbours along x at once.
pub(crate) trait Pairs: Stored {
    /// Values at an index and the next one in every lane, as `f32`. Inserts, as a gather takes longer on many processors.
    ///
    /// # Safety
    /// AVX2 must be there, and for every `index` two values from `first + index`.
    unsafe fn pairs(first: *const Self, index: &[u32; LANES]) -> [__m256; 2];
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

/// Samples that lanes take between looking for clear bricks.
const RUN: usize = 4;

/// What a step looks like, in lanes.
pub(crate) trait Looks<T: Pairs>: Optics<T> + Sized {
    /// Where values lie in a table.
    fn axis(&self) -> &ValueAxis;

    /// What is known at an end of a step, which the next one begins with.
    ///
    /// # Safety
    /// AVX2 must be there.
    unsafe fn end(lanes: &Lanes<'_, T, Self>, at: [__m256; 3]) -> __m256i;

    /// Premultiplied colour and opacity of steps with their middles at `at`, in the lanes that `look`; zero in the others. `ends`: what [`Self::end`]
    /// gave at the front and the back.
    ///
    /// # Safety
    /// AVX2 must be there.
    unsafe fn look(
        lanes: &Lanes<'_, T, Self>,
        ends: [__m256i; 2],
        at: [__m256; 3],
        look: __m256i,
    ) -> [__m256; 4];
}

impl<T: Pairs, const LABELLED: bool, const SHADED: bool> Looks<T> for AtMiddle<'_, LABELLED, SHADED> {
    fn axis(&self) -> &ValueAxis {
        self.0.axis()
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn end(_: &Lanes<'_, T, Self>, _: [__m256; 3]) -> __m256i {
        _mm256_setzero_si256()
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn look(
        lanes: &Lanes<'_, T, Self>,
        _: [__m256i; 2],
        at: [__m256; 3],
        look: __m256i,
    ) -> [__m256; 4] {
        lanes.classified(at, look)
    }
}

/// What all packets of a picture share, in every lane.
pub(crate) struct Lanes<'a, T, L> {
    pub(crate) field: &'a Field<'a, T>,
    pub(crate) looks: &'a L,
    top: [__m256; 3],
    end: [__m256; 3],
    /// Distances of voxels, and of bricks, along y and z.
    voxels: [__m256i; 2],
    bricks: [__m256i; 2],
    axis: [__m256; 3],
    /// The places up to this one are clear in row 0.
    pub(crate) clear: __m256i,
}

/// Casts the rays of a packet.
#[target_feature(enable = "avx2")]
pub(crate) fn dvr<T: Pairs, L: Looks<T>>(
    field: &Field<'_, T>,
    looks: &L,
    termination: f32,
    rays: &Packet,
) -> [Cast; LANES] {
    let lanes = Lanes::new(field, looks);
    let of = |value: fn(&Ray) -> f32| spread(|lane| rays[lane].as_ref().map_or(0.0, value));
    let start = [of(|ray| ray.start[0]), of(|ray| ray.start[1]), of(|ray| ray.start[2])];
    let delta = [of(|ray| ray.delta[0]), of(|ray| ray.delta[1]), of(|ray| ray.delta[2])];
    let inverse = [of(|ray| ray.inverse[0]), of(|ray| ray.inverse[1]), of(|ray| ray.inverse[2])];
    let steps = whole(|lane| rays[lane].as_ref().map_or(0, |ray| ray.steps as i32));
    let at = |i: __m256i| -> [__m256; 3] {
        let t = _mm256_cvtepi32_ps(i);
        each(|a| _mm256_add_ps(start[a], _mm256_mul_ps(t, delta[a])))
    };
    let end_at = |i: __m256i| -> [__m256; 3] {
        let t = _mm256_sub_ps(_mm256_cvtepi32_ps(i), _mm256_set1_ps(0.5));
        each(|a| _mm256_add_ps(start[a], _mm256_mul_ps(t, delta[a])))
    };

    let end = _mm256_set1_ps(termination);
    let mut rgba = [_mm256_setzero_ps(); 4];
    let (mut taken, mut skipped) = (_mm256_setzero_si256(), _mm256_setzero_si256());
    let mut ended = _mm256_setzero_si256();
    // The sample a lane is at. Lanes whose ray has ended go on with the others and count for nothing, so that the next place doesn't wait for
    // this one's colour.
    let mut i = _mm256_setzero_si256();
    loop {
        let mut open = _mm256_andnot_si256(ended, _mm256_cmpgt_epi32(steps, i));
        if !any(open) {
            break;
        }
        let cell = lanes.cell(at(i));
        let leap = lanes.leap(lanes.brick(cell));
        let clear = _mm256_and_si256(_mm256_cmpgt_epi32(leap, _mm256_setzero_si256()), open);
        if any(clear) {
            let next = lanes.landing(i, steps, cell, leap, start, delta, inverse);
            let next = _mm256_blendv_epi8(i, next, clear);
            skipped = _mm256_add_epi32(skipped, _mm256_sub_epi32(next, i));
            i = next;
            if !any(_mm256_andnot_si256(clear, open)) {
                continue;
            }
            open = _mm256_and_si256(open, _mm256_cmpgt_epi32(steps, i));
        }
        // SAFETY: this function has AVX2.
        let mut front = unsafe { L::end(&lanes, end_at(i)) };
        for _ in 0..RUN {
            let after = _mm256_add_epi32(i, _mm256_set1_epi32(1));
            // SAFETY: as above.
            let back = unsafe { L::end(&lanes, end_at(after)) };
            // SAFETY: as above.
            let entry = unsafe { L::look(&lanes, [front, back], at(i), open) };
            front = back;
            over(&mut rgba, entry);
            let full = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GE_OQ>(rgba[3], end));
            ended = _mm256_or_si256(ended, full);
            taken = _mm256_sub_epi32(taken, open);
            i = after;
            open = _mm256_andnot_si256(ended, _mm256_cmpgt_epi32(steps, i));
        }
    }

    // The shorter step at a ray's end.
    let rest = of(|ray| ray.rest);
    let left = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(rest, _mm256_setzero_ps()));
    let left = _mm256_andnot_si256(ended, left);
    if any(left) {
        let here = [of(|ray| ray.rest_at[0]), of(|ray| ray.rest_at[1]), of(|ray| ray.rest_at[2])];
        let ends = [-0.5, 0.5].map(|side| {
            let t = _mm256_mul_ps(_mm256_set1_ps(side), rest);
            // SAFETY: this function has AVX2.
            unsafe { L::end(&lanes, each(|a| _mm256_add_ps(here[a], _mm256_mul_ps(t, delta[a])))) }
        });
        // SAFETY: this function has AVX2.
        let mut entry = unsafe { L::look(&lanes, ends, here, left) };
        if any(_mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(entry[3], _mm256_setzero_ps()))) {
            let parts = transposed(entry);
            let rests = floats(rest);
            let parts: [[f32; 4]; LANES] = std::array::from_fn(|lane| of_part(parts[lane], rests[lane]));
            entry = each(|c| spread(|lane| parts[lane][c]));
        }
        over(&mut rgba, entry);
        taken = _mm256_sub_epi32(taken, left);
    }

    let (rgba, taken, skipped) = (transposed(rgba), wholes(taken), wholes(skipped));
    std::array::from_fn(|lane| Cast {
        rgba: rgba[lane],
        taken: taken[lane] as usize,
        skipped: skipped[lane] as usize,
    })
}

impl<'a, T: Pairs, L: Looks<T>> Lanes<'a, T, L> {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(field: &'a Field<'a, T>, looks: &'a L) -> Self {
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
            looks,
            top: each(|a| _mm256_set1_ps(top[a])),
            end: each(|a| _mm256_set1_ps(end[a])),
            voxels: [of(nx), of(nx * ny)],
            bricks: [of(bricks[0]), of(bricks[0] * bricks[1])],
            clear: _mm256_set1_epi32(looks.axis().clear_up_to()),
            axis: each(|c| _mm256_set1_ps(looks.axis().numbers()[c])),
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
        let [x, y, z]: [__m256i; 3] = each(|a| _mm256_srli_epi32::<{ BRICK.ilog2() as i32 }>(cell[a]));
        let [by, bz] = self.bricks;
        _mm256_add_epi32(x, _mm256_add_epi32(_mm256_mullo_epi32(by, y), _mm256_mullo_epi32(bz, z)))
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
    #[allow(clippy::too_many_arguments, reason = "the rays of a packet, in lanes")]
    fn landing(
        &self,
        i: __m256i,
        steps: __m256i,
        cell: [__m256i; 3],
        leap: __m256i,
        start: [__m256; 3],
        delta: [__m256; 3],
        inverse: [__m256; 3],
    ) -> __m256i {
        let one = _mm256_set1_epi32(1);
        let next = _mm256_add_epi32(i, one);
        let mut exit = _mm256_cvtepi32_ps(_mm256_sub_epi32(steps, one));
        let (mut low, mut high) = ([next; 3], [next; 3]);
        for a in 0..3 {
            let count = _mm256_set1_epi32(self.field.space.bricks()[a] as i32);
            let brick = _mm256_srli_epi32::<{ BRICK.ilog2() as i32 }>(cell[a]);
            // `leap` is one more than the bricks on either side that are clear.
            let after = _mm256_add_epi32(brick, leap);
            let first = _mm256_sub_epi32(_mm256_add_epi32(brick, one), leap);
            low[a] = _mm256_slli_epi32::<{ BRICK.ilog2() as i32 }>(first);
            high[a] = _mm256_slli_epi32::<{ BRICK.ilog2() as i32 }>(after);
            let rises = _mm256_cmp_ps::<_CMP_GT_OQ>(delta[a], _mm256_setzero_ps());
            let rising = _mm256_castps_si256(rises);
            let plane = _mm256_blendv_epi8(low[a], high[a], rising);
            // Beyond the last brick there is none to look at.
            let inside = _mm256_blendv_epi8(
                _mm256_cmpgt_epi32(first, _mm256_setzero_si256()),
                _mm256_cmpgt_epi32(count, after),
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
        let t = _mm256_cvtepi32_ps(last);
        let cell = self.cell(each(|a| _mm256_add_ps(start[a], _mm256_mul_ps(t, delta[a]))));
        let mut inside = _mm256_set1_epi32(-1);
        for a in 0..3 {
            inside = _mm256_and_si256(inside, _mm256_cmpgt_epi32(high[a], cell[a]));
            inside = _mm256_andnot_si256(_mm256_cmpgt_epi32(low[a], cell[a]), inside);
        }
        _mm256_blendv_epi8(next, _mm256_add_epi32(last, one), inside)
    }

    /// Value at places, and its place in a table. The first also tells the first voxels of the places' cells, and where in the cells they are.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn sample(&self, at: [__m256; 3]) -> Sample {
        let cell = self.cell(at);
        let [cx, cy, cz] = cell;
        let within = each(|a| _mm256_sub_ps(clamped(at[a], self.end[a]), _mm256_cvtepi32_ps(cell[a])));
        let [ny, nz] = self.voxels;
        let base =
            _mm256_add_epi32(cx, _mm256_add_epi32(_mm256_mullo_epi32(ny, cy), _mm256_mullo_epi32(nz, cz)));
        let value = self.value(base, within);
        let [low, scale, top] = self.axis;
        let index = _mm256_add_ps(_mm256_mul_ps(_mm256_sub_ps(value, low), scale), _mm256_set1_ps(0.5));
        Sample { cell, base, within, value, index: _mm256_cvttps_epi32(clamped(index, top)) }
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

    /// [`Samples::value`](crate::samples::Samples::value) in the cells that begin at `base`.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn value(&self, base: __m256i, [fx, fy, fz]: [__m256; 3]) -> __m256 {
        let index = indices(base);
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

/// A value in lanes, and where it lies.
pub(crate) struct Sample {
    pub(crate) cell: [__m256i; 3],
    /// First voxels of the cells.
    base: __m256i,
    /// Where in the cells.
    within: [__m256; 3],
    pub(crate) value: __m256,
    /// Place in a table; that of no value means nothing.
    pub(crate) index: __m256i,
}

impl<T: Pairs, const LABELLED: bool, const SHADED: bool> Lanes<'_, T, AtMiddle<'_, LABELLED, SHADED>> {
    /// [`Field::classified`] in the lanes that `look`; zero in the others.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn classified(&self, at: [__m256; 3], look: __m256i) -> [__m256; 4] {
        let Sample { cell, base, within, value, mut index } = self.sample(at);
        if !LABELLED {
            let visible = _mm256_cmpgt_epi32(index, self.clear);
            if !any(_mm256_and_si256(visible, look)) && self.field.warp.is_none() {
                return [_mm256_setzero_ps(); 4];
            }
        }
        if LABELLED {
            index = _mm256_add_epi32(index, self.rows(base, within));
        }
        let seen = _mm256_and_si256(look, Self::finite(value));
        let entry = self.entries(index);
        let mut entry = each(|c| _mm256_and_ps(entry[c], _mm256_castsi256_ps(seen)));
        let alone = self.field.warp.is_some()
            || (SHADED || self.looks.0.steep().is_some())
                && any(_mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(entry[3], _mm256_setzero_ps())));
        if alone {
            entry = self.one_by_one(at, self.brick(cell), look, entry);
        }
        entry
    }

    /// What lanes can't do together: light, gradients, and samples that come from elsewhere.
    #[inline(never)]
    #[target_feature(enable = "avx2")]
    fn one_by_one(&self, at: [__m256; 3], brick: __m256i, look: __m256i, entry: [__m256; 4]) -> [__m256; 4] {
        let (bricks, mut entries) = (wholes(brick), transposed(entry));
        let at: [[f32; LANES]; 3] = each(|a| floats(at[a]));
        for lane in set(look) {
            let at = each(|a| at[a][lane]);
            let moves = self.field.moves(bricks[lane] as usize);
            let is_steep = self.looks.0.steep().is_some() && entries[lane][3] > 0.0;
            if moves || is_steep {
                entries[lane] = self.field.classified_before::<LABELLED, SHADED>(self.looks.0, at, moves);
            } else if SHADED && entries[lane][3] > 0.0 {
                entries[lane] = self.field.lit(entries[lane], at);
            }
        }
        each(|c| spread(|lane| entries[lane][c]))
    }

    /// First entries of the rows of the voxels nearest to places.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn rows(&self, base: __m256i, within: [__m256; 3]) -> __m256i {
        let [dy, dz] = self.voxels;
        let distance = [_mm256_set1_epi32(1), dy, dz];
        let mut nearest = base;
        for a in 0..3 {
            let up = _mm256_cmp_ps::<_CMP_GE_OQ>(within[a], _mm256_set1_ps(0.5));
            let up = _mm256_and_si256(_mm256_castps_si256(up), distance[a]);
            nearest = _mm256_add_epi32(nearest, up);
        }
        let nearest = wholes(nearest);
        whole(|lane| self.looks.0.row_start(self.field.ids[nearest[lane] as usize]) as i32)
    }

    /// Entries of the transfer function, a component a vector.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn entries(&self, index: __m256i) -> [__m256; 4] {
        let table = self.looks.0.table().as_ptr();
        let index = indices(index);
        // SAFETY: an index clamped to a row, after the first entry of a row.
        unsafe { gathered(|lane| table.add(index[lane] as usize)) }
    }
}
