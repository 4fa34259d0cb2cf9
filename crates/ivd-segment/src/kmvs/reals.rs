//! The optimum over values that are too many for a histogram: bounds first, then a closer look where they allow a cut.
//!
//! The sample is sorted. A cut may lie at some *borders* between values, or somewhere inside some *stretches* of values.
//! Using borders alone gives a partition, so an upper bound. Leaving out a stretch wherever a cut falls inside it only
//! removes inertia, so the same program with stretches gives a lower bound; and, run from both ends, a lower bound for
//! every single place. Places whose bound exceeds the upper bound can't hold a cut of the optimum and are dropped; the other
//! stretches are divided. When none is left the partition is the global optimum.

use ivd_core::{Error, Exec, Iteration, Scalar, parallel};

use super::optimal;
use super::sorted::{Moments, Sorted};
use crate::groups::{Group, Partition};

/// Up to this many distinct values, each of them is a border from the start.
const FEW: usize = 4096;
/// Stretches to begin with. The stretches that survive a round grow as its square root.
const STRETCHES: usize = 2048;
/// Stretches after a division, about; beyond [`PLACES`] the search stops and states its gap.
const DIVIDED: usize = 1 << 15;
const PLACES: usize = 1 << 20;
const ROUNDS: u64 = 40;
/// Rounding of the bounds, relative to the inertia.
const ROUNDING: f64 = 1e-12;

/// Where a cut may be: at a border (`a == b`), or inside the values `a … b - 1`.
#[derive(Debug, Clone, Copy)]
struct Place {
    a: usize,
    b: usize,
    at_a: Moments,
    at_b: Moments,
}

/// The partition of least inertia of an ascending sample into `k` groups, or into as many as there are values.
pub(super) fn partition<T: Scalar>(values: &[T], k: usize, exec: &Exec) -> Result<Partition, Error> {
    if values.is_empty() {
        return Ok(Partition::empty());
    }
    let sorted = Sorted::new(values);
    let few = few_borders(&sorted, FEW.max(k + 1));
    let k = few.as_ref().map_or(k, |borders| k.min(borders.len() - 1));
    let mut places = match few {
        Some(borders) => at(&sorted, &borders.into_iter().map(|i| [i, i]).collect::<Vec<_>>()),
        None => divide(&sorted, 0, values.len(), STRETCHES),
    };
    let mut round = 0;
    loop {
        exec.check_cancelled()?;
        round += 1;
        let borders: Vec<Place> = places.iter().copied().filter(|p| p.a == p.b).collect();
        let found = optimal::rows(borders.len(), k, true, &|p, q| inertia(&borders[p], &borders[q]));
        let upper = found.cost[k - 1][borders.len() - 1];
        exec.observer().iteration(Iteration { method: "kmvs", index: round, value: upper });
        let cuts: Vec<usize> = found.cuts(k).into_iter().map(|c| borders[c].a).collect();
        let open = borders.len() < places.len();
        let (kept, lower) = if open { prune(&places, k, upper, &cuts) } else { (Vec::new(), upper) };
        let certified = kept.iter().all(|p| p.a == p.b);
        if certified || round == ROUNDS || places.len() > PLACES {
            let gap = if certified { 0.0 } else { (upper - lower).max(0.0) };
            return Ok(describe(&sorted, &cuts, gap, round, certified));
        }
        places = closer(&sorted, &kept);
    }
}

/// Inertia of what lies between two places.
#[inline]
fn inertia(from: &Place, to: &Place) -> f64 {
    if to.a <= from.b { 0.0 } else { from.at_b.inertia(to.at_a, to.a - from.b) }
}

/// The places that may hold a cut of the optimum, and the lower bound on its inertia.
fn prune(places: &[Place], k: usize, upper: f64, cuts: &[usize]) -> (Vec<Place>, f64) {
    let last = places.len() - 1;
    let forward = optimal::rows(places.len(), k, false, &|p, q| inertia(&places[p], &places[q])).cost;
    let backward =
        optimal::rows(places.len(), k, false, &|p, q| inertia(&places[last - q], &places[last - p])).cost;
    let bound = |t: usize| {
        (1..k).map(|j| forward[j - 1][t] + backward[k - j - 1][last - t]).fold(f64::INFINITY, f64::min)
    };
    let kept = (0..places.len())
        .filter(|&t| {
            let place = &places[t];
            if place.a < place.b {
                bound(t) < upper * (1.0 - ROUNDING)
            } else {
                let fixed = t == 0 || t == last || cuts.binary_search(&place.a).is_ok();
                fixed || bound(t) <= upper * (1.0 + ROUNDING)
            }
        })
        .map(|t| places[t])
        .collect();
    (kept, forward[k - 1][last])
}

/// The kept borders, and the kept stretches divided.
fn closer<T: Scalar>(sorted: &Sorted<T>, kept: &[Place]) -> Vec<Place> {
    let stretches = kept.iter().filter(|p| p.a < p.b).count();
    let parts = (DIVIDED / stretches.max(1)).clamp(2, 64);
    let mut spans = parallel::map(kept.len(), &|i| {
        let p = &kept[i];
        if p.a == p.b { vec![[p.a, p.b]] } else { spans(sorted, p.a, p.b, parts) }
    })
    .concat();
    spans.sort_unstable();
    spans.dedup();
    at(sorted, &spans)
}

/// The stretch `a … b - 1` with its ends, in about `parts` parts.
fn divide<T: Scalar>(sorted: &Sorted<T>, a: usize, b: usize, parts: usize) -> Vec<Place> {
    let mut spans = spans(sorted, a, b, parts);
    spans.extend([[a, a], [b, b]]);
    spans.sort_unstable();
    spans.dedup();
    at(sorted, &spans)
}

/// Borders inside a stretch at about equal counts, each where the value changes, and the stretches between them that
/// hold more than one value.
fn spans<T: Scalar>(sorted: &Sorted<T>, a: usize, b: usize, parts: usize) -> Vec<[usize; 2]> {
    let mut borders = vec![a];
    for part in 1..parts {
        let target = a + ((b - a) as u128 * part as u128 / parts as u128) as usize;
        if target > a {
            // The change at or after the target, and the one before its run: a run never hides the border on its low side.
            let change = sorted.next_change(target - 1);
            let run = if change > target { start_of_run(sorted, target, a) } else { change };
            borders.extend([run, change].into_iter().filter(|c| (a + 1..b).contains(c)));
        }
    }
    borders.push(b);
    borders.sort_unstable();
    borders.dedup();
    let between = borders.windows(2).map(|w| [w[0], w[1]]).filter(|s| sorted.next_change(s[0]) < s[1]);
    let inner = borders[1..borders.len() - 1].iter().map(|&i| [i, i]);
    between.chain(inner).collect()
}

/// First index at or after `from` that holds the value of index `i - 1`.
fn start_of_run<T: Scalar>(sorted: &Sorted<T>, i: usize, from: usize) -> usize {
    let value = sorted.value(i - 1);
    let (mut low, mut high) = (from, i - 1);
    while low < high {
        let middle = low.midpoint(high);
        if sorted.value(middle) < value { low = middle + 1 } else { high = middle }
    }
    low
}

/// Every border of the sample, its ends included, where the distinct values are at most `limit`.
fn few_borders<T: Scalar>(sorted: &Sorted<T>, limit: usize) -> Option<Vec<usize>> {
    let mut borders = vec![0];
    while *borders.last().expect("holds the first border") < sorted.len() {
        if borders.len() > limit {
            return None;
        }
        borders.push(sorted.next_change(*borders.last().expect("holds the first border")));
    }
    Some(borders)
}

/// Attaches the running sums.
fn at<T: Scalar>(sorted: &Sorted<T>, spans: &[[usize; 2]]) -> Vec<Place> {
    parallel::map(spans.len(), &|i| {
        let [a, b] = spans[i];
        let at_a = sorted.at(a);
        Place { a, b, at_a, at_b: if a == b { at_a } else { sorted.at(b) } }
    })
}

fn describe<T: Scalar>(
    sorted: &Sorted<T>,
    cuts: &[usize],
    gap: f64,
    iterations: u64,
    converged: bool,
) -> Partition {
    let ends: Vec<usize> =
        std::iter::once(0).chain(cuts.iter().copied()).chain(std::iter::once(sorted.len())).collect();
    let groups = ends
        .windows(2)
        .map(|w| {
            let (from, to, n) = (sorted.at(w[0]), sorted.at(w[1]), w[1] - w[0]);
            let range = [sorted.value(w[0]).to_f64(), sorted.value(w[1] - 1).to_f64()];
            let sd = sorted.unscaled((from.inertia(to, n) / n as f64).sqrt());
            // A value that fills a group is its mean, whatever the sums round to.
            let one = range[0] == range[1];
            let mean = sorted.unscaled_mean(from.mean(to, n)).clamp(range[0], range[1]);
            Group {
                range,
                count: n as u64,
                mean,
                sd: if one { 0.0 } else { sd },
                inertia: if one { 0.0 } else { sorted.unscaled(sorted.unscaled(from.inertia(to, n))) },
            }
        })
        .collect();
    Partition { groups, gap: sorted.unscaled(sorted.unscaled(gap)), iterations, converged }
}

#[cfg(test)]
mod tests;
