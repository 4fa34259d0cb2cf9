//! What values inside and outside are expected to be, and what a voxel costs on either side.

use super::bessel::{ln_scaled_bessel, scaled_bessel_1};
use super::look::{BINS, Tally};
use super::mixture::Mixture;
use super::params::{DataTerm, Distribution};

/// How values are expected, by side.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Model {
    inside: Side,
    outside: Side,
}

/// What a value costs on one side.
#[derive(Debug, Clone, PartialEq)]
enum Side {
    /// `weight · (value − mean)² + offset`.
    Quadratic { mean: f64, weight: f64, offset: f64 },
    /// By bin, at the bins' middles.
    Table(Vec<f64>),
}

/// Least spread of a Gaussian, in units of the range: half a step of 8 bits.
pub(super) const LEAST_SPREAD: f64 = 1.0 / 512.0;
/// Least probability of a bin: what nobody has seen is improbable, not impossible.
pub(super) const LEAST_PROBABILITY: f64 = 1e-4;

impl Side {
    fn fit(tally: &Tally, data: DataTerm, distribution: Distribution) -> Self {
        if matches!(data, DataTerm::Means | DataTerm::Local) {
            return Self::Quadratic { mean: tally.mean(), weight: 1.0, offset: 0.0 };
        }
        match distribution {
            Distribution::Histogram => Self::Table(smoothed(&tally.bins)),
            Distribution::Gaussian => {
                let variance = tally.variance().max(LEAST_SPREAD * LEAST_SPREAD);
                Self::Quadratic { mean: tally.mean(), weight: 0.5 / variance, offset: 0.5 * variance.ln() }
            }
            Distribution::Rician => Self::Table(rician(tally)),
            Distribution::GaussianMixture | Distribution::RicianMixture => {
                unreachable!("a mixture is of both sides: `Model::mixed`")
            }
        }
    }

    fn cost(&self, value: f64) -> f64 {
        match self {
            Self::Quadratic { mean, weight, offset } => weight * (value - mean).powi(2) + offset,
            Self::Table(costs) => {
                let at = (value * BINS as f64 - 0.5).clamp(0.0, (BINS - 1) as f64);
                let low = (at as usize).min(BINS - 2);
                let t = at - low as f64;
                costs[low] * (1.0 - t) + costs[low + 1] * t
            }
        }
    }

    /// Of all values of a set.
    fn total(&self, tally: &Tally) -> f64 {
        match self {
            Self::Quadratic { mean, weight, offset } => {
                weight * (tally.squares - 2.0 * mean * tally.sum + mean * mean * tally.count)
                    + offset * tally.count
            }
            Self::Table(costs) => costs.iter().zip(&tally.bins).map(|(cost, n)| cost * n).sum(),
        }
    }
}

impl Model {
    /// Of values that stay: those inside are spread normally, all others as they are.
    pub(super) fn frozen(inside: &Tally, others: &Tally) -> Self {
        Self {
            inside: Side::Table(normal(inside)),
            outside: Side::fit(others, DataTerm::Likelihood, Distribution::Histogram),
        }
    }

    /// Of two values and what lies between; the inside is the side of the higher one if it is brighter. Voxels cost `tilt` more inside.
    pub(super) fn mixed(mixture: &Mixture, is_brighter: bool, tilt: f64) -> Self {
        let [mut inside, mut outside] = mixture.costs();
        if is_brighter {
            std::mem::swap(&mut inside, &mut outside);
        }
        for cost in &mut inside {
            *cost += 0.5 * tilt;
        }
        for cost in &mut outside {
            *cost -= 0.5 * tilt;
        }
        Self { inside: Side::Table(inside), outside: Side::Table(outside) }
    }

    pub(super) fn fit(inside: &Tally, outside: &Tally, data: DataTerm, distribution: Distribution) -> Self {
        Self {
            inside: Side::fit(inside, data, distribution),
            outside: Side::fit(outside, data, distribution),
        }
    }

    /// What a voxel of a value costs inside, less what it costs outside.
    pub(super) fn force(&self) -> Force {
        if let (
            Side::Quadratic { mean: a, weight: p, offset: s },
            Side::Quadratic { mean: b, weight: q, offset: t },
        ) = (&self.inside, &self.outside)
        {
            return Force::Quadratic(
                [p * a * a - q * b * b + s - t, 2.0 * (q * b - p * a), p - q].map(|v| v as f32),
            );
        }
        let at = |i: usize| (i as f64 + 0.5) / BINS as f64;
        Force::Table((0..BINS).map(|i| (self.inside.cost(at(i)) - self.outside.cost(at(i))) as f32).collect())
    }

    /// What the values of two sets cost.
    pub(super) fn cost(&self, inside: &Tally, outside: &Tally) -> f64 {
        self.inside.total(inside) + self.outside.total(outside)
    }
}

/// Cost of a voxel inside, less that outside, by value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Force {
    /// Coefficients of 1, the value and its square.
    Quadratic([f32; 3]),
    /// At the bins' middles.
    Table(Vec<f32>),
}

impl Force {
    /// With the sides the other way round.
    pub(super) fn negated(&self) -> Self {
        match self {
            Self::Quadratic(coefficients) => Self::Quadratic(coefficients.map(|c| -c)),
            Self::Table(table) => Self::Table(table.iter().map(|force| -force).collect()),
        }
    }

    /// Mean over the values of a set.
    pub(super) fn mean(&self, tally: &Tally) -> f64 {
        let sum = match self {
            Self::Quadratic([a, b, c]) => {
                f64::from(*a) * tally.count + f64::from(*b) * tally.sum + f64::from(*c) * tally.squares
            }
            Self::Table(table) => table.iter().zip(&tally.bins).map(|(f, n)| f64::from(*f) * n).sum(),
        };
        sum / tally.count
    }

    /// At every value; 0 where there is none.
    pub(super) fn of(&self, values: &[f32], out: &mut [f32]) {
        match self {
            Self::Quadratic([a, b, c]) => {
                for (out, &v) in out.iter_mut().zip(values) {
                    *out = if v.is_nan() { 0.0 } else { a + v * (b + v * c) };
                }
            }
            Self::Table(table) => {
                for (out, &v) in out.iter_mut().zip(values) {
                    let at = (v * BINS as f32 - 0.5).clamp(0.0, (BINS - 1) as f32);
                    let low = (at as usize).min(BINS - 2);
                    let t = at - low as f32;
                    *out = if v.is_nan() { 0.0 } else { table[low] * (1.0 - t) + table[low + 1] * t };
                }
            }
        }
    }
}

/// −ln of the share of a normal distribution with a set's moments in every bin, as far as anything is improbable.
fn normal(tally: &Tally) -> Vec<f64> {
    let variance = tally.variance().max(LEAST_SPREAD * LEAST_SPREAD);
    let all = 0.5 * (std::f64::consts::TAU * variance).ln() + (BINS as f64).ln();
    (0..BINS)
        .map(|i| {
            let value = (i as f64 + 0.5) / BINS as f64;
            (0.5 * (value - tally.mean()).powi(2) / variance + all).min(-LEAST_PROBABILITY.ln())
        })
        .collect()
}

/// −ln of a histogram, smoothed by a Gaussian of the width that its count suggests (Silverman's rule).
fn smoothed(bins: &[f64]) -> Vec<f64> {
    let count: f64 = bins.iter().sum();
    if count <= 0.0 {
        return vec![0.0; BINS];
    }
    let mean = bins.iter().enumerate().map(|(i, n)| i as f64 * n).sum::<f64>() / count;
    let variance = bins.iter().enumerate().map(|(i, n)| (i as f64 - mean).powi(2) * n).sum::<f64>() / count;
    let width = (1.06 * variance.sqrt() * count.powf(-0.2)).clamp(1.0, BINS as f64 / 16.0);
    let reach = (3.0 * width).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach).map(|d| (-0.5 * (d as f64 / width).powi(2)).exp()).collect();
    let total: f64 = weights.iter().sum();
    (0..BINS as i64)
        .map(|i| {
            let mut sum = 0.0;
            for (d, weight) in (-reach..=reach).zip(&weights) {
                sum += weight * bins[(i + d).clamp(0, BINS as i64 - 1) as usize];
            }
            -(sum / (total * count)).max(LEAST_PROBABILITY).ln()
        })
        .collect()
}

/// −ln of the Rician density with a set's first two moments (Koay & Basser 2006: the signal and the noise that give them), at the bins'
/// middles. A set is read as magnitudes from the range's lower end on.
fn rician(tally: &Tally) -> Vec<f64> {
    let mean = tally.mean().max(1e-6);
    let variance = tally.variance().max(LEAST_SPREAD * LEAST_SPREAD);
    // E[m²] = ν² + 2σ²: with σ² from the moments where the signal is strong, and never so large that ν² < 0.
    let second = variance + mean * mean;
    let mut noise = variance;
    for _ in 0..50 {
        let signal = (second - 2.0 * noise).max(0.0);
        // Variance of the Rician of this signal and noise, over the noise's.
        let share = 2.0 + signal / noise - (mean_over_noise(signal / noise)).powi(2);
        noise = (variance / share.clamp(0.4, 1.0)).min(0.5 * second);
    }
    let signal = (second - 2.0 * noise).max(0.0).sqrt();
    (0..BINS)
        .map(|i| {
            let m = (i as f64 + 0.5) / BINS as f64;
            let log = (m / noise).ln() - (m - signal).powi(2) / (2.0 * noise)
                + ln_scaled_bessel(m * signal / noise);
            -(log - (BINS as f64).ln()).max(LEAST_PROBABILITY.ln())
        })
        .collect()
}

/// Mean of a Rician of noise 1 and squared signal `t`.
fn mean_over_noise(t: f64) -> f64 {
    // √(π/2) e^(−x) ((1 + 2x) I₀(x) + 2x I₁(x)) with x = t/4.
    let x = t / 4.0;
    let i0 = ln_scaled_bessel(x).exp();
    let i1 = scaled_bessel_1(x);
    (std::f64::consts::PI / 2.0).sqrt() * ((1.0 + 2.0 * x) * i0 + 2.0 * x * i1)
}
