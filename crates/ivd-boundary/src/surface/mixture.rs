//! Two values and what lies between them: by which a border that is blurred over several voxels is told from either side.
//!
//! Without noise a voxel has the value of one side, or one between the two where it holds some of both (partial volume), any of them as often
//! as another. Noise, the same everywhere, is added: normal, or of magnitudes (Rice). The two values, the noise and the three shares are those
//! of the greatest likelihood of the whole volume's histogram (expectation and maximisation). What lies in its first and last bin is only
//! known to be there or beyond: values that were cut off don't move the two.

use super::bessel::{bessel_ratio, ln_scaled_bessel};
use super::look::BINS;
use super::model::{LEAST_PROBABILITY, LEAST_SPREAD};

/// Noise on a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Noise {
    Gaussian,
    Rician,
}

/// Values of the two sides, the noise and how much there is of either side and between (units of the range).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mixture {
    noise: Noise,
    /// Lower one first.
    values: [f64; 2],
    variance: f64,
    /// Of the lower value, of the higher one, of those between.
    shares: [f64; 3],
    /// Whether the lower one is held at 0.
    is_dark: bool,
}

/// Steps between the two values.
const BETWEEN: usize = 8;
/// The two values and the steps between.
const STATES: usize = BETWEEN + 2;
/// Bins beyond either end of the range in which values lie that were cut off.
const BEYOND: usize = BINS / 2;
const ROUNDS: usize = 100;
/// Gain in likelihood (nats a voxel) by which a round must improve.
const GAIN: f64 = 1e-7;
/// Share of the voxels that may have any value, metal or a dead detector: they say nothing of the two.
const OUTLIERS: f64 = 1e-3;
/// Gain (nats a voxel) for which a background of magnitudes has a signal. Below, weak signals and none can't be told apart, while a
/// background without any is what air in a magnetic resonance is.
const SIGNAL: f64 = 5e-3;

/// The share of the way from the lower value to the higher one.
fn part(state: usize) -> f64 {
    match state {
        0 => 0.0,
        s if s > BETWEEN => 1.0,
        s => (s as f64 - 0.5) / BETWEEN as f64,
    }
}

impl Mixture {
    /// The likeliest for a histogram; `None` where that has one value, or none.
    pub(super) fn fit(bins: &[f64], noise: Noise) -> Option<Self> {
        let start = Self::by_two_means(bins, noise)?;
        let (found, likelihood) = start.clone().improved(bins);
        if noise == Noise::Gaussian {
            return found.sound();
        }
        let [low, high] = start.values;
        let variance = (0.5 * low * low).max(start.variance);
        let without = Self { values: [0.0, high], variance, is_dark: true, ..start };
        let (dark, likelihood_of_dark) = without.improved(bins);
        let is_better = likelihood > likelihood_of_dark + SIGNAL;
        if is_better { found.sound() } else { dark.sound().or_else(|| found.sound()) }
    }

    /// Itself, where it holds two values.
    fn sound(self) -> Option<Self> {
        let finite = self.values.iter().chain([&self.variance]).all(|v| v.is_finite());
        (finite && self.values[1] - self.values[0] > LEAST_SPREAD).then_some(self)
    }

    /// The two halves of least variance (Otsu 1979).
    fn by_two_means(bins: &[f64], noise: Noise) -> Option<Self> {
        let middle = |i: usize| (i as f64 + 0.5) / BINS as f64;
        let sums = |bins: &[f64], from: usize| {
            bins.iter().enumerate().fold([0.0; 3], |[n, v, vv], (i, count)| {
                let x = middle(from + i);
                [n + count, v + count * x, vv + count * x * x]
            })
        };
        let [n, v, vv] = sums(bins, 0);
        let mut best = None;
        let [mut below, mut sum] = [0.0; 2];
        for (i, count) in bins.iter().enumerate() {
            below += count;
            sum += count * middle(i);
            if below > 0.0 && n - below > 0.5 {
                let gain = (v * below / n - sum).powi(2) / (below * (n - below));
                if best.is_none_or(|(most, _, _)| gain > most) {
                    best = Some((gain, sum / below, (v - sum) / (n - below)));
                }
            }
        }
        let (gain, low, high) = best?;
        let variance = ((vv - v * v / n) / n - gain).max(LEAST_SPREAD * LEAST_SPREAD);
        Some(Self { noise, values: [low, high], variance, shares: [0.4, 0.4, 0.2], is_dark: false })
    }

    /// Middles of the bins and of those beyond.
    fn places(&self) -> Vec<f64> {
        (0..self.before() + BINS + BEYOND)
            .map(|i| (i as f64 + 0.5 - self.before() as f64) / BINS as f64)
            .collect()
    }

    /// Bins below the range: magnitudes have none.
    fn before(&self) -> usize {
        if self.noise == Noise::Gaussian { BEYOND } else { 0 }
    }

    fn value(&self, state: usize) -> f64 {
        self.values[0] + part(state) * (self.values[1] - self.values[0])
    }

    /// Probabilities of the bins, and of those beyond, of a value with noise.
    fn spread(&self, value: f64, places: &[f64]) -> Vec<f64> {
        let log = |x: f64| {
            let square = -(x - value).powi(2) / (2.0 * self.variance);
            match self.noise {
                Noise::Gaussian => square,
                Noise::Rician => square + x.ln() + ln_scaled_bessel(x * value / self.variance),
            }
        };
        let logs: Vec<f64> = places.iter().map(|&x| log(x)).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut found: Vec<f64> = logs.iter().map(|log| (log - most).exp()).collect();
        let sum: f64 = found.iter().sum();
        for p in &mut found {
            *p /= sum;
        }
        found
    }

    /// Of the range's bins, where what lies beyond counts to the ends.
    fn within(&self, spread: &[f64]) -> Vec<f64> {
        let from = self.before();
        let mut found = spread[from..from + BINS].to_vec();
        found[0] += spread[..from].iter().sum::<f64>();
        found[BINS - 1] += spread[from + BINS..].iter().sum::<f64>();
        found
    }

    /// The likeliest that rounds of expectation and maximisation come to, and the log of its likelihood (nats a voxel).
    fn improved(self, bins: &[f64]) -> (Self, f64) {
        let places = self.places();
        let total: f64 = bins.iter().sum();
        let mut best = (self.clone(), f64::NEG_INFINITY);
        let mut here = self;
        for _ in 0..ROUNDS {
            let (next, likelihood) = here.round(bins, &places, total);
            let gain = likelihood - best.1;
            if likelihood > best.1 {
                best = (here, likelihood);
            }
            if gain.is_nan() || gain < GAIN {
                break;
            }
            here = next;
        }
        best
    }

    /// The likelihood (nats a voxel) of these values, and better ones.
    fn round(&self, bins: &[f64], places: &[f64], total: f64) -> (Self, f64) {
        let [low, high, between] = self.shares;
        let weight = |state: usize| match state {
            0 => low,
            s if s > BETWEEN => high,
            _ => between / BETWEEN as f64,
        };
        let mut joint: Vec<Vec<f64>> = (0..STATES).map(|s| self.spread(self.value(s), places)).collect();
        for (state, row) in joint.iter_mut().enumerate() {
            for p in row.iter_mut() {
                *p *= weight(state);
            }
        }
        let all: Vec<f64> = (0..places.len()).map(|i| joint.iter().map(|row| row[i]).sum()).collect();
        let any = OUTLIERS / BINS as f64;
        let seen: Vec<f64> = self.within(&all).iter().map(|p| (1.0 - OUTLIERS) * p + any).collect();
        let likelihood = bins.iter().zip(&seen).map(|(n, p)| n * p.ln()).sum::<f64>() / total;
        // Voxels per unit of probability at every place.
        let from = self.before();
        let per: Vec<f64> = (0..places.len())
            .map(|i| {
                let bin = i.saturating_sub(from).min(BINS - 1);
                (1.0 - OUTLIERS) * bins[bin] / seen[bin]
            })
            .collect();
        // Of every state: voxels, sum of the values without their noise's turn, sum of squares.
        let (mut counts, mut sums, mut squares) = ([0.0; STATES], [0.0; STATES], 0.0);
        for (state, row) in joint.iter().enumerate() {
            let value = self.value(state);
            for ((p, n), &x) in row.iter().zip(&per).zip(places) {
                let voxels = p * n;
                let along = match self.noise {
                    Noise::Gaussian => x,
                    Noise::Rician => x * bessel_ratio(x * value / self.variance),
                };
                counts[state] += voxels;
                sums[state] += voxels * along;
                squares += voxels * x * x;
            }
        }
        // The line through the states' values of least squares.
        let moment = |of: &dyn Fn(usize) -> f64| (0..STATES).map(of).sum::<f64>();
        let n = moment(&|s| counts[s]);
        let [s, ss] = [moment(&|s| part(s) * counts[s]), moment(&|s| part(s).powi(2) * counts[s])];
        let [y, sy] = [moment(&|s| sums[s]), moment(&|s| part(s) * sums[s])];
        let mut slope = (n * sy - s * y) / (n * ss - s * s);
        let mut first = (y - slope * s) / n;
        if self.is_dark || (self.noise == Noise::Rician && first < 0.0) {
            (first, slope) = (0.0, sy / ss);
        }
        if slope < 0.0 {
            (first, slope) = (y / n, 0.0);
        }
        let next = Self { values: [first, first + slope], ..self.clone() };
        let rest = moment(&|s| next.value(s) * (next.value(s) * counts[s] - 2.0 * sums[s]));
        let dimensions = if self.noise == Noise::Rician { 2.0 } else { 1.0 };
        let variance = ((squares + rest) / (dimensions * n)).max(LEAST_SPREAD * LEAST_SPREAD);
        let between = (1..=BETWEEN).map(|s| counts[s]).sum::<f64>();
        (
            Self { variance, shares: [counts[0], counts[STATES - 1], between].map(|c| c / n), ..next },
            likelihood,
        )
    }

    /// −ln of the probability of every bin on the side of the lower value and on that of the higher one.
    ///
    /// Either side has its own value and the half of what lies between that is nearer to it, as if there were as much of either value as of the
    /// rarer one: how much there is far from the border tells nothing about where that runs. A voxel that is half and half costs as much on
    /// either side in the mean.
    pub(super) fn costs(&self) -> [Vec<f64>; 2] {
        let places = self.places();
        let of = |value: f64| self.within(&self.spread(value, &places));
        let [low, high, between] = self.shares;
        let mixed = between / (between + 2.0 * low.min(high)).max(f64::MIN_POSITIVE);
        let side = |own: usize, near: std::ops::RangeInclusive<usize>| {
            let mut found: Vec<f64> = of(self.value(own)).iter().map(|p| (1.0 - mixed) * p).collect();
            for state in near {
                for (all, p) in found.iter_mut().zip(of(self.value(state))) {
                    *all += 2.0 * mixed / BETWEEN as f64 * p;
                }
            }
            found.iter().map(|p| -p.max(LEAST_PROBABILITY).ln()).collect::<Vec<f64>>()
        };
        let mut sides = [side(0, 1..=BETWEEN / 2), side(STATES - 1, BETWEEN / 2 + 1..=BETWEEN)];
        let half = of(0.5 * (self.values[0] + self.values[1]));
        let [lower, higher] =
            [0, 1].map(|i: usize| sides[i].iter().zip(&half).map(|(c, p)| c * p).sum::<f64>());
        let middle = 0.5 * (lower - higher);
        for cost in &mut sides[0] {
            *cost -= middle;
        }
        for cost in &mut sides[1] {
            *cost += middle;
        }
        sides
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::noise;

    use super::*;

    fn histogram(mixture: &Mixture) -> Vec<f64> {
        let places = mixture.places();
        let [low, high, between] = mixture.shares;
        // Finer than the fit's own steps.
        let fine = 64;
        let mut found = vec![0.0; BINS];
        let mut add = |value: f64, share: f64| {
            let spread = mixture.within(&mixture.spread(value, &places));
            found.iter_mut().zip(spread).for_each(|(n, p)| *n += 1e6 * share * p);
        };
        let [a, b] = mixture.values;
        add(a, low);
        add(b, high);
        (0..fine).for_each(|i| {
            add(a + (b - a) * (f64::from(i) + 0.5) / f64::from(fine), between / f64::from(fine));
        });
        found
    }

    #[test]
    fn a_mixture_is_found_again_though_half_of_its_brighter_values_are_cut_off() {
        for (noise, values, deviation) in [
            (Noise::Gaussian, [0.2, 0.8], 0.02),
            (Noise::Gaussian, [0.2, 0.8], 0.1),
            (Noise::Gaussian, [0.0, 1.0], 0.15),
            (Noise::Rician, [0.0, 1.0], 0.05),
            (Noise::Rician, [0.0, 1.0], 0.2),
            (Noise::Rician, [0.3, 1.0], 0.05),
        ] {
            for shares in [[0.8, 0.1, 0.1], [0.3, 0.5, 0.2], [0.5, 0.5, 0.0]] {
                let truth =
                    Mixture { noise, values, variance: deviation * deviation, shares, is_dark: false };
                let found = Mixture::fit(&histogram(&truth), noise).unwrap();
                let close = |a: f64, b: f64, by: f64| (a - b).abs() <= by;
                // Shares are told poorly where much is cut off; it is the two values that place the border.
                let is_close = (0..2).all(|i| close(found.values[i], values[i], 0.02))
                    && close(found.variance.sqrt(), deviation, 0.07 * deviation)
                    && (0..3).all(|i| close(found.shares[i], shares[i], 0.1));
                assert!(is_close, "{found:?} for {truth:?}");
            }
        }
    }

    /// Two values, a tenth of the voxels between them, with noise that is drawn, by what the histogram of a volume would be.
    fn drawn(of: Noise, values: [f64; 2], deviation: f64) -> Vec<f64> {
        let mut bins = vec![0.0; BINS];
        for i in 0..300_000 {
            let [u, v, part] = [0, 1, 2].map(|seed| noise::unit(seed, i).max(1e-300));
            let share = match i % 10 {
                0..=5 => 0.0,
                6..=8 => 1.0,
                _ => part,
            };
            let value = values[0] + share * (values[1] - values[0]);
            let (length, angle) = ((-2.0 * u.ln()).sqrt() * deviation, std::f64::consts::TAU * v);
            let along = value + length * angle.cos();
            let seen = if of == Noise::Rician { along.hypot(length * angle.sin()) } else { along };
            bins[((seen * BINS as f64) as usize).min(BINS - 1)] += 1.0;
        }
        bins
    }

    #[test]
    fn values_that_are_neither_dont_move_the_two() {
        for (noise, values, deviation) in [
            (Noise::Gaussian, [0.05, 0.3], 0.002),
            (Noise::Gaussian, [0.05, 0.3], 0.01),
            (Noise::Gaussian, [0.2, 0.5], 0.05),
            (Noise::Rician, [0.0, 0.3], 0.01),
            (Noise::Rician, [0.1, 0.5], 0.05),
        ] {
            for outliers in [0.0, 3.0, 5.0, 40.0, 300.0] {
                let mut bins = drawn(noise, values, deviation);
                bins[BINS - 1] += outliers;
                let found = Mixture::fit(&bins, noise).unwrap();
                // A bin is 0.004 wide.
                let is_close = (0..2).all(|i| (found.values[i] - values[i]).abs() <= 0.005 + 0.1 * deviation)
                    && (found.variance.sqrt() - deviation).abs() <= 0.002 + 0.1 * deviation;
                assert!(is_close, "{found:?} for {values:?}, {deviation}, {outliers} outliers");
            }
        }
    }

    #[test]
    fn a_voxel_of_half_and_half_costs_as_much_on_either_side() {
        for noise in [Noise::Gaussian, Noise::Rician] {
            let shares = [0.8, 0.1, 0.1];
            let mixture = Mixture { noise, values: [0.0, 1.0], variance: 0.04, shares, is_dark: false };
            let [lower, higher] = mixture.costs();
            let mean = |value: f64| {
                let spread = mixture.within(&mixture.spread(value, &mixture.places()));
                spread.iter().zip(lower.iter().zip(&higher)).map(|(p, (a, b))| p * (a - b)).sum::<f64>()
            };
            assert!(mean(0.5).abs() < 1e-12, "{noise:?}: {}", mean(0.5));
            let rising: Vec<f64> = (0..=20).map(|i| mean(f64::from(i) / 20.0)).collect();
            assert!(rising.windows(2).all(|pair| pair[0] < pair[1]), "{noise:?}: {rising:?}");
        }
    }

    #[test]
    fn one_value_is_no_mixture() {
        let mut bins = vec![0.0; BINS];
        assert_eq!(Mixture::fit(&bins, Noise::Gaussian), None);
        bins[17] = 1000.0;
        assert_eq!(Mixture::fit(&bins, Noise::Rician), None);
    }
}
