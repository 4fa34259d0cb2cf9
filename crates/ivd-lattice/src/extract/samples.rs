//! What extraction asks of its input: which voxels are inside, how far each is from the surface, where it crosses.

use ivd_core::MIN_EDGE_FRACTION;

use super::bounds::{Bounds, Ordered};

/// Voxels seen as inside or outside, by linear index.
pub(super) trait Samples: Sync {
    /// Whether a voxel is inside.
    #[cfg(test)]
    fn inside(&self, voxel: usize) -> bool;

    /// Signs of the `count` voxels from `first` on: bit `i % 8` of byte `i / 8` is set where voxel `first + i` is
    /// inside. Bits beyond `count` in the last byte are 0.
    fn signs(&self, first: usize, count: usize, bytes: &mut [u8]);

    /// Distance of a voxel from the surface in the field's own unit, positive inside; NaN where the voxel has none
    /// (no data, or a mask that overrules the field).
    fn level(&self, voxel: usize) -> f64;

    /// Whether a saddle on the surface is inside: for values, as a voxel on the isovalue is. Not for masks, all of whose saddles
    /// lie there: parts that touch along an edge stay apart.
    fn joins_ties(&self) -> bool;

    /// Where the surface crosses from voxel `a` to its neighbour `b`, one of them inside: fraction of the way, within
    /// `[MIN_EDGE_FRACTION, 1 - MIN_EDGE_FRACTION]`; halfway where one of them has no level.
    fn crossing(&self, a: usize, b: usize) -> f32;
}

/// A field alone decides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field<'a, T> {
    pub(super) voxels: &'a [T],
    pub(super) bounds: Bounds<T>,
}

impl<T: Ordered> Samples for Field<'_, T> {
    #[cfg(test)]
    fn inside(&self, voxel: usize) -> bool {
        self.bounds.contains(self.voxels[voxel])
    }

    fn signs(&self, first: usize, count: usize, bytes: &mut [u8]) {
        let bounds = self.bounds;
        pack(&self.voxels[first..first + count], bytes, |&value| bounds.contains(value));
    }

    fn joins_ties(&self) -> bool {
        self.bounds.joins_ties
    }

    #[inline]
    fn level(&self, voxel: usize) -> f64 {
        let value = self.voxels[voxel];
        if value.is_data() { self.bounds.level(value) } else { f64::NAN }
    }

    #[inline]
    fn crossing(&self, a: usize, b: usize) -> f32 {
        let (a, b) = (self.voxels[a], self.voxels[b]);
        let outside = if self.bounds.contains(a) { b } else { a };
        if outside.is_data() { clamp(self.bounds.crossing(a, b, outside)) } else { 0.5 }
    }
}

/// A mask decides what is inside; the field places the surface where it agrees with the mask.
#[derive(Debug, Clone, Copy)]
pub(super) struct Masked<'a, T> {
    pub(super) mask: &'a [u8],
    pub(super) field: Field<'a, T>,
    /// Smallest stored value that contradicts the mask at a voxel outside it, if not above the field's last.
    pub(super) contradicts: T,
}

impl<T: Ordered> Masked<'_, T> {
    /// Whether the field has a value at a voxel, on the side that the mask says.
    #[inline]
    fn agrees(&self, voxel: usize) -> bool {
        let value = self.field.voxels[voxel];
        let bounds = &self.field.bounds;
        value.is_data()
            && if self.mask[voxel] != 0 {
                bounds.contains(value)
            } else {
                !(value >= self.contradicts && value <= bounds.last)
            }
    }
}

impl<T: Ordered> Samples for Masked<'_, T> {
    #[cfg(test)]
    fn inside(&self, voxel: usize) -> bool {
        self.mask[voxel] != 0 && self.field.voxels[voxel].is_data()
    }

    fn signs(&self, first: usize, count: usize, bytes: &mut [u8]) {
        pack(&self.mask[first..first + count], bytes, |&inside| inside != 0);
        if T::TYPE.is_integer() {
            return;
        }
        let voxels = &self.field.voxels[first..first + count];
        for (byte, voxels) in bytes.iter_mut().zip(voxels.chunks(8)).filter(|(byte, _)| **byte != 0) {
            for (i, value) in voxels.iter().enumerate() {
                *byte &= !(u8::from(!value.is_data()) << i);
            }
        }
    }

    fn joins_ties(&self) -> bool {
        self.field.bounds.joins_ties
    }

    #[inline]
    fn level(&self, voxel: usize) -> f64 {
        if self.agrees(voxel) { self.field.bounds.level(self.field.voxels[voxel]) } else { f64::NAN }
    }

    #[inline]
    fn crossing(&self, a: usize, b: usize) -> f32 {
        if !(self.agrees(a) && self.agrees(b)) {
            return 0.5;
        }
        let outside = self.field.voxels[if self.mask[a] != 0 { b } else { a }];
        clamp(self.field.bounds.crossing(self.field.voxels[a], self.field.voxels[b], outside))
    }
}

/// A mask with a level function (voxels), positive inside. A level of 0 is the surface itself and contradicts neither
/// side.
pub(super) fn levelled<'a>(mask: &'a [u8], level: &'a [f32]) -> Masked<'a, f32> {
    let bounds = Bounds { first: 0.0, last: f32::MAX, low: 0.0, high: f64::INFINITY, joins_ties: false };
    Masked { mask, field: Field { voxels: level, bounds }, contradicts: f32::from_bits(1) }
}

/// A mask alone: its surface lies halfway between its voxels.
pub(super) fn halfway(mask: &[u8]) -> Field<'_, u8> {
    let bounds = Bounds { first: 1, last: 1, low: 0.5, high: f64::INFINITY, joins_ties: false };
    Field { voxels: mask, bounds }
}

/// A crossing as it is stored: within `[MIN_EDGE_FRACTION, 1 - MIN_EDGE_FRACTION]`, halfway where there was no telling.
#[inline]
fn clamp(fraction: f64) -> f32 {
    if fraction.is_nan() { 0.5 } else { (fraction as f32).clamp(MIN_EDGE_FRACTION, 1.0 - MIN_EDGE_FRACTION) }
}

/// Packs a test of each value into bits, 64 values at a time so that the compiler can vectorise the test.
#[inline(always)]
fn pack<T>(values: &[T], bytes: &mut [u8], inside: impl Fn(&T) -> bool) {
    let mut flags = [0_u8; 64];
    for (values, bytes) in values.chunks(64).zip(bytes.chunks_mut(8)) {
        if let Some(values) = values.first_chunk::<64>() {
            for i in 0..64 {
                flags[i] = u8::from(inside(&values[i]));
            }
        } else {
            flags = [0; 64];
            for (flag, value) in flags.iter_mut().zip(values) {
                *flag = u8::from(inside(value));
            }
        }
        for (byte, flags) in bytes.iter_mut().zip(flags.as_chunks::<8>().0) {
            *byte = gather(*flags);
        }
    }
}

/// Eight flags, each 0 or 1, as the bits of a byte: the product moves flag `i` to bit `56 + i`, without carries.
#[inline(always)]
fn gather(flags: [u8; 8]) -> u8 {
    (u64::from_le_bytes(flags).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}
