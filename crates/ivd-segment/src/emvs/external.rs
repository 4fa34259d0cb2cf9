//! The external field of coupled voxels: how much each component is preferred where the neighbours say nothing.
//!
//! EM's weights say how frequent the components are. Among coupled voxels the neighbours say most of that already, so that
//! weights and couplings together say it twice, and rare components vanish. The field that is left to a voxel alone is found
//! by the coding method (Besag 1974): given the black voxels, the red ones are independent of each other, and the likeliest
//! field is the one with which the model expects of every component the share that the red voxels have of it. The conditional
//! likelihood is concave; iterative scaling (Darroch & Ratcliff 1972) climbs it.

use ivd_core::{Error, Exec};

use super::exponential::exp;
use super::field::Field;

/// Shares that are looked at, about: the field is K numbers, and needs no more.
const SAMPLE: usize = 1 << 20;
/// Most rounds of scaling.
const ROUNDS: usize = 50;
/// Scaling ends where no logarithm changes by more.
const STILL: f64 = 1e-4;
/// Largest change of a logarithm in a round, for fields that couplings of any strength hide.
const LARGEST_STEP: f64 = 4.0;

/// Weights, of sum 1, that take the place of `weights` among coupled voxels. Components that no voxel of the sample has a
/// share of keep theirs, in proportion to the others.
pub(super) fn field(
    weights: &[f64],
    distributions: &Field,
    couplings: [f64; 3],
    exec: &Exec,
) -> Result<Vec<f64>, Error> {
    let (own, neighbours) = distributions.red_sample(SAMPLE / weights.len(), couplings);
    climb(weights, &own, &neighbours, exec)
}

/// The likeliest field of voxels with the shares `own`, which their `neighbours` pull at; shape `[voxels][K]`, both.
fn climb(weights: &[f64], own: &[f64], neighbours: &[f64], exec: &Exec) -> Result<Vec<f64>, Error> {
    let k = weights.len();
    let mut shares = vec![0.0; k];
    for voxel in own.chunks_exact(k) {
        shares.iter_mut().zip(voxel).for_each(|(sum, q)| *sum += q);
    }
    let mut field: Vec<f64> = weights.iter().map(|w| w.max(f64::MIN_POSITIVE).ln()).collect();
    let mut row = vec![0.0; k];
    for _ in 0..ROUNDS {
        exec.check_cancelled()?;
        let mut expected = vec![0.0; k];
        for voxel in neighbours.chunks_exact(k) {
            let most = voxel.iter().zip(&field).fold(f64::NEG_INFINITY, |most, (n, a)| (n + a).max(most));
            let mut all = 0.0;
            for ((e, n), a) in row.iter_mut().zip(voxel).zip(&field) {
                *e = exp(n + a - most);
                all += *e;
            }
            expected.iter_mut().zip(&row).for_each(|(sum, e)| *sum += e / all);
        }
        let mut moved = 0.0_f64;
        for ((a, share), expected) in
            field.iter_mut().zip(&shares).zip(&expected).filter(|((_, s), _)| **s > 0.0)
        {
            let step = (share / expected.max(f64::MIN_POSITIVE)).ln().clamp(-LARGEST_STEP, LARGEST_STEP);
            *a += step;
            moved = moved.max(step.abs());
        }
        if moved <= STILL {
            break;
        }
    }
    let most = field.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = field.iter().map(|a| exp(a - most)).collect();
    let all: f64 = weights.iter().sum();
    Ok(weights.into_iter().map(|w| w / all).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of 0…1, the same in every run.
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    #[test]
    fn the_field_that_voxels_were_drawn_with_is_found() {
        let (k, n) = (4, 60_000);
        let mut random = random(7);
        for coupling in [0.0, 0.5, 1.5] {
            let truth: [f64; 4] = [0.5, 0.3, 0.15, 0.05];
            let (mut own, mut neighbours) = (vec![0.0; k * n], vec![0.0_f64; k * n]);
            for (own, neighbours) in own.chunks_exact_mut(k).zip(neighbours.chunks_exact_mut(k)) {
                for _ in 0..6 {
                    neighbours[(random() * k as f64) as usize] += coupling;
                }
                let odds: Vec<f64> = truth.iter().zip(&*neighbours).map(|(w, n)| w * n.exp()).collect();
                let mut at = random() * odds.iter().sum::<f64>();
                let drawn = odds.iter().position(|odds| {
                    at -= odds;
                    at <= 0.0
                });
                own[drawn.unwrap_or(0)] = 1.0;
            }
            let found = climb(&[0.25; 4], &own, &neighbours, &Exec::default()).unwrap();
            for (found, truth) in found.iter().zip(truth) {
                assert!((found / truth).ln().abs() < 0.08, "{coupling}: {found} {truth}");
            }
        }
    }

    #[test]
    fn without_couplings_the_field_is_the_shares_and_what_never_occurs_keeps_its_weight() {
        let own = [1.0, 0.0, 0.0, 0.5, 0.5, 0.0, 1.0, 0.0, 0.0, 0.5, 0.5, 0.0];
        let found = climb(&[0.5, 0.4, 0.1], &own, &[0.0; 12], &Exec::default()).unwrap();
        assert!((found[0] / found[1] - 3.0).abs() < 1e-3, "{found:?}");
        assert!(found.iter().all(|w| *w > 0.0) && (found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let found = climb(&[0.5, 0.5], &[1.0, 0.0], &[1e6, 0.0], &Exec::default()).unwrap();
        assert!(found.iter().all(|w| w.is_finite()), "{found:?}");
    }
}
