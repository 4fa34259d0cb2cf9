//! Surfaces met by eight rays at a time: [`crate::cast::first_hit`] in lanes, with the same operations in the same order, for the same bytes.

#[allow(clippy::wildcard_imports, reason = "some twenty intrinsics")]
use std::arch::x86_64::*;

use crate::cast::{self, Cast, Field, HALVINGS};
use crate::frame::{LANES, Packet};

use super::vectors::{any, each, floats, set, spread, transposed, wholes};
use super::{Cells, Pairs, Progress, RUN, Rays, Source};

/// Casts the rays of a packet.
#[target_feature(enable = "avx2")]
pub(crate) fn first_hit<T: Pairs>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    surface: [f32; 3],
    rays: &Packet,
) -> [Cast; LANES] {
    let (cells, packet, rays) = (Cells::new(field), rays, Rays::new(rays));
    let level = Level { iso: _mm256_set1_ps(iso), sign: _mm256_set1_ps(sign) };
    let one = _mm256_set1_epi32(1);
    let mut progress = Progress::new();
    // The lanes that met the surface, and the sample at which.
    let (mut met, mut hit) = (_mm256_setzero_si256(), _mm256_setzero_si256());
    loop {
        let open = _mm256_andnot_si256(met, progress.open(&rays));
        if !any(open) {
            break;
        }
        let Some(mut open) = cells.leap_over(&rays, &mut progress, open) else { continue };
        for _ in 0..RUN {
            let [inside, _] = level.sides(&cells, rays.at(progress.i), open);
            hit = _mm256_blendv_epi8(hit, progress.i, inside);
            met = _mm256_or_si256(met, inside);
            progress.take(open);
            progress.i = _mm256_add_epi32(progress.i, one);
            open = _mm256_andnot_si256(met, progress.open(&rays));
        }
    }
    let mut at = rays.at(hit);
    let left = _mm256_andnot_si256(met, rays.with_rest());
    if any(left) {
        let [inside, _] = level.sides(&cells, rays.rest_at, left);
        progress.take(left);
        hit = _mm256_blendv_epi8(hit, rays.steps, inside);
        at = each(|a| _mm256_blendv_ps(at[a], rays.rest_at[a], _mm256_castsi256_ps(inside)));
        met = _mm256_or_si256(met, inside);
    }
    let mut rgba = [_mm256_setzero_ps(); 4];
    if any(met) {
        // Between the sample before and this one, unless this is the first or the one before is no data.
        let mut outside = rays.at(_mm256_sub_epi32(hit, one));
        let known = _mm256_and_si256(met, _mm256_cmpgt_epi32(hit, _mm256_setzero_si256()));
        let [_, between] = level.sides(&cells, outside, known);
        progress.take(known);
        progress.take_many(_mm256_and_si256(between, _mm256_set1_epi32(HALVINGS as i32)));
        if any(between) {
            for _ in 0..HALVINGS {
                let middle = each(|a| _mm256_mul_ps(_mm256_set1_ps(0.5), _mm256_add_ps(outside[a], at[a])));
                let [to, _] = level.sides(&cells, middle, between);
                let from = _mm256_andnot_si256(to, between);
                at = each(|a| _mm256_blendv_ps(at[a], middle[a], _mm256_castsi256_ps(to)));
                outside = each(|a| _mm256_blendv_ps(outside[a], middle[a], _mm256_castsi256_ps(from)));
            }
        }
        rgba = coloured(&cells, surface, at, met);
    }
    let mut casts = progress.cast(rgba);
    // What is met at once behind a cut may be the cut's face.
    let (first, met) = (wholes(hit), wholes(met));
    for (lane, ray) in packet.iter().enumerate() {
        if let Some(ray) = ray.as_ref().filter(|ray| ray.cut.is_some() && met[lane] < 0 && first[lane] == 0) {
            casts[lane] = cast::first_hit(field, iso, sign, surface, ray);
        }
    }
    casts
}

/// The surface's colour under the lamp, in the lanes that met it; zero in the others.
#[inline]
#[target_feature(enable = "avx2")]
fn coloured<T: Pairs>(
    cells: &Cells<'_, T>,
    [r, g, b]: [f32; 3],
    at: [__m256; 3],
    met: __m256i,
) -> [__m256; 4] {
    let own = [r, g, b, 1.0];
    let mut rgba = each(|c| _mm256_and_ps(_mm256_set1_ps(own[c]), _mm256_castsi256_ps(met)));
    let Source { at: before, moved, .. } = cells.source(at, met);
    let site = cells.site(before);
    let deep = _mm256_and_si256(met, cells.deep(&site));
    if any(deep) {
        rgba = cells.lit(rgba, &site, moved.as_ref(), deep);
    }
    let alone = _mm256_andnot_si256(deep, met);
    if any(alone) {
        let (mut lanes, at): (_, [[f32; LANES]; 3]) = (transposed(rgba), each(|a| floats(at[a])));
        let moved = wholes(moved.map_or(_mm256_setzero_si256(), |moved| moved.lanes));
        for lane in set(alone) {
            lanes[lane] = cells.field.lit_before(own, each(|a| at[a][lane]), moved[lane] < 0);
        }
        rgba = each(|c| spread(|lane| lanes[lane][c]));
    }
    rgba
}

/// The value of the surface.
struct Level {
    iso: __m256,
    sign: __m256,
}

impl Level {
    /// Of the lanes that `look` those whose value reaches it, and those whose value doesn't; neither where there is no data.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn sides<T: Pairs>(&self, cells: &Cells<'_, T>, at: [__m256; 3], look: __m256i) -> [__m256i; 2] {
        let source = cells.source(at, look);
        let value = cells.value(&cells.site(source.at));
        let known = _mm256_and_si256(source.known, Cells::<T>::finite(value));
        let reached = _mm256_cmp_ps::<_CMP_GE_OQ>(_mm256_mul_ps(self.sign, value), self.iso);
        let reached = _mm256_castps_si256(reached);
        [_mm256_and_si256(reached, known), _mm256_andnot_si256(reached, known)]
    }
}
