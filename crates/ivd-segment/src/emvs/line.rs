//! Expectation and maximisation on intensity alone, over bins: O(bins · K) an iteration, however many voxels there are.

use ivd_core::{Error, Exec, Iteration, parallel};

use super::bins::Bins;
use super::exponential::exp;
use super::mixture::{Component, INTENSITY};

/// Bins that one task takes; sums are joined by these, never by threads.
const TASK: usize = 4096;
/// Bins whose densities stay close to the processor.
const NEAR: usize = 256;

/// What bounds a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) iterations: u64,
    pub(super) tolerance: f64,
    /// Least variance along the axes, in the frame.
    pub(super) floor: [f64; 4],
    /// Added to the variances, in the frame.
    pub(super) added: [f64; 4],
}

/// Where a search ended.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub(super) components: Vec<Component>,
    /// Mean log-likelihood of a voxel, in the frame, of the components.
    pub(super) log_likelihood: f64,
    pub(super) iterations: u64,
    pub(super) converged: bool,
}

/// A normal density on a line: `log density = constant - half · (t - mean)²`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Density {
    pub(super) constant: f64,
    pub(super) half: f64,
    pub(super) mean: f64,
}

impl Density {
    pub(super) fn of(c: &Component) -> Self {
        let variance = c.covariance[INTENSITY][INTENSITY];
        let constant = log_weight(c.weight) - 0.5 * (std::f64::consts::TAU.ln() + variance.ln());
        Self { constant, half: 0.5 / variance, mean: c.mean[INTENSITY] }
    }

    /// Logarithm of weight times density.
    #[inline(always)]
    pub(super) fn log(&self, t: f64) -> f64 {
        let d = t - self.mean;
        self.constant - self.half * (d * d)
    }
}

/// Logarithm of a weight; of none, a number so low that nobody chooses the component.
pub(super) fn log_weight(weight: f64) -> f64 {
    weight.max(1e-300).ln()
}

/// The component of greatest posterior, the first of several.
pub(super) fn likeliest(densities: &[Density], t: f64) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (k, density) in densities.iter().enumerate() {
        let log = density.log(t);
        if log > best.1 {
            best = (k, log);
        }
    }
    best.0
}

/// Sums of a component: responsibility, and with it the deviation from the present mean and its square.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    pub(super) n: f64,
    pub(super) d: f64,
    pub(super) dd: f64,
}

/// Plain EM until the likelihood stands still.
pub(super) fn search(
    bins: &Bins,
    mut components: Vec<Component>,
    limits: &Limits,
    exec: &Exec,
) -> Result<Found, Error> {
    let mut last = f64::NEG_INFINITY;
    for index in 1..=limits.iterations {
        exec.check_cancelled()?;
        let (sums, log_likelihood) = expect(bins, &components);
        exec.observer().iteration(Iteration { method: "emvs", index, value: log_likelihood });
        maximise(&mut components, &sums, bins.total, limits);
        if log_likelihood - last < limits.tolerance && index > 1 {
            let (_, log_likelihood) = expect(bins, &components);
            return Ok(Found { components, log_likelihood, iterations: index, converged: true });
        }
        last = log_likelihood;
    }
    let (_, log_likelihood) = expect(bins, &components);
    let converged = limits.tolerance > 0.0 && log_likelihood - last < limits.tolerance;
    Ok(Found { components, log_likelihood, iterations: limits.iterations, converged })
}

/// The search on coarse bins first, so that few rounds are left for the fine ones.
pub(super) fn search_from_coarse(
    bins: &Bins,
    coarse: Option<&Bins>,
    components: Vec<Component>,
    limits: &Limits,
    exec: &Exec,
) -> Result<Found, Error> {
    let Some(coarse) = coarse else { return search(bins, components, limits, exec) };
    let rough = search(coarse, components, limits, exec)?;
    let left = Limits { iterations: (limits.iterations - rough.iterations).max(2), ..*limits };
    let mut found = search(bins, rough.components, &left, exec)?;
    found.iterations += rough.iterations;
    Ok(found)
}

/// Responsibilities of the present components, summed, and the mean log-likelihood.
pub(super) fn expect(bins: &Bins, components: &[Component]) -> (Vec<Sums>, f64) {
    let densities: Vec<Density> = components.iter().map(Density::of).collect();
    let tasks = bins.len().div_ceil(TASK);
    let task = |i: usize| expect_part(bins, i * TASK..((i + 1) * TASK).min(bins.len()), &densities);
    let parts: Vec<_> = if tasks == 1 { vec![task(0)] } else { parallel::map(tasks, &task) };
    let mut total = (vec![Sums::default(); components.len()], 0.0);
    for (sums, log_likelihood) in parts {
        for (total, part) in total.0.iter_mut().zip(sums) {
            total.n += part.n;
            total.d += part.d;
            total.dd += part.dd;
        }
        total.1 += log_likelihood;
    }
    (total.0, total.1 / bins.total)
}

/// Mean entropy of a voxel's posteriors (natural logarithm): 0 where every voxel belongs to one component alone.
pub(super) fn entropy(bins: &Bins, components: &[Component]) -> f64 {
    let densities: Vec<Density> = components.iter().map(Density::of).collect();
    let mut logs = vec![0.0; densities.len()];
    let mut total = 0.0;
    for ((t, spread), n) in bins.value.iter().zip(&bins.spread).zip(&bins.count) {
        for (log, density) in logs.iter_mut().zip(&densities) {
            *log = density.log(*t) - density.half * spread;
        }
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let all: f64 = logs.iter().map(|log| (log - most).exp()).sum();
        // Σ r (ln Σ e − ln e) with r = e / Σ e.
        let own: f64 = logs.iter().map(|log| (log - most).exp() / all * (all.ln() - (log - most))).sum();
        total += n * own;
    }
    total / bins.total
}

fn expect_part(bins: &Bins, range: std::ops::Range<usize>, densities: &[Density]) -> (Vec<Sums>, f64) {
    let mut sums = vec![Sums::default(); densities.len()];
    let mut logs = vec![[0.0; NEAR]; densities.len()];
    let mut log_likelihood = 0.0;
    for from in range.clone().step_by(NEAR) {
        let span = from..(from + NEAR).min(range.end);
        let (value, spread, count) =
            (&bins.value[span.clone()], &bins.spread[span.clone()], &bins.count[span]);
        let mut most = [f64::NEG_INFINITY; NEAR];
        for (logs, density) in logs.iter_mut().zip(densities) {
            for (((log, most), t), spread) in logs.iter_mut().zip(&mut most).zip(value).zip(spread) {
                let d = t - density.mean;
                *log = density.constant - density.half * (d * d + spread);
                *most = if *log > *most { *log } else { *most };
            }
        }
        let mut all = [0.0; NEAR];
        for logs in &mut logs {
            for ((log, most), all) in logs.iter_mut().zip(&most).zip(&mut all).take(value.len()) {
                *log = exp(*log - *most);
                *all += *log;
            }
        }
        for ((all, most), n) in all.iter_mut().zip(&most).zip(count) {
            log_likelihood += n * (most + all.ln());
            *all = n / *all;
        }
        for ((logs, density), sums) in logs.iter().zip(densities).zip(&mut sums) {
            for (((share, all), t), spread) in logs.iter().zip(&all).zip(value).zip(spread) {
                let (r, d) = (share * all, t - density.mean);
                sums.n += r;
                sums.d += r * d;
                sums.dd += r * (d * d + spread);
            }
        }
    }
    (sums, log_likelihood)
}

/// Weights, means and variances of greatest expected likelihood. A component that nothing belongs to stays where it is.
pub(super) fn maximise(components: &mut [Component], sums: &[Sums], total: f64, limits: &Limits) {
    for (c, sums) in components.iter_mut().zip(sums) {
        c.weight = sums.n / total;
        if sums.n > 1e-200 * total {
            let off = sums.d / sums.n;
            c.mean[INTENSITY] += off;
            let variance = (sums.dd / sums.n - off * off).max(0.0) + limits.added[INTENSITY];
            c.covariance[INTENSITY][INTENSITY] = variance.max(limits.floor[INTENSITY]);
        }
    }
}
