//! Exact inside tests on stored values.
//!
//! A voxel is inside where its *real* value, as every other stage computes it, passes the test. The real value is a
//! monotone function of the stored one, in floating point too, so that the inside is a range of stored values: it is
//! found once, by bisection, and then tested in the stored type without any rounding.

use ivd_core::{Scalar, Volume};

use super::params::Iso;

/// A stored type whose finite values can be numbered in ascending order.
pub(super) trait Ordered: Scalar {
    /// Numbers of the smallest and the largest finite value.
    const RANKS: [i64; 2];
    /// The value of that number.
    fn from_rank(rank: i64) -> Self;
}

macro_rules! ordered_integers {
    ($($type:ty)*) => {$(
        impl Ordered for $type {
            const RANKS: [i64; 2] = [<$type>::MIN as i64, <$type>::MAX as i64];
            fn from_rank(rank: i64) -> Self {
                rank as Self
            }
        }
    )*};
}
ordered_integers!(u8 i8 u16 i16 u32 i32);

macro_rules! ordered_floats {
    ($($type:ty, $bits:ty;)*) => {$(
        impl Ordered for $type {
            const RANKS: [i64; 2] = [-(<$type>::MAX.to_bits() as i64), <$type>::MAX.to_bits() as i64];
            fn from_rank(rank: i64) -> Self {
                let magnitude = <$type>::from_bits(rank.unsigned_abs() as $bits);
                if rank < 0 { -magnitude } else { magnitude }
            }
        }
    )*};
}
ordered_floats! { f32, u32; f64, u64; }

/// What is inside, in stored values, and where the surface crosses between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds<T> {
    /// Smallest stored value inside.
    pub(super) first: T,
    /// Largest stored value inside; below `first` where no value is.
    pub(super) last: T,
    /// Stored value of the crossing below the inside, not rounded to the type; −∞ where there is none.
    pub(super) low: f64,
    /// Stored value of the crossing above the inside; +∞ where there is none.
    pub(super) high: f64,
    /// Whether a saddle on the surface is inside.
    pub(super) joins_ties: bool,
}

impl<T: Ordered> Bounds<T> {
    /// The bounds of `iso` on the values of `volume`; `iso` must not be [`Iso::Mask`], which knows no values.
    pub(super) fn new(volume: &Volume, iso: &Iso) -> Self {
        let (lower, upper) = match *iso {
            Iso::Value(value) => (Some(value), None),
            Iso::Interval { lower, upper } => (lower, upper),
            Iso::Mask => (None, None),
        };
        let above = |limit: Option<f64>| {
            move |stored: T| limit.is_none_or(|limit| volume.real(stored.to_f64()) >= limit)
        };
        let below = |limit: Option<f64>| {
            move |stored: T| limit.is_some_and(|limit| volume.real(stored.to_f64()) >= limit)
        };
        let rising = volume.slope() > 0.0;
        let (first, end) = if rising {
            (rank_of_first(above(lower)), rank_of_first(below(upper)))
        } else {
            (rank_of_first(|v: T| !below(upper)(v)), rank_of_first(|v: T| !above(lower)(v)))
        };
        let stored = |limit: Option<f64>, open: f64| limit.map_or(open, |limit| volume.stored(limit));
        let (low, high) = if rising { (lower, upper) } else { (upper, lower) };
        let (low, high) = (stored(low, f64::NEG_INFINITY), stored(high, f64::INFINITY));
        if first >= end {
            let [least, greatest] = T::RANKS;
            return Self {
                first: T::from_rank(greatest),
                last: T::from_rank(least),
                low,
                high,
                joins_ties: true,
            };
        }
        Self { first: T::from_rank(first), last: T::from_rank(end - 1), low, high, joins_ties: true }
    }

    /// Whether a stored value is inside; NaN and the infinities aren't.
    #[inline(always)]
    pub(super) fn contains(&self, value: T) -> bool {
        value >= self.first && value <= self.last
    }

    /// Signed distance of a stored value from the surface [stored values], positive inside, of a value that is data.
    #[inline]
    pub(super) fn level(&self, value: T) -> f64 {
        let value = value.to_f64();
        (value - self.low).min(self.high - value)
    }

    /// Where the surface crosses between two stored values, one of them inside, the other `outside`: the fraction of
    /// the way from `a` to `b`, not yet clamped.
    #[inline]
    pub(super) fn crossing(&self, a: T, b: T, outside: T) -> f64 {
        let crossed = if outside > self.last { self.high } else { self.low };
        let (a, b) = (a.to_f64(), b.to_f64());
        if (b - a).is_finite() {
            return (crossed - a) / (b - a);
        }
        // The difference left f64's range: take it at half scale.
        (crossed / 2.0 - a / 2.0) / (b / 2.0 - a / 2.0)
    }
}

/// Number of the first value for which `inside` holds, given that it holds for all later ones; one past the last
/// where it holds for none.
fn rank_of_first<T: Ordered>(inside: impl Fn(T) -> bool) -> i64 {
    let [mut low, last] = T::RANKS;
    let mut high = last + 1;
    while low < high {
        let middle = (i128::from(low) + i128::from(high)).div_euclid(2) as i64;
        if inside(T::from_rank(middle)) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, Voxels};

    use super::*;

    fn volume(slope: f64, intercept: f64) -> Volume {
        let grid = Grid::with_spacing([1, 1, 1], [1.0; 3]).unwrap();
        Volume::with_scale(grid, Voxels::from(vec![0_i16]), slope, intercept).unwrap()
    }

    #[test]
    fn integer_bounds_agree_with_the_real_value_of_every_stored_one() {
        for slope in [1.0, 0.1, -0.1, -3.0, 1e-7] {
            for intercept in [0.0, 0.3, -1024.0] {
                let volume = volume(slope, intercept);
                let at = |stored: f64| volume.real(stored);
                for iso in
                    [at(3.0), at(3.0).next_up(), at(3.0).next_down(), at(-7.5), at(40000.0), at(-40000.0)]
                {
                    let bounds = Bounds::<i16>::new(&volume, &Iso::Value(iso));
                    for v in i16::MIN..=i16::MAX {
                        assert_eq!(
                            bounds.contains(v),
                            at(f64::from(v)) >= iso,
                            "{slope} {intercept} {iso} {v}"
                        );
                    }
                }
                let (lower, upper) = (at(-2.0).min(at(5.0)), at(-2.0).max(at(5.0)));
                let bounds =
                    Bounds::<i16>::new(&volume, &Iso::Interval { lower: Some(lower), upper: Some(upper) });
                for v in -10..=10_i16 {
                    let real = at(f64::from(v));
                    assert_eq!(bounds.contains(v), lower <= real && real < upper, "{slope} {intercept} {v}");
                }
            }
        }
    }

    #[test]
    fn float_bounds_hold_to_one_ulp_and_leave_out_what_is_no_data() {
        let volume = volume(1.0, 0.0);
        let bounds = Bounds::<f32>::new(&volume, &Iso::Value(0.1));
        assert!(f64::from(bounds.first) >= 0.1 && f64::from(bounds.first.next_down()) < 0.1);
        assert!(bounds.contains(f32::MAX) && !bounds.contains(f32::INFINITY) && !bounds.contains(f32::NAN));
        let bounds = Bounds::<f64>::new(&volume, &Iso::Value(0.0));
        assert!(bounds.contains(-0.0) && !bounds.contains(-f64::from_bits(1)));
        let bounds = Bounds::<f64>::new(&volume, &Iso::Interval { lower: None, upper: Some(0.0) });
        assert!(!bounds.contains(-0.0) && bounds.contains(-f64::from_bits(1)) && bounds.contains(f64::MIN));
        assert!(!bounds.contains(f64::NEG_INFINITY));
    }

    #[test]
    fn a_crossing_between_huge_values_is_finite() {
        let bounds = Bounds::<f64>::new(&volume(1.0, 0.0), &Iso::Value(0.0));
        assert_eq!(bounds.crossing(-1.7e308, 1.7e308, -1.7e308), 0.5);
    }
}
