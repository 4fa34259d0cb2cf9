//! Gradients and light in lanes: what [`Samples::gradient`](crate::samples::Samples::gradient) and [`Light::lit`](crate::light::Light::lit) do, with the same
//! operations in the same order, for the same bytes.
//!
//! The argument for the `unsafe` block: in lanes that aren't deep the site is replaced by one that is, so that the 4³ voxels about a cell exist.

#[allow(clippy::wildcard_imports, reason = "some twenty intrinsics")]
use std::arch::x86_64::*;

use crate::light::{AMBIENT, DIFFUSE, SPECULAR};

use super::vectors::{each, indices, mix};
use super::{Cells, Moved, Pairs, Site};

impl<T: Pairs> Cells<'_, T> {
    /// The lanes whose cell has a cell on every side.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn deep(&self, site: &Site) -> __m256i {
        let one = _mm256_set1_epi32(1);
        let mut deep = _mm256_set1_epi32(-1);
        for a in 0..3 {
            // From 1 to n − 3.
            let end = _mm256_set1_epi32(self.field.samples.shape.dims[a] as i32 - 2);
            deep = _mm256_andnot_si256(_mm256_cmpgt_epi32(one, site.cell[a]), deep);
            deep = _mm256_and_si256(_mm256_cmpgt_epi32(end, site.cell[a]), deep);
        }
        deep
    }

    /// Gradients per voxel at sites, in the lanes that are `deep`, of which there is one at least.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn gradient(&self, site: &Site, deep: __m256i) -> [__m256; 3] {
        let [_, dy, dz] = self.field.samples.shape.next();
        let [fx, fy, fz] = site.within;
        // Of the cell at 1, 1, 1, which is deep where any is.
        let other = _mm256_set1_epi32((1 + dy + dz) as i32);
        let base = _mm256_blendv_epi8(other, site.base, deep);
        let index = indices(_mm256_sub_epi32(base, other));
        let voxels = self.field.samples.voxels().as_ptr();
        let half = _mm256_set1_ps(0.5);
        let rise = |below: __m256, above: __m256| _mm256_mul_ps(half, _mm256_sub_ps(above, below));
        // SAFETY: the voxels −1 ..= 2 about a deep cell exist along every axis; `index` is the first of them.
        let (row, inner) = unsafe {
            (
                |y: usize, z: usize| T::fours(voxels.add(y * dy + z * dz), &index),
                |y: usize, z: usize| T::pairs(voxels.add(1 + y * dy + z * dz), &index),
            )
        };
        // The four rows through the cell, by y and z.
        let rows = [[row(1, 1), row(2, 1)], [row(1, 2), row(2, 2)]];
        let along_x = |[a, b, c, d]: [__m256; 4]| mix(rise(a, c), rise(b, d), fx);
        let x = mix(
            mix(along_x(rows[0][0]), along_x(rows[0][1]), fy),
            mix(along_x(rows[1][0]), along_x(rows[1][1]), fy),
            fz,
        );
        let y = {
            let of_layer = |layer: usize| {
                let (front, back) = (inner(0, layer + 1), inner(3, layer + 1));
                let along = |x: usize| {
                    mix(rise(front[x], rows[layer][1][x + 1]), rise(rows[layer][0][x + 1], back[x]), fy)
                };
                mix(along(0), along(1), fx)
            };
            mix(of_layer(0), of_layer(1), fz)
        };
        let z = {
            let of_row = |row: usize| {
                let (low, high) = (inner(row + 1, 0), inner(row + 1, 3));
                let along =
                    |x: usize| mix(rise(low[x], rows[1][row][x + 1]), rise(rows[0][row][x + 1], high[x]), fz);
                mix(along(0), along(1), fx)
            };
            mix(of_row(0), of_row(1), fy)
        };
        [x, y, z]
    }

    /// Premultiplied colours under the lamp, in the lanes that `lit` names, whose sites are deep; the others stay.
    ///
    /// - `moved`: what brought their samples there.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn lit(
        &self,
        entry: [__m256; 4],
        site: &Site,
        moved: Option<&Moved<'_>>,
        lit: __m256i,
    ) -> [__m256; 4] {
        let light = &self.field.light;
        let mut gradient = self.gradient(site, lit);
        if let Some(moved) = moved {
            gradient = moved.pull_back(gradient);
        }
        let dot = |a: [__m256; 3], b: [f32; 3]| {
            let part = |i: usize| _mm256_mul_ps(_mm256_set1_ps(b[i]), a[i]);
            _mm256_add_ps(_mm256_add_ps(part(0), part(1)), part(2))
        };
        let world: [__m256; 3] = each(|r| dot(gradient, light.to_world[r]));
        let squares: [__m256; 3] = each(|a| _mm256_mul_ps(world[a], world[a]));
        let square = _mm256_add_ps(_mm256_add_ps(squares[0], squares[1]), squares[2]);
        let is_way = _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_GT_OQ>(square, _mm256_set1_ps(f32::MIN_POSITIVE)),
            _mm256_cmp_ps::<_CMP_LT_OQ>(square, _mm256_set1_ps(f32::MAX)),
        );
        let scale = _mm256_div_ps(_mm256_set1_ps(-1.0), _mm256_sqrt_ps(square));
        let normal = each(|a| _mm256_mul_ps(world[a], scale));
        let half = _mm256_set1_ps(0.5);
        let wrapped = _mm256_add_ps(half, _mm256_mul_ps(half, dot(normal, light.lamp)));
        let diffuse = _mm256_mul_ps(_mm256_mul_ps(_mm256_set1_ps(DIFFUSE), wrapped), wrapped);
        let matt = _mm256_add_ps(_mm256_set1_ps(AMBIENT), diffuse);
        let mut shine = _mm256_max_ps(dot(normal, light.halfway), _mm256_setzero_ps());
        for _ in 0..5 {
            shine = _mm256_mul_ps(shine, shine);
        }
        let alpha = entry[3];
        let highlight = _mm256_mul_ps(_mm256_mul_ps(_mm256_set1_ps(SPECULAR), shine), alpha);
        let lit = _mm256_and_ps(is_way, _mm256_castsi256_ps(lit));
        let colour = |c: usize| {
            let under = _mm256_min_ps(_mm256_add_ps(_mm256_mul_ps(entry[c], matt), highlight), alpha);
            _mm256_blendv_ps(entry[c], under, lit)
        };
        [colour(0), colour(1), colour(2), alpha]
    }
}
