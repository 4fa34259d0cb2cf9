use ivd_core::Scalar;

use super::Order;

/// Distance from a voxel's centre (voxels) below which a place counts as that centre. Vectors kept in `f32` name a
/// place some 20 voxels away to about 2⁻²⁰ voxel; values differ by this fraction of their range at most, and a whole
/// number of voxels stays one: no neighbour takes part, missing ones among them.
pub(super) const SNAP: f64 = 1.0 / 131_072.0;

/// A typed volume that can be read between its voxels.
pub(crate) struct Source<'a, T> {
    pub(crate) voxels: &'a [T],
    pub(crate) dims: [usize; 3],
}

/// First index and weights along one axis.
struct Taps<const N: usize> {
    index: [usize; N],
    weight: [f64; N],
}

impl<T: Scalar> Source<'_, T> {
    /// The stored value at voxel coordinate `x`; `None` outside the volume (the voxels' own extent, −½ … n − ½) or where
    /// no data takes part.
    #[inline]
    pub(crate) fn sample(&self, x: [f64; 3], order: Order) -> Option<f64> {
        if (0..3).any(|a| !(-0.5..self.dims[a] as f64 - 0.5).contains(&x[a])) {
            return None;
        }
        match order {
            Order::Nearest => self.nearest(x),
            Order::Linear => self.linear(x),
            Order::Cubic => self.cubic(x),
        }
    }

    fn nearest(&self, x: [f64; 3]) -> Option<f64> {
        let at: [usize; 3] =
            std::array::from_fn(|a| ((x[a] + 0.5).floor().max(0.0) as usize).min(self.dims[a] - 1));
        let value = self.voxels[at[0] + self.dims[0] * (at[1] + self.dims[1] * at[2])];
        value.is_data().then(|| value.to_f64())
    }

    #[inline]
    fn linear(&self, x: [f64; 3]) -> Option<f64> {
        let [tx, ty, tz] = std::array::from_fn(|a| linear_taps(x[a], self.dims[a]));
        let mut sum = 0.0;
        for k in 0..2 {
            for j in 0..2 {
                let row = self.dims[0] * (ty.index[j] + self.dims[1] * tz.index[k]);
                let (a, b) = (self.voxels[row + tx.index[0]], self.voxels[row + tx.index[1]]);
                let weight = ty.weight[j] * tz.weight[k];
                if !a.is_data() || !b.is_data() {
                    return self.linear_with_gaps(&tx, &ty, &tz);
                }
                sum += weight * (tx.weight[0] * a.to_f64() + tx.weight[1] * b.to_f64());
            }
        }
        Some(sum)
    }

    /// The same where some neighbour is no data: that matters only if its weight isn't 0.
    #[cold]
    fn linear_with_gaps(&self, tx: &Taps<2>, ty: &Taps<2>, tz: &Taps<2>) -> Option<f64> {
        self.weighted(tx, ty, tz)
    }

    /// Separable weights, taps of weight 0 left out; `None` where a tap that counts is no data.
    fn weighted<const N: usize>(&self, tx: &Taps<N>, ty: &Taps<N>, tz: &Taps<N>) -> Option<f64> {
        let mut sum = 0.0;
        for k in 0..N {
            for j in 0..N {
                let outer = ty.weight[j] * tz.weight[k];
                if outer == 0.0 {
                    continue;
                }
                let row = self.dims[0] * (ty.index[j] + self.dims[1] * tz.index[k]);
                let mut line = 0.0;
                for i in 0..N {
                    if tx.weight[i] != 0.0 {
                        let value = self.voxels[row + tx.index[i]];
                        if !value.is_data() {
                            return None;
                        }
                        line += tx.weight[i] * value.to_f64();
                    }
                }
                sum += outer * line;
            }
        }
        Some(sum)
    }

    fn cubic(&self, x: [f64; 3]) -> Option<f64> {
        let [tx, ty, tz] = std::array::from_fn(|a| cubic_taps(x[a], self.dims[a]));
        match self.weighted(&tx, &ty, &tz) {
            // An overshoot past the type's finite range, or a gap within the wider support.
            Some(value) if T::from_f64(value).is_data() => Some(value),
            _ => self.linear(x),
        }
    }
}

/// Whole part and fraction of a coordinate inside the voxels' extent; the half voxel at either border reads the border.
pub(super) fn split(x: f64, n: usize) -> (usize, f64) {
    let x = x.clamp(0.0, (n - 1) as f64);
    let near = x.round();
    let x = if (x - near).abs() <= SNAP { near } else { x };
    (x as usize, x - x.floor())
}

fn linear_taps(x: f64, n: usize) -> Taps<2> {
    let (base, t) = split(x, n);
    Taps { index: [base, (base + 1).min(n - 1)], weight: [1.0 - t, t] }
}

fn cubic_taps(x: f64, n: usize) -> Taps<4> {
    let (base, t) = split(x, n);
    let index = std::array::from_fn(|i| (base + i).saturating_sub(1).min(n - 1));
    let (t2, t3) = (t * t, t * t * t);
    let weight = [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ];
    Taps { index, weight }
}
