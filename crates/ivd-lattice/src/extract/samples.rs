//! What extraction asks of its input: which voxels are inside, how far each is from the surface, where it crosses.

use ivd_core::T_MIN;

use super::bounds::{Bounds, Ordered};

/// Voxels seen as inside or outside, by linear index.
pub(super) trait Samples: Sync {
    /// Whether a voxel is inside.
    fn inside(&self, voxel: usize) -> bool;

    /// Distance of a voxel from the surface in the field's own unit, positive inside; NaN where the voxel has none
    /// (no data, or a mask that overrules the field).
    fn level(&self, voxel: usize) -> f64;

    /// Where the surface crosses from voxel `a` to its neighbour `b`, one of them inside: fraction of the way, within
    /// `[T_MIN, 1 - T_MIN]`; halfway where one of them has no level.
    fn crossing(&self, a: usize, b: usize) -> f32;
}

/// A field alone decides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field<'a, T> {
    pub(super) voxels: &'a [T],
    pub(super) bounds: Bounds<T>,
}

impl<T: Ordered> Samples for Field<'_, T> {
    #[inline(always)]
    fn inside(&self, voxel: usize) -> bool {
        self.bounds.contains(self.voxels[voxel])
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
    #[inline(always)]
    fn inside(&self, voxel: usize) -> bool {
        self.mask[voxel] != 0 && self.field.voxels[voxel].is_data()
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

/// A crossing as it is stored: within `[T_MIN, 1 - T_MIN]`, halfway where there was no telling.
#[inline]
fn clamp(fraction: f64) -> f32 {
    if fraction.is_nan() { 0.5 } else { (fraction as f32).clamp(T_MIN, 1.0 - T_MIN) }
}
