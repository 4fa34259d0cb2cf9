//! The optimum over a histogram of integers, with every sum exact.

use super::optimal;
use crate::groups::{Group, Partition};
use crate::histogram::Histogram;

/// Running sums over the values of a histogram, relative to its median.
struct Sums {
    shift: i64,
    count: Vec<i128>,
    sum: Vec<i128>,
    squares: Vec<i128>,
}

impl Sums {
    fn new(histogram: &Histogram) -> Self {
        let half = histogram.counts.iter().sum::<u64>() / 2;
        let mut below = 0;
        let median = histogram.counts.iter().position(|n| {
            below += n;
            below > half
        });
        let shift = histogram.values[median.expect("the histogram holds a value")];
        let mut sums = Self { shift, count: vec![0], sum: vec![0], squares: vec![0] };
        let (mut n, mut s, mut q) = (0, 0, 0);
        for (&value, &count) in histogram.values.iter().zip(&histogram.counts) {
            let (x, c) = (i128::from(value - shift), i128::from(count));
            n += c;
            s += c * x;
            q += c * x * x;
            sums.count.push(n);
            sums.sum.push(s);
            sums.squares.push(q);
        }
        sums
    }

    /// Inertia of the values `a … b - 1`: `(n Σx² - (Σx)²) / n`, rounded once.
    #[inline]
    fn inertia(&self, a: usize, b: usize) -> f64 {
        let n = self.count[b] - self.count[a];
        let s = self.sum[b] - self.sum[a];
        let q = self.squares[b] - self.squares[a];
        if n == 0 { 0.0 } else { (n * q - s * s) as f64 / n as f64 }
    }
}

/// The partition of least inertia into `k` groups, or into as many as there are values.
pub(crate) fn partition(histogram: &Histogram, k: usize) -> Partition {
    let values = histogram.values.len();
    let k = k.min(values);
    if k == 0 {
        return Partition::empty();
    }
    let sums = Sums::new(histogram);
    let cuts = optimal::rows(values + 1, k, true, &|p, q| sums.inertia(p, q)).cuts(k);
    let ends: Vec<usize> = std::iter::once(0).chain(cuts).chain(std::iter::once(values)).collect();
    let groups = ends.windows(2).map(|w| group(histogram, &sums, w[0], w[1])).collect();
    Partition { groups, gap: 0.0, iterations: 1, converged: true }
}

/// The partitions of least inertia into 1, 2, … `k_max` groups, or up to as many as there are values.
pub(crate) fn partitions(histogram: &Histogram, k_max: usize) -> Vec<Partition> {
    let values = histogram.values.len();
    let k_max = k_max.min(values);
    if k_max == 0 {
        return Vec::new();
    }
    let sums = Sums::new(histogram);
    let rows = optimal::rows(values + 1, k_max, true, &|p, q| sums.inertia(p, q));
    let partition = |k: usize| {
        let ends: Vec<usize> =
            std::iter::once(0).chain(rows.cuts(k)).chain(std::iter::once(values)).collect();
        let groups = ends.windows(2).map(|w| group(histogram, &sums, w[0], w[1])).collect();
        Partition { groups, gap: 0.0, iterations: 1, converged: true }
    };
    (1..=k_max).map(partition).collect()
}

/// The groups of a histogram between given indices of values, ascending; empty ones are left out.
pub(crate) fn groups_between(histogram: &Histogram, ends: &[usize]) -> Vec<Group> {
    if histogram.values.is_empty() {
        return Vec::new();
    }
    let sums = Sums::new(histogram);
    ends.windows(2).filter(|w| w[0] < w[1]).map(|w| group(histogram, &sums, w[0], w[1])).collect()
}

fn group(histogram: &Histogram, sums: &Sums, a: usize, b: usize) -> Group {
    let n = sums.count[b] - sums.count[a];
    let s = sums.sum[b] - sums.sum[a];
    // Whole part and remainder apart: a mean far from 0 loses no digit of its fraction.
    let mean = (sums.shift + s.div_euclid(n) as i64) as f64 + s.rem_euclid(n) as f64 / n as f64;
    let inertia = sums.inertia(a, b);
    Group {
        range: [histogram.values[a] as f64, histogram.values[b - 1] as f64],
        count: n as u64,
        mean,
        sd: (inertia / n as f64).sqrt(),
        inertia,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::noise;

    /// Least inertia over all partitions, by trying each.
    fn brute_force(sums: &Sums, from: usize, values: usize, k: usize) -> f64 {
        if k == 1 {
            return sums.inertia(from, values);
        }
        (from + 1..=values + 1 - k)
            .map(|cut| sums.inertia(from, cut) + brute_force(sums, cut, values, k - 1))
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn inertia_is_the_brute_force_optimum() {
        for case in 0..256_u64 {
            let roll = |i: u64, below: u64| noise::below(case, i, below);
            let bins: std::collections::BTreeMap<i64, u64> =
                (0..=roll(0, 12)).map(|i| (roll(10 + i, 80) as i64 - 40, 1 + roll(100 + i, 49))).collect();
            let scale = 1 + roll(1, 899) as i64;
            let histogram = Histogram {
                values: bins.keys().map(|v| v * scale).collect(),
                counts: bins.values().copied().collect(),
            };
            let k = (1 + roll(2, 5) as usize).min(bins.len());
            let best = brute_force(&Sums::new(&histogram), 0, bins.len(), k);
            let found = partition(&histogram, k);
            assert_eq!(found.groups.len(), k, "case {case}");
            assert!(
                (found.inertia() - best).abs() <= 1e-14 * best,
                "case {case}: {} for {best}",
                found.inertia()
            );
            assert_eq!(found.groups.iter().map(|g| g.count).sum::<u64>(), bins.values().sum::<u64>());
        }
    }

    #[test]
    fn all_partitions_at_once_are_those_one_by_one() {
        let histogram =
            Histogram { values: vec![-9, 0, 1, 5, 40, 41, 77], counts: vec![3, 1, 4, 1, 5, 9, 2] };
        let all = partitions(&histogram, 20);
        assert_eq!(all.len(), 7);
        for (i, found) in all.iter().enumerate() {
            assert_eq!(*found, partition(&histogram, i + 1));
        }
        assert!(partitions(&Histogram::default(), 3).is_empty());
    }

    #[test]
    fn a_mean_far_from_zero_keeps_its_fraction() {
        let histogram = Histogram { values: vec![60_000, 60_001], counts: vec![1 << 30, 1] };
        let group = &groups_between(&histogram, &[0, 2])[0];
        assert!(group.mean > 60_000.0 && group.mean < 60_000.000_001);
        assert!((group.inertia - 1.0).abs() < 1e-9);
    }
}
