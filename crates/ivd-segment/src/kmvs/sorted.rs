//! Sums over any interval of a sorted sample, without cancellation.

use ivd_core::{Scalar, parallel};

use crate::wide::Wide;

/// Values whose sums are stored together; what lies between two stored sums is added on demand.
const BLOCK: usize = 1024;

/// `Σ(x - m)` and `Σ(x - m)²` of the values between the median `m` and some place in the order; negative to its left.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    sum: Wide,
    squares: Wide,
}

impl Moments {
    fn plus(self, other: Self) -> Self {
        Self { sum: self.sum.plus(other.sum), squares: self.squares.plus(other.squares) }
    }

    fn minus(self, other: Self) -> Self {
        Self { sum: self.sum.minus(other.sum), squares: self.squares.minus(other.squares) }
    }

    /// Inertia of the `n` values between two places.
    #[inline]
    pub(super) fn inertia(self, to: Self, n: usize) -> f64 {
        if n == 0 {
            return 0.0;
        }
        let part = to.minus(self);
        part.squares.minus(part.sum.times(part.sum).over(n as f64)).value().max(0.0)
    }

    /// Mean of the `n` values between two places, relative to the median.
    pub(super) fn mean(self, to: Self, n: usize) -> f64 {
        to.minus(self).sum.over(n as f64).value()
    }
}

/// A sorted sample and its running sums, outward from the median: an outlier's square then never stands beside the sums of
/// the values nearer to the median.
pub(super) struct Sorted<'a, T> {
    values: &'a [T],
    /// Power of two, in two factors, that brings the values near 1; 1 unless they are near the ends of `f64`.
    scale: [f64; 2],
    middle: usize,
    median: f64,
    right: Vec<Moments>,
    left: Vec<Moments>,
}

impl<'a, T: Scalar> Sorted<'a, T> {
    /// `values` ascending, not empty, all finite.
    pub(super) fn new(values: &'a [T]) -> Self {
        let middle = values.len() / 2;
        let largest = values[0].to_f64().abs().max(values[values.len() - 1].to_f64().abs());
        let scale = power_of_two_to_one(largest);
        let mut sorted = Self {
            values,
            scale,
            middle,
            median: values[middle].to_f64() * scale[0] * scale[1],
            right: Vec::new(),
            left: Vec::new(),
        };
        let n = values.len();
        let right = parallel::map((n - middle) / BLOCK, &|j| {
            sorted.part(middle + j * BLOCK, middle + (j + 1) * BLOCK)
        });
        let left =
            parallel::map(middle / BLOCK, &|j| sorted.part(middle - (j + 1) * BLOCK, middle - j * BLOCK));
        sorted.right = running(&right, Moments::plus);
        sorted.left = running(&left, Moments::minus);
        sorted
    }

    pub(super) fn len(&self) -> usize {
        self.values.len()
    }

    pub(super) fn value(&self, i: usize) -> T {
        self.values[i]
    }

    /// Sums from the median to place `i` (before value `i`).
    pub(super) fn at(&self, i: usize) -> Moments {
        if i >= self.middle {
            let block = (i - self.middle) / BLOCK;
            self.right[block].plus(self.part(self.middle + block * BLOCK, i))
        } else {
            let block = (self.middle - i) / BLOCK;
            self.left[block].minus(self.part(i, self.middle - block * BLOCK))
        }
    }

    /// Mean in the values' own unit from one relative to the median.
    pub(super) fn unscaled_mean(&self, relative: f64) -> f64 {
        (self.median + relative) / self.scale[0] / self.scale[1]
    }

    /// A length in the values' own unit.
    pub(super) fn unscaled(&self, length: f64) -> f64 {
        length / self.scale[0] / self.scale[1]
    }

    /// Sums of the values `a … b - 1`, added about the first of them.
    fn part(&self, a: usize, b: usize) -> Moments {
        if a == b {
            return Moments::default();
        }
        let scaled = |v: T| v.to_f64() * self.scale[0] * self.scale[1];
        let centre = scaled(self.values[a]);
        // Few values may span the whole range, and a group among them be narrow: their sums need the digits too.
        let mut own = Moments::default();
        for &v in &self.values[a..b] {
            let d = Wide::difference(scaled(v), centre);
            own = own.plus(Moments { sum: d, squares: d.times(d) });
        }
        let (n, offset) = (Wide::from((b - a) as f64), Wide::difference(centre, self.median));
        let cross = offset.plus(offset).times(own.sum);
        Moments {
            sum: n.times(offset).plus(own.sum),
            squares: n.times(offset.times(offset)).plus(cross).plus(own.squares),
        }
    }

    /// First place after `i` where the value differs from value `i`.
    pub(super) fn next_change(&self, i: usize) -> usize {
        let value = self.values[i];
        // Gallop, then bisect: runs are usually short and sometimes most of the sample.
        let mut step = 1;
        while i + step < self.len() && self.values[i + step] == value {
            step *= 2;
        }
        let (from, to) = (i + step / 2, (i + step).min(self.len()));
        from + self.values[from..to].partition_point(|v| *v == value)
    }
}

fn running(parts: &[Moments], join: fn(Moments, Moments) -> Moments) -> Vec<Moments> {
    let mut total = Moments::default();
    let mut all = vec![total];
    for part in parts {
        total = join(total, *part);
        all.push(total);
    }
    all
}

/// Two powers of two whose product brings `largest` near 1; 1 where its square is harmless.
fn power_of_two_to_one(largest: f64) -> [f64; 2] {
    if largest == 0.0 || (1e-100..1e100).contains(&largest) {
        return [1.0, 1.0];
    }
    let half = -(largest.log2() / 2.0).floor() as i32;
    let power = 2.0_f64.powi(half);
    [power, power]
}
