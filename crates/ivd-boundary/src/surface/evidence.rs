//! Whether a set is more than what noise gives.
//!
//! Noise has sets too whose means differ: what is above the mean and what is below, or smoother sets of which the means differ less. What
//! they lack is to be compact and different at once:
//!
//! ```text
//! evidence = d n_in n_out / (n faces)  ·  min(contrast² / variance, 4)
//! ```
//!
//! of `n` voxels on `d` axes, `faces` between inside and outside, and the contrast and variance of what voxels cost inside, less outside. Of
//! voxels that are chosen independently the first factor is ½, whatever their share (faces are 2 d n p (1 − p)), and the second is 8/π for the
//! halves of a normal distribution, 3 of a uniform one, and at most 4 of two equal halves; a ball of radius r has a first factor of 2r/3.

use ivd_core::parallel;

use super::band::Band;
use super::level::{CUBE, Level};
use super::look::{Bits, is_inside};

/// Least evidence of a part. Noise in volumes of 6³ to 48³ voxels comes to 2.0 at most where the weight of the area follows from it, and to
/// 2.4 in 1 of 30 where a weight was given; gyroids of 12 voxels come to 3.8 in noise of 0.5, those of 24 to 3.3 in noise of 1, balls of
/// radius 5 in 64³ voxels to 2.5 from a start that tells values.
pub(super) const LEAST: f64 = 2.4;

/// Most that contrast counts: more is only said of small shares.
const MOST_CONTRAST: f64 = 4.0;

/// Evidence of a set: its bits and forces in the bricks in work, its faces, and voxels inside and outside over the whole level.
pub(super) fn evidence(
    level: &Level,
    band: &Band,
    set: &[Bits],
    [inside, outside]: [f64; 2],
    faces: u64,
) -> f64 {
    // Count, sum and squares of the force, outside and inside.
    let of_pieces = parallel::map_pieces(set.len(), 64, &|slots| {
        let mut sides = [[0.0_f64; 3]; 2];
        for slot in slots {
            let bits = &set[slot];
            for i in (0..CUBE).filter(|&i| !band.values[slot][i].is_nan()) {
                let side = &mut sides[usize::from(is_inside(bits, i))];
                let force = f64::from(band.force[slot][i]);
                *side = [side[0] + 1.0, side[1] + force, side[2] + force * force];
            }
        }
        sides
    });
    let mut sides = [[0.0_f64; 3]; 2];
    for piece in &of_pieces {
        sides.iter_mut().flatten().zip(piece.iter().flatten()).for_each(|(all, of)| *all += of);
    }
    let [out, own] = sides;
    let mean = |side: [f64; 3]| side[1] / side[0];
    let all: [f64; 3] = std::array::from_fn(|i| out[i] + own[i]);
    let variance = all[2] / all[0] - mean(all).powi(2);
    let contrast = mean(out) - mean(own);
    if faces == 0 || contrast.is_nan() || contrast <= 0.0 || variance <= 0.0 {
        return 0.0;
    }
    let compact = level.axes() as f64 * inside * outside / ((inside + outside) * faces as f64);
    compact * (contrast * contrast / variance).min(MOST_CONTRAST)
}
