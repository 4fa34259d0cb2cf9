//! Eight rays at a time with AVX2: [`crate::dvr`] in lanes, and what the other modes do.
//!
//! Each lane does what the plain loop does, with the same operations in the same order (no fused multiplication), so that both give the
//! same bytes. Lanes in clear bricks leap; then all lanes sample together for a [`RUN`], those that
//! have come to a clear brick as well: a sample there adds nothing, and to sort lanes costs more than to take it. Hence its counts of samples are a little above
//! the plain loop's.
//!
//! The argument for the `unsafe` blocks, which read voxels and tables without checks:
//!
//! - *Voxels.* [`Cells::cell`] clamps as [`Shape::place`](crate::samples::Shape::place) does, in lanes whose ray has ended or that hold none as well, so that
//!   a cell's eight voxels are in the grid. [`serves`] demands two voxels along every axis and fewer than 2³⁰ of them, so that their indices
//!   are whole numbers of 32 bits.
//! - *Leaps.* A cell's brick lies in the grid of bricks, and [`Space::leaps`](crate::empty_space::Space::leaps) holds one for each of them (asserted).
//! - *Entries* of the transfer function: an index is clamped to a row as [`ValueAxis::index`] does, and rows lie in the table whole.

mod cells;
mod first_hit;
mod moved;
mod pairs;
mod project;
mod projections;
mod shade;
pub(crate) mod vectors;

#[allow(clippy::wildcard_imports, reason = "some fifty intrinsics")]
use std::arch::x86_64::*;

use crate::axis::ValueAxis;
use crate::camera::Ray;
use crate::cast::{Cast, Field};
use crate::classify::of_part;
use crate::dvr::{AtMiddle, Optics, behind_cut};
use crate::frame::{LANES, Packet};

pub(crate) use cells::{Cells, Progress, Rays, Site};
pub(crate) use first_hit::first_hit;
pub(crate) use moved::{Moved, Source};
pub(crate) use pairs::Pairs;
pub(crate) use project::{ProjectLanes, project};
use vectors::{any, clamped, each, floats, gathered, indices, over, set, spread, transposed, whole, wholes};

/// Steps beyond which a packet doesn't serve a ray: up to here their numbers are exact in `f32`.
const MOST_STEPS: usize = 1 << 24;

/// Whether packets serve a grid.
pub(crate) fn serves(dims: [usize; 3]) -> bool {
    dims.iter().all(|&n| n >= 2) && dims.iter().product::<usize>() < 1 << 30
}

/// Whether a packet serves these rays.
pub(crate) fn serves_rays(rays: &Packet) -> bool {
    // A ray that ends within a voxel of a cut is lit to its end as the cut lies.
    let ends_behind_cut = |ray: &Ray| ray.cut.is_some_and(|cut| ray.steps < cut.steps);
    rays.iter().flatten().all(|ray| ray.steps < MOST_STEPS && !ends_behind_cut(ray))
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
    pub(crate) cells: Cells<'a, T>,
    pub(crate) looks: &'a L,
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
    let end = _mm256_set1_ps(termination);
    let mut rgba = [_mm256_setzero_ps(); 4];
    let mut ended = _mm256_setzero_si256();
    // Lanes whose ray has ended go on with the others and count for nothing, so that the next place doesn't wait for this one's colour.
    let mut progress = Progress::new();
    if rays.iter().flatten().any(|ray| ray.cut.is_some()) {
        let behind = |ray: &Ray| behind_cut(field, looks, termination, ray);
        let begun: [_; LANES] = std::array::from_fn(|lane| rays[lane].as_ref().map(behind));
        rgba = each(|c| spread(|lane| begun[lane].as_ref().map_or(0.0, |begun| begun.rgba[c])));
        progress.i = whole(|lane| begun[lane].as_ref().map_or(0, |begun| begun.steps as i32));
        progress.take_many(progress.i);
        ended = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GE_OQ>(rgba[3], end));
    }
    let rays = Rays::new(rays);
    loop {
        let open = _mm256_andnot_si256(ended, progress.open(&rays));
        if !any(open) {
            break;
        }
        let Some(mut open) = lanes.cells.leap_over(&rays, &mut progress, open) else { continue };
        // SAFETY: this function has AVX2.
        let mut front = unsafe { L::end(&lanes, rays.end_at(progress.i)) };
        for _ in 0..RUN {
            let after = _mm256_add_epi32(progress.i, _mm256_set1_epi32(1));
            // SAFETY: as above.
            let back = unsafe { L::end(&lanes, rays.end_at(after)) };
            // SAFETY: as above.
            let entry = unsafe { L::look(&lanes, [front, back], rays.at(progress.i), open) };
            front = back;
            over(&mut rgba, entry);
            let full = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GE_OQ>(rgba[3], end));
            ended = _mm256_or_si256(ended, full);
            progress.take(open);
            progress.i = after;
            open = _mm256_andnot_si256(ended, progress.open(&rays));
        }
    }

    // The shorter step at a ray's end.
    let left = _mm256_andnot_si256(ended, rays.with_rest());
    if any(left) {
        let (rest, here) = (rays.rest, rays.rest_at);
        let ends = [-0.5, 0.5].map(|side| {
            let t = _mm256_mul_ps(_mm256_set1_ps(side), rest);
            // SAFETY: this function has AVX2.
            unsafe { L::end(&lanes, each(|a| _mm256_add_ps(here[a], _mm256_mul_ps(t, rays.delta[a])))) }
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
        progress.take(left);
    }
    progress.cast(rgba)
}

impl<'a, T: Pairs, L: Looks<T>> Lanes<'a, T, L> {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn new(field: &'a Field<'a, T>, looks: &'a L) -> Self {
        Self {
            cells: Cells::new(field),
            looks,
            clear: _mm256_set1_epi32(looks.axis().clear_up_to()),
            axis: each(|c| _mm256_set1_ps(looks.axis().numbers()[c])),
        }
    }

    /// Value at places, and its place in a table.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn sample(&self, at: [__m256; 3]) -> Sample {
        let site = self.cells.site(at);
        let value = self.cells.value(&site);
        let [low, scale, top] = self.axis;
        let index = _mm256_add_ps(_mm256_mul_ps(_mm256_sub_ps(value, low), scale), _mm256_set1_ps(0.5));
        Sample { site, value, index: _mm256_cvttps_epi32(clamped(index, top)) }
    }
}

/// A value in lanes, and where it lies.
pub(crate) struct Sample {
    pub(crate) site: Site,
    pub(crate) value: __m256,
    /// Place in a table; that of no value means nothing.
    pub(crate) index: __m256i,
}

impl<T: Pairs, const LABELLED: bool, const SHADED: bool> Lanes<'_, T, AtMiddle<'_, LABELLED, SHADED>> {
    /// [`Field::classified`] in the lanes that `look`; zero in the others.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn classified(&self, at: [__m256; 3], look: __m256i) -> [__m256; 4] {
        let Source { at: before, known, moved } = self.cells.source(at, look);
        let Sample { site, value, mut index } = self.sample(before);
        if LABELLED {
            index = _mm256_add_epi32(index, self.rows(&site));
        } else if !any(_mm256_and_si256(_mm256_cmpgt_epi32(index, self.clear), known)) {
            return [_mm256_setzero_ps(); 4];
        }
        let seen = _mm256_and_si256(known, Cells::<T>::finite(value));
        let entry = self.entries(index);
        let mut entry = each(|c| _mm256_and_ps(entry[c], _mm256_castsi256_ps(seen)));
        let is_steep = self.looks.0.steep().is_some();
        if !(SHADED || is_steep) {
            return entry;
        }
        let visible = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(entry[3], _mm256_setzero_ps()));
        // What has a voxel on every side is lit together.
        let deep = if is_steep { _mm256_setzero_si256() } else { self.cells.deep(&site) };
        let lit = _mm256_and_si256(visible, deep);
        if any(lit) {
            entry = self.cells.lit(entry, &site, moved.as_ref(), lit);
        }
        let alone = _mm256_andnot_si256(lit, visible);
        if any(alone) {
            entry =
                self.one_by_one(at, moved.map_or(_mm256_setzero_si256(), |moved| moved.lanes), alone, entry);
        }
        entry
    }

    /// What lanes can't do together: looks by gradient, and light at the sides of the volume.
    #[inline(never)]
    #[target_feature(enable = "avx2")]
    fn one_by_one(&self, at: [__m256; 3], moved: __m256i, alone: __m256i, entry: [__m256; 4]) -> [__m256; 4] {
        let (moved, mut entries) = (wholes(moved), transposed(entry));
        let at: [[f32; LANES]; 3] = each(|a| floats(at[a]));
        for lane in set(alone) {
            let (at, field) = (each(|a| at[a][lane]), self.cells.field);
            entries[lane] = field.classified_before::<LABELLED, SHADED>(self.looks.0, at, moved[lane] < 0);
        }
        each(|c| spread(|lane| entries[lane][c]))
    }

    /// First entries of the rows of the voxels nearest to places.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn rows(&self, site: &Site) -> __m256i {
        let Site { base, within, .. } = *site;
        let [dy, dz] = self.cells.voxels;
        let distance = [_mm256_set1_epi32(1), dy, dz];
        let mut nearest = base;
        for a in 0..3 {
            let up = _mm256_cmp_ps::<_CMP_GE_OQ>(within[a], _mm256_set1_ps(0.5));
            let up = _mm256_and_si256(_mm256_castps_si256(up), distance[a]);
            nearest = _mm256_add_epi32(nearest, up);
        }
        let nearest = wholes(nearest);
        whole(|lane| self.looks.0.row_start(self.cells.field.ids[nearest[lane] as usize]) as i32)
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
