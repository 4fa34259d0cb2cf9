//! The external field of coupled voxels: how much each component is preferred where the neighbours say nothing.
//!
//! EM's weights say how frequent the components are. Among coupled voxels the neighbours say most of that already, so that
//! weights and couplings together say it twice, and rare components vanish. The field that is left to a voxel alone is found
//! by the coding method (Besag 1974): given the black voxels, the red ones are independent of each other, and the likeliest
//! field is the one with which the model expects of every component the share that the red voxels have of it. The conditional
//! likelihood is concave. Its matrix of second derivatives has rows of sum 0, so that twice its diagonal is at least as steep:
//! steps by that diagonal (Newton's, one component at a time) climb, and fast also where neighbours leave little to choose.

use ivd_core::{Error, Exec};

use super::exponential::exp;
use super::field::Field;

/// Shares that are looked at, about: the field is K numbers, and needs no more.
const SAMPLE: usize = 1 << 20;
/// Most rounds.
const ROUNDS: usize = 100;
/// The climb ends where no logarithm changes by more.
const STILL: f64 = 1e-4;
/// Largest change of a logarithm in a round: farther away the diagonal says little.
const LARGEST_STEP: f64 = 1.0;

/// Weights, of sum 1, that take the place of `weights` among coupled voxels. Components that no voxel of the sample has a
/// share of keep theirs.
pub(super) fn field(
    weights: &[f64],
    distributions: &Field,
    couplings: [f64; 3],
    exec: &Exec,
) -> Result<Vec<f64>, Error> {
    let (own, neighbours) = distributions.red_sample(SAMPLE / weights.len(), couplings);
    climb(weights, &own, &neighbours, exec)
}

/// The likeliest field of voxels with the shares `own`, which their `neighbours` pull at; shape `(voxels)[K]`, both.
fn climb(weights: &[f64], own: &[f64], neighbours: &[f64], exec: &Exec) -> Result<Vec<f64>, Error> {
    let k = weights.len();
    let mut shares = vec![0.0; k];
    for voxel in own.chunks_exact(k) {
        shares.iter_mut().zip(voxel).for_each(|(sum, q)| *sum += q);
    }
    // What isn't in the sample takes no part.
    let log = |(weight, share): (&f64, &f64)| {
        if *share > 0.0 { weight.max(f64::MIN_POSITIVE).ln() } else { f64::NEG_INFINITY }
    };
    let mut field: Vec<f64> = weights.iter().zip(&shares).map(log).collect();
    let mut row = vec![0.0; k];
    for _ in 0..ROUNDS {
        exec.check_cancelled()?;
        let (mut expected, mut steep) = (vec![0.0; k], vec![0.0; k]);
        for voxel in neighbours.chunks_exact(k) {
            let most = voxel.iter().zip(&field).fold(f64::NEG_INFINITY, |most, (n, a)| (n + a).max(most));
            let mut all = 0.0;
            for ((e, n), a) in row.iter_mut().zip(voxel).zip(&field) {
                *e = exp(n + a - most);
                all += *e;
            }
            for ((sum, steep), e) in expected.iter_mut().zip(&mut steep).zip(&row) {
                let p = e / all;
                *sum += p;
                *steep += p * (1.0 - p);
            }
        }
        let mut moved = 0.0_f64;
        let found = field.iter_mut().zip(&shares).zip(expected.iter().zip(&steep));
        for ((a, share), (expected, steep)) in found.filter(|((_, share), _)| **share > 0.0) {
            let step = (share - expected) / (2.0 * steep).max(f64::MIN_POSITIVE);
            let step = step.clamp(-LARGEST_STEP, LARGEST_STEP);
            *a += step;
            moved = moved.max(step.abs());
        }
        if moved <= STILL {
            break;
        }
    }
    let most = field.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let found: Vec<f64> =
        field.iter().map(|a| if *a > f64::NEG_INFINITY { exp(a - most) } else { 0.0 }).collect();
    let all: f64 = found.iter().sum();
    let apart: f64 = weights.iter().zip(&shares).filter(|(_, share)| **share == 0.0).map(|(w, _)| w).sum();
    let weight = |((found, share), weight): ((&f64, &f64), &f64)| {
        if *share > 0.0 { found / all * (1.0 - apart).max(f64::MIN_POSITIVE) } else { *weight }
    };
    Ok(found.iter().zip(&shares).zip(weights).map(weight).collect())
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
    fn components_have_the_shares_that_the_field_expects_though_neighbours_agree() {
        let (k, n) = (3, 30_000);
        let mut random = random(3);
        // All six neighbours of one kind, and one voxel in some hundred unlike them.
        let truth = [0.6, 0.3, 0.1];
        let (mut own, mut neighbours) = (vec![0.0; k * n], vec![0.0; k * n]);
        for (own, neighbours) in own.chunks_exact_mut(k).zip(neighbours.chunks_exact_mut(k)) {
            neighbours[(random() * k as f64) as usize] = 6.0;
            let odds: Vec<f64> = (0..k).map(|j| truth[j] * f64::exp(neighbours[j])).collect();
            let mut at = random() * odds.iter().sum::<f64>();
            let drawn = odds.iter().position(|odds| {
                at -= odds;
                at <= 0.0
            });
            own[drawn.unwrap_or(0)] = 1.0;
        }
        let found = climb(&[1.0 / 3.0; 3], &own, &neighbours, &Exec::default()).unwrap();
        let mut off = [0.0_f64; 3];
        for (own, neighbours) in own.chunks_exact(k).zip(neighbours.chunks_exact(k)) {
            let odds: Vec<f64> = found.iter().zip(neighbours).map(|(w, n)| w * n.exp()).collect();
            let all: f64 = odds.iter().sum();
            (0..k).for_each(|j| off[j] += own[j] - odds[j] / all);
        }
        assert!(off.iter().all(|off| off.abs() < 0.1), "{found:?} {off:?}");
        for (found, truth) in found.iter().zip(truth) {
            assert!((found / truth).ln().abs() < 0.4, "{found} {truth}");
        }
    }

    #[test]
    fn without_couplings_the_field_is_the_shares_and_what_never_occurs_keeps_its_weight() {
        let own = [1.0, 0.0, 0.0, 0.5, 0.5, 0.0, 1.0, 0.0, 0.0, 0.5, 0.5, 0.0];
        let found = climb(&[0.5, 0.4, 0.1], &own, &[0.0; 12], &Exec::default()).unwrap();
        assert!((found[0] / found[1] - 3.0).abs() < 1e-3 && found[2] == 0.1, "{found:?}");
        assert!(found.iter().all(|w| *w > 0.0) && (found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let found = climb(&[0.5, 0.5], &[1.0, 0.0], &[1e6, 0.0], &Exec::default()).unwrap();
        assert!(found.iter().all(|w| w.is_finite()), "{found:?}");
    }
}
