//! Where samples of a deformed volume come from, in lanes: what [`Warp`](crate::warp::Warp) does, with the same operations in the same order, for the same
//! bytes.

#[allow(clippy::wildcard_imports, reason = "some twenty intrinsics")]
use std::arch::x86_64::*;

use crate::frame::LANES;
use crate::warp::Warp;

use super::vectors::{any, each, floats, mix, set, whole, wholes};
use super::{Cells, Pairs};

/// The displacement of lanes whose samples come from elsewhere.
pub(crate) struct Moved<'a> {
    warp: &'a Warp<'a>,
    /// Those lanes.
    pub(crate) lanes: __m256i,
    /// Stored vectors at the corners of their cells, a component a vector; zero in the other lanes.
    corners: [[__m256; 3]; 8],
    /// Where in the cells.
    within: [__m256; 3],
}

/// Where samples are taken.
pub(crate) struct Source<'a> {
    /// Their places before the deformation.
    pub(crate) at: [__m256; 3],
    /// The lanes that looked and come from somewhere in the volume.
    pub(crate) known: __m256i,
    /// What moved, where anything did.
    pub(crate) moved: Option<Moved<'a>>,
}

impl<'a, T: Pairs> Cells<'a, T> {
    /// Where samples at places are taken in the lanes that `look`.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn source(&self, at: [__m256; 3], look: __m256i) -> Source<'a> {
        match self.field.warp {
            None => Source { at, known: look, moved: None },
            Some(warp) => self.through(warp, at, look),
        }
    }

    /// The same through a displacement.
    #[inline(never)]
    #[target_feature(enable = "avx2")]
    fn through(&self, warp: &'a Warp<'a>, at: [__m256; 3], look: __m256i) -> Source<'a> {
        let site = self.site(at);
        let bricks = wholes(self.brick(site.cell));
        let lanes = whole(|lane| -i32::from(warp.moves(bricks[lane] as usize)));
        let lanes = _mm256_and_si256(look, lanes);
        if !any(lanes) {
            return Source { at, known: look, moved: None };
        }
        let cells = each::<_, 3>(|a| wholes(site.cell[a]));
        let mut stored = [[[0.0_f32; LANES]; 3]; 8];
        let mut vacated = [0_i32; LANES];
        for lane in set(lanes) {
            let corners = warp.corners(each(|a| cells[a][lane] as usize));
            for (stored, corner) in stored.iter_mut().zip(corners) {
                stored.iter_mut().zip(corner).for_each(|(stored, c)| stored[lane] = c);
            }
        }
        if warp.vacates() {
            let at: [[f32; LANES]; 3] = each(|a| floats(at[a]));
            for lane in set(lanes) {
                let place = self.field.samples.shape.place(each(|a| at[a][lane]));
                vacated[lane] = -i32::from(warp.is_vacated(&place));
            }
        }
        // SAFETY: eight floats.
        let corners = each(|i: usize| each(|c: usize| unsafe { _mm256_loadu_ps(stored[i][c].as_ptr()) }));
        let moved = Moved { warp, lanes, corners, within: site.within };
        let shift = moved.turned(moved.between());
        let before =
            each(|a| _mm256_blendv_ps(at[a], _mm256_add_ps(at[a], shift[a]), _mm256_castsi256_ps(lanes)));
        let gone =
            _mm256_or_si256(whole(|lane| vacated[lane]), _mm256_andnot_si256(self.holds(before), lanes));
        Source { at: before, known: _mm256_andnot_si256(gone, look), moved: Some(moved) }
    }

    /// The lanes whose place lies in the volume, as [`Shape::holds`](crate::samples::Shape::holds) has it.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn holds(&self, at: [__m256; 3]) -> __m256i {
        let mut inside = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
        for (a, at) in at.into_iter().enumerate() {
            let end = _mm256_set1_ps(self.field.samples.shape.dims[a] as f32 - 0.5);
            inside = _mm256_and_ps(inside, _mm256_cmp_ps::<_CMP_GE_OQ>(at, _mm256_set1_ps(-0.5)));
            inside = _mm256_and_ps(inside, _mm256_cmp_ps::<_CMP_LE_OQ>(at, end));
        }
        _mm256_castps_si256(inside)
    }
}

impl Moved<'_> {
    /// [`crate::cell::between`].
    #[inline]
    #[target_feature(enable = "avx2")]
    fn between(&self) -> [__m256; 3] {
        let (k, [fx, fy, fz]) = (&self.corners, self.within);
        each(|c| {
            let row = |i: usize| mix(k[i][c], k[i + 1][c], fx);
            mix(mix(row(0), row(2), fy), mix(row(4), row(6), fy), fz)
        })
    }

    /// One of [`crate::cell::slopes`].
    #[inline]
    #[target_feature(enable = "avx2")]
    fn slope(&self, from: [usize; 4], step: usize, [f, g]: [__m256; 2]) -> [__m256; 3] {
        let k = &self.corners;
        each(|c| {
            let rise = |i: usize| _mm256_sub_ps(k[from[i] + step][c], k[from[i]][c]);
            mix(mix(rise(0), rise(1), f), mix(rise(2), rise(3), f), g)
        })
    }

    /// [`crate::cell::turned`], from world to voxels.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn turned(&self, v: [__m256; 3]) -> [__m256; 3] {
        let rows = self.warp.rows();
        each(|r| {
            let part = |c: usize| _mm256_mul_ps(_mm256_set1_ps(rows[r][c]), v[c]);
            _mm256_add_ps(_mm256_add_ps(part(0), part(1)), part(2))
        })
    }

    /// [`Warp::pull_back`] in the lanes that moved; the others' gradients stay.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn pull_back(&self, gradient: [__m256; 3]) -> [__m256; 3] {
        let [fx, fy, fz] = self.within;
        let slopes = [
            self.turned(self.slope([0, 2, 4, 6], 1, [fy, fz])),
            self.turned(self.slope([0, 1, 4, 5], 2, [fx, fz])),
            self.turned(self.slope([0, 1, 2, 3], 4, [fx, fy])),
        ];
        each(|a| {
            let part = |c: usize| _mm256_mul_ps(slopes[a][c], gradient[c]);
            let more = _mm256_add_ps(_mm256_add_ps(part(0), part(1)), part(2));
            let pulled = _mm256_add_ps(gradient[a], more);
            _mm256_blendv_ps(gradient[a], pulled, _mm256_castsi256_ps(self.lanes))
        })
    }
}
