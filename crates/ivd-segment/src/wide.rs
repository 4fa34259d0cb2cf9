//! Sums with twice the digits of `f64`: a number is an unevaluated sum of two (Dekker 1971; Knuth, TAOCP 4.2.2).

/// `high + low`, with `|low|` at most half a unit in the last place of `high`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Wide {
    high: f64,
    low: f64,
}

impl From<f64> for Wide {
    fn from(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }
}

impl Wide {
    /// `a - b`, exactly.
    pub(crate) fn difference(a: f64, b: f64) -> Self {
        two_sum(a, -b)
    }

    #[inline]
    pub(crate) fn plus(self, other: Self) -> Self {
        let sum = two_sum(self.high, other.high);
        quick_two_sum(sum.high, sum.low + self.low + other.low)
    }

    #[inline]
    pub(crate) fn minus(self, other: Self) -> Self {
        self.plus(Self { high: -other.high, low: -other.low })
    }

    #[inline]
    pub(crate) fn times(self, other: Self) -> Self {
        let product = two_product(self.high, other.high);
        quick_two_sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }

    #[inline]
    pub(crate) fn over(self, divisor: f64) -> Self {
        let first = self.high / divisor;
        let rest = self.minus(two_product(first, divisor));
        quick_two_sum(first, rest.high / divisor)
    }

    /// Times a power of two.
    #[inline]
    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self { high: self.high * factor, low: self.low * factor }
    }

    #[inline]
    pub(crate) fn value(self) -> f64 {
        self.high
    }
}

#[inline]
fn two_sum(a: f64, b: f64) -> Wide {
    let high = a + b;
    let part = high - a;
    Wide { high, low: (a - (high - part)) + (b - part) }
}

#[inline]
fn quick_two_sum(a: f64, b: f64) -> Wide {
    let high = a + b;
    Wide { high, low: b - (high - a) }
}

/// Exact product by splitting each factor in halves of 26 bits; factors below 2⁹⁹⁶.
#[inline]
fn two_product(a: f64, b: f64) -> Wide {
    let split = |v: f64| {
        let c = 134_217_729.0 * v;
        let high = c - (c - v);
        (high, v - high)
    };
    let high = a * b;
    let ((a1, a2), (b1, b2)) = (split(a), split(b));
    Wide { high, low: ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_beyond_f64_survive_sums_products_and_quotients() {
        let tiny = Wide::from(1.0).plus(Wide::from(1e-25)).minus(Wide::from(1.0));
        assert!((tiny.value() - 1e-25).abs() < 1e-31);
        let third = Wide::from(1.0).over(3.0);
        assert!(third.times(Wide::from(3.0)).minus(Wide::from(1.0)).value().abs() < 1e-31);
        let a = Wide::from(1e8).plus(Wide::from(1e-8));
        let square = a.times(a).minus(Wide::from(1e16)).minus(Wide::from(2.0));
        assert!((square.value() - 1e-16).abs() < 1e-15);
    }
}
