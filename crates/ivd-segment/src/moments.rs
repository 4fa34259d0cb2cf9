//! Number, mean and spread of values, the same bits for every storage type and any number of threads.

use ivd_core::{Scalar, Volume};

use crate::wide::Wide;

/// Where values are counted from, and in what unit, so that their squares neither overflow nor vanish: a whole number near the
/// middle of the volume's range, and a power of two near its width. Both depend on the values alone, not on how they are stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    centre: f64,
    scale: f64,
}

impl Frame {
    /// The frame of a volume's stored values.
    pub(crate) fn of(volume: &Volume) -> Self {
        Self::between(volume.stored_range().unwrap_or([0.0; 2]))
    }

    /// A power of two that takes the values to about 1.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }

    /// The value that is 0 in the frame.
    pub(crate) fn centre(&self) -> f64 {
        self.centre
    }

    /// A value in the frame.
    pub(crate) fn place(&self, value: f64) -> f64 {
        (value - self.centre) * self.scale
    }

    /// A value in the frame, exactly: the difference first, as a value times the unit of a constant volume has no number.
    #[inline]
    fn wide(&self, value: f64) -> Wide {
        Wide::difference(value, self.centre).scaled(self.scale)
    }

    /// The frame of values in a range.
    pub(crate) fn between([low, high]: [f64; 2]) -> Self {
        let middle = low.midpoint(high).clamp(-f64::MAX / 4.0, f64::MAX / 4.0);
        let centre = if middle.abs() < 1.0 { 0.0 } else { middle.floor() };
        // The whole number may lie farther from the values than they from one another.
        let reach = (high / 2.0 - centre / 2.0).max(centre / 2.0 - low / 2.0);
        let width = (2.0 * reach).clamp(f64::MIN_POSITIVE, f64::MAX / 4.0);
        // Exponents of ±1000 and beyond would overflow on their own.
        let exponent = (-width.log2().ceil()).clamp(-1000.0, 1000.0);
        Self { centre, scale: 2.0_f64.powi(exponent as i32) }
    }
}

/// Sums over some values, in a frame, with twice the digits of `f64`: exact for integers of up to 32 bits, whatever the order.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Moments {
    pub(crate) count: u64,
    sum: Wide,
    squares: Wide,
}

impl Moments {
    /// Adds a stored value.
    #[inline]
    pub(crate) fn add<T: Scalar>(&mut self, value: T, frame: &Frame) {
        let d = frame.wide(value.to_f64());
        self.count += 1;
        self.sum = self.sum.plus(d);
        self.squares = self.squares.plus(d.times(d));
    }

    /// Adds `count` equal stored values.
    pub(crate) fn add_many(&mut self, value: f64, count: u64, frame: &Frame) {
        let d = frame.wide(value);
        let n = Wide::from(count as f64);
        self.count += count;
        self.sum = self.sum.plus(d.times(n));
        self.squares = self.squares.plus(d.times(d).times(n));
    }

    /// Adds `count` values with their mean and sum of squared deviations from it.
    pub(crate) fn add_spread(&mut self, mean: f64, count: u64, squares: f64, frame: &Frame) {
        self.add_many(mean, count, frame);
        self.squares = self.squares.plus(Wide::from((squares * frame.scale * frame.scale).min(f64::MAX)));
    }

    /// Adds other values' sums.
    pub(crate) fn join(&mut self, other: &Self) {
        self.count += other.count;
        self.sum = self.sum.plus(other.sum);
        self.squares = self.squares.plus(other.squares);
    }

    /// Mean of the stored values; 0 of none.
    pub(crate) fn mean(&self, frame: &Frame) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        self.sum.over(self.count as f64).scaled(1.0 / frame.scale).plus(Wide::from(frame.centre)).value()
    }

    /// Sum of squared deviations from the mean, in stored units².
    pub(crate) fn inertia(&self, frame: &Frame) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let about = self.squares.minus(self.sum.times(self.sum).over(self.count as f64));
        about.value().max(0.0) / frame.scale / frame.scale
    }

    /// Standard deviation of the stored values.
    pub(crate) fn sd(&self, frame: &Frame) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let about = self.squares.minus(self.sum.times(self.sum).over(self.count as f64));
        (about.value().max(0.0) / self.count as f64).sqrt() / frame.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of<T: Scalar>(values: &[T], frame: &Frame) -> Moments {
        let mut found = Moments::default();
        for v in values {
            found.add(*v, frame);
        }
        found
    }

    #[test]
    fn an_intercept_that_swallows_the_values_leaves_their_frame_alone() {
        let grid = ivd_core::Grid::with_spacing([3, 1, 1], [1.0; 3]).unwrap();
        let values = vec![1e300, -3e299, 0.0];
        let volume = Volume::with_scale(grid, values.clone().into(), 6.45e-320, -0.25).unwrap();
        assert_eq!(volume.range(), Some([-0.25, -0.25]));
        let frame = Frame::of(&volume);
        let mean = of(&values, &frame).mean(&frame);
        assert!((mean / (7e299 / 3.0) - 1.0).abs() < 1e-14, "{mean}");
    }

    #[test]
    fn a_large_offset_leaves_the_spread_alone_and_types_agree() {
        let values: Vec<i32> = (0..1000).map(|i| 10_000_000 + i % 3).collect();
        let frame = Frame::between([1e7, 1e7 + 2.0]);
        let floats: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        let doubles: Vec<f64> = values.iter().map(|v| f64::from(*v)).rev().collect();
        let found = of(&values, &frame);
        assert_eq!((found, found), (of(&floats, &frame), of(&doubles, &frame)));
        assert_eq!(found.mean(&frame), 10_000_000.999);
        let exact = (0..1000).map(|i| (f64::from(i % 3) - 0.999).powi(2)).sum::<f64>();
        assert!((found.inertia(&frame) - exact).abs() < 1e-10 * exact);
        assert!((found.sd(&frame) - (exact / 1000.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn many_at_once_are_many_one_by_one() {
        let frame = Frame::between([-7.0, 300.0]);
        let mut once = Moments::default();
        once.add_many(-7.0, 5, &frame);
        once.add_many(300.0, 2, &frame);
        assert_eq!(once, of(&[-7_i16, 300, -7, -7, -7, 300, -7], &frame));
    }

    #[test]
    fn one_value_that_is_no_whole_number_keeps_its_mean() {
        for value in [3.5, -3.5, -0.25, 1e-310, -1e-310, 0.1, 1e300, -1e300, 3_999_998_976.0] {
            let frame = Frame::between([value; 2]);
            let mut found = Moments::default();
            found.add_many(value, 12, &frame);
            found.add_spread(value, 3, 0.0, &frame);
            let near = (found.mean(&frame) - value).abs() <= 1e-15 * value.abs();
            assert!(near && found.sd(&frame) <= 1e-12 * value.abs(), "{value}: {found:?}");
        }
    }

    #[test]
    fn extremes_stay_finite_and_nothing_has_no_spread() {
        for [low, high] in [[f64::MIN, f64::MAX], [1e-310, 3e-310], [5.0, 5.0], [-1e300, 1e-300]] {
            let frame = Frame::between([low, high]);
            let found = of(&[low, high, low], &frame);
            let third = low / 3.0 * 2.0 + high / 3.0;
            let near =
                (found.mean(&frame) - third).abs() <= 1e-9 * (high / 2.0 - low / 2.0) + 1e-12 * third.abs();
            assert!(near && found.sd(&frame).is_finite(), "{low} {high} {found:?} {}", found.mean(&frame));
        }
        let frame = Frame::between([0.0, 1.0]);
        let none = Moments::default();
        assert_eq!((none.mean(&frame), none.sd(&frame), none.inertia(&frame)), (0.0, 0.0, 0.0));
    }
}
