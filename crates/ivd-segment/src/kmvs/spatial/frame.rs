//! The space in which voxels are compared: three weighted coordinates and the value.

use ivd_core::{Mask, Scalar, Volume, parallel};

use crate::wide::Wide;

/// Voxels that one task looks at.
const CHUNK: usize = 1 << 16;
/// Bits of the largest fixed-point value of a type of more than 16 bits.
const FIXED_BITS: i32 = 48;
/// Adding this rounds a number below 2⁵¹ to a whole one (ties to even), which then stands in the low bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// A place in feature space: x, y, z, value.
pub(super) type Point = [f64; 4];

/// Squared distance. Every decision between centroids is made by this sum in this order, here and in the plain twin.
#[inline(always)]
pub(super) fn distance(a: &Point, b: &Point) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]
}

/// A centroid: where it lies among the features, and the same in mm and real units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Centroid {
    pub(super) at: Point,
    pub(super) real: Point,
}

/// How voxels become features. All of it follows from the values and the grid, not from how the values are stored.
///
/// Features are real units times a power of two that brings the widest extent near 1, so that squares neither overflow nor
/// vanish and no decision changes. Values count from `centre`, a whole number near the middle of their range.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    centre: f64,
    /// Fixed-point units in one stored unit: a power of two.
    fixed: f64,
    /// Feature of one stored unit, of one mm.
    value: f64,
    place: f64,
    spacing: [f64; 3],
    weight: f64,
    slope: f64,
    intercept: f64,
    /// Feature of every voxel index along an axis.
    pub(super) axes: [Vec<f64>; 3],
}

impl Frame {
    /// The frame for stored values of type `T` in `range`.
    pub(super) fn new<T: Scalar>([low, high]: [f64; 2], volume: &Volume, weight: f64) -> Self {
        let centre = low.midpoint(high).clamp(-f64::MAX / 4.0, f64::MAX / 4.0).floor();
        let width = (high - centre).max(centre - low);
        let (spacing, dims) = (volume.grid().spacing(), volume.grid().dims());
        let slope = volume.slope();
        let extents = (0..3).map(|a| weight * (spacing[a] * (dims[a] - 1) as f64));
        let widest = extents.fold(width * slope.abs(), f64::max).min(f64::MAX);
        let scale = power_of_two(-exponent_above(widest));
        let fixed = if is_short::<T>() { 1.0 } else { power_of_two(FIXED_BITS - exponent_above(width)) };
        let place = weight * scale;
        let axes = std::array::from_fn(|a| (0..dims[a]).map(|i| place * (spacing[a] * i as f64)).collect());
        let value = slope * scale;
        Self { centre, fixed, value, place, spacing, weight, slope, intercept: volume.intercept(), axes }
    }

    /// A stored value from the centre.
    #[inline(always)]
    pub(super) fn relative<T: Scalar>(&self, value: T) -> f64 {
        value.to_f64() - self.centre
    }

    /// Feature of a value from the centre.
    #[inline(always)]
    pub(super) fn value(&self, relative: f64) -> f64 {
        relative * self.value
    }

    /// A value from the centre in fixed point: whole numbers, so that sums don't depend on their order. Exact for integers;
    /// for floats to 2⁻⁴⁹ of the range. At most 2⁴⁸ in size.
    #[inline(always)]
    pub(super) fn fixed(&self, relative: f64) -> i64 {
        (relative * self.fixed + WHOLE).to_bits() as i64 - WHOLE.to_bits() as i64
    }

    /// Feature extent of a difference in fixed point.
    pub(super) fn width(&self, fixed: u64) -> f64 {
        fixed as f64 / self.fixed * self.value.abs()
    }

    /// The centroid of voxels: their number, the sums of their indices and of their values in fixed point.
    pub(super) fn centroid(&self, count: u64, indices: [u64; 3], values: i128) -> Centroid {
        let n = count as f64;
        let mm: [f64; 3] =
            std::array::from_fn(|a| self.spacing[a] * wide(i128::from(indices[a])).over(n).value());
        let relative = wide(values).over(n).value() / self.fixed;
        let at = [self.place * mm[0], self.place * mm[1], self.place * mm[2], self.value(relative)];
        Centroid { at, real: [mm[0], mm[1], mm[2], self.real(relative)] }
    }

    /// A centroid given in mm and real units.
    pub(super) fn given(&self, real: Point) -> Centroid {
        let [x, y, z, value] = real;
        // The feature of one real unit is the power of two between `value` and the slope.
        let unit = self.value / self.slope;
        let middle = self.slope * self.centre + self.intercept;
        Centroid { at: [self.place * x, self.place * y, self.place * z, (value - middle) * unit], real }
    }

    fn real(&self, relative: f64) -> f64 {
        (self.slope * (self.centre + relative) + self.intercept).clamp(f64::MIN, f64::MAX)
    }

    /// Sum of squared distances from the mean, in real units²: `about` is that of the indices along each axis and of the
    /// values in fixed point.
    pub(super) fn inertia(&self, about: [f64; 4]) -> f64 {
        let value = self.slope.abs() / self.fixed;
        let total: f64 = (0..3)
            .map(|a| {
                let unit = self.weight * self.spacing[a];
                about[a] * unit * unit
            })
            .sum();
        (total + about[3] * value * value).min(f64::MAX)
    }

    /// Standard deviation of the values in real units, from their sum of squares about the mean.
    pub(super) fn spread(&self, about: f64, count: u64) -> f64 {
        ((about / count as f64).sqrt() / self.fixed * self.slope.abs()).min(f64::MAX)
    }
}

/// Whether a type's values are their own fixed-point numbers, so small that sums of squares over a brick fit 64 bits.
pub(super) fn is_short<T: Scalar>() -> bool {
    T::TYPE.is_integer() && T::TYPE.bytes() <= 2
}

/// An integer with 106 bits of it.
pub(super) fn wide(value: i128) -> Wide {
    let high = value as f64;
    Wide::from(high).plus(Wide::from((value - high as i128) as f64))
}

/// `e` with `2^e > value`, near the least.
fn exponent_above(value: f64) -> i32 {
    if value == 0.0 { 0 } else { (value.to_bits() >> 52 & 0x7ff) as i32 - 1022 }
}

fn power_of_two(exponent: i32) -> f64 {
    2.0_f64.powi(exponent.clamp(-1000, 1000))
}

/// The least and the largest of the data inside the mask.
pub(super) fn range<T: Scalar>(voxels: &[T], mask: Option<&Mask>) -> Option<[f64; 2]> {
    let of = |piece: std::ops::Range<usize>| {
        let inside = mask.map(|m| &m.inside()[piece.clone()]);
        let voxels = &voxels[piece];
        let counts = |j: usize| voxels[j].is_data() && inside.is_none_or(|m| m[j] != 0);
        let first = (0..voxels.len()).find(|j| counts(*j))?;
        let (mut low, mut high) = (voxels[first], voxels[first]);
        for (j, &v) in voxels.iter().enumerate() {
            if counts(j) {
                low = if v < low { v } else { low };
                high = if v > high { v } else { high };
            }
        }
        Some([low.to_f64(), high.to_f64()])
    };
    let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    parallel::map_pieces(voxels.len(), CHUNK, &of).into_iter().flatten().reduce(join)
}
