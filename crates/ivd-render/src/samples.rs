//! Trilinear samples of the stored voxels: the innermost kernel, and the only module with `unsafe` code.
//!
//! The argument for it: [`Shape::place`] brings any coordinate, NaN too, into `0 ..= n - 1` and its cell to at most `n - 2` (0 for one voxel), so that
//! the cell's first voxel plus the steps `next` along any of the axes is a voxel of the grid; [`Samples::new`] asserts that there is a value for each.
//! Checking eight indices a sample costs about a third of the time of a picture.

use std::borrow::Cow;

use ivd_core::{Error, Exec, Scalar, Volume, Voxels, with_voxels};
use rayon::prelude::*;

/// A voxel type with a sampling kernel of its own; the others are converted to `f32` once.
pub(crate) trait Stored: Scalar {
    /// The value as `f32`, exact.
    fn single(self) -> f32;
}

macro_rules! stored {
    ($($type:ty),*) => {$(
        impl Stored for $type {
            #[inline(always)]
            fn single(self) -> f32 {
                self.into()
            }
        }
    )*};
}
stored!(u8, u16, i16, f32);

/// The voxels as the kernels read them. `stored = fast + shift`.
pub(crate) enum Fast<'a> {
    U8(&'a [u8]),
    U16(&'a [u16]),
    I16(&'a [i16]),
    F32(Cow<'a, [f32]>),
}

/// The voxels of a volume for the kernels, and the shift from fast to stored values. Wide types are taken about the middle of their
/// range, so that an offset costs no precision.
pub(crate) fn fast<'a>(volume: &'a Volume, exec: &Exec) -> Result<(Fast<'a>, f64), Error> {
    Ok(match volume.voxels() {
        Voxels::U8(buffer) => (Fast::U8(buffer), 0.0),
        Voxels::U16(buffer) => (Fast::U16(buffer), 0.0),
        Voxels::I16(buffer) => (Fast::I16(buffer), 0.0),
        Voxels::F32(buffer) => (Fast::F32(Cow::Borrowed(buffer)), 0.0),
        wide => {
            exec.check_memory("voxels converted for rendering", 4 * wide.len() as u64)?;
            let shift = volume.bricks().total().map_or(0.0, |(lo, hi)| 0.5 * (f64::from(lo) + f64::from(hi)));
            let converted: Vec<f32> = with_voxels!(wide, stored => {
                stored.par_iter().map(|v| (v.to_f64() - shift) as f32).collect()
            });
            (Fast::F32(Cow::Owned(converted)), shift)
        }
    })
}

/// The cell that a voxel coordinate lies in, and where in it (0…1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub(crate) cell: [usize; 3],
    pub(crate) within: [f32; 3],
}

/// Shape of the voxel grid, for finding cells.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    pub(crate) dims: [usize; 3],
    top: [f32; 3],
    last: [usize; 3],
    /// Distance in memory to the next voxel along each axis; 0 along an axis of one voxel.
    next: [usize; 3],
}

impl Shape {
    pub(crate) fn new(dims: [usize; 3]) -> Self {
        let strides = [1, dims[0], dims[0] * dims[1]];
        Self {
            dims,
            top: dims.map(|n| (n - 1) as f32),
            last: dims.map(|n| n.saturating_sub(2)),
            next: std::array::from_fn(|a| if dims[a] > 1 { strides[a] } else { 0 }),
        }
    }

    /// The cell of a voxel coordinate; beyond the outermost voxel centres the nearest place between them.
    #[inline(always)]
    pub(crate) fn place(&self, at: [f32; 3]) -> Place {
        let mut cell = [0; 3];
        let mut within = [0.0; 3];
        for a in 0..3 {
            // Comparisons rather than `max` and `min`: NaN becomes 0, in one instruction.
            let low = if at[a] > 0.0 { at[a] } else { 0.0 };
            let clamped = if low < self.top[a] { low } else { self.top[a] };
            // SAFETY: `clamped` lies in `0 ..= n - 1`, which an `i64` holds.
            let whole = unsafe { clamped.to_int_unchecked::<i64>() } as usize;
            cell[a] = whole.min(self.last[a]);
            within[a] = clamped - cell[a] as i32 as f32;
        }
        Place { cell, within }
    }

    /// Linear index of a cell's first voxel.
    #[inline(always)]
    fn base(&self, cell: [usize; 3]) -> usize {
        cell[0] + self.dims[0] * (cell[1] + self.dims[1] * cell[2])
    }

    /// Linear index of the voxel nearest to a place.
    #[inline(always)]
    pub(crate) fn nearest(&self, place: &Place) -> usize {
        let up = |a: usize| if place.within[a] >= 0.5 { self.next[a] } else { 0 };
        self.base(place.cell) + up(0) + up(1) + up(2)
    }

    /// Whether a coordinate lies in the volume, which reaches half a voxel beyond the outermost voxel centres.
    pub(crate) fn holds(&self, at: [f32; 3]) -> bool {
        (0..3).all(|a| at[a] >= -0.5 && at[a] <= self.top[a] + 0.5)
    }
}

/// Voxels of one type, sampled trilinearly.
pub(crate) struct Samples<'a, T> {
    voxels: &'a [T],
    pub(crate) shape: Shape,
}

impl<'a, T: Stored> Samples<'a, T> {
    /// `voxels` must hold one value for each voxel of `shape`.
    pub(crate) fn new(voxels: &'a [T], shape: Shape) -> Self {
        assert_eq!(voxels.len(), shape.dims.iter().product::<usize>(), "one value a voxel");
        Self { voxels, shape }
    }

    /// The stored voxels.
    pub(crate) fn voxels(&self) -> &'a [T] {
        self.voxels
    }

    /// Trilinear value at a place; not finite where the cell touches missing data.
    #[inline(always)]
    pub(crate) fn value(&self, place: &Place) -> f32 {
        let [dx, dy, dz] = self.shape.next;
        let base = self.shape.base(place.cell);
        debug_assert!(base + dx + dy + dz < self.voxels.len());
        let [fx, fy, fz] = place.within;
        let along = |i: usize| {
            // SAFETY: a voxel of the grid and its neighbour along x; see the module's head.
            let (a, b) = unsafe {
                (
                    self.voxels.get_unchecked(base + i).single(),
                    self.voxels.get_unchecked(base + i + dx).single(),
                )
            };
            a + (b - a) * fx
        };
        let mix = |a: f32, b: f32, f: f32| a + (b - a) * f;
        mix(mix(along(0), along(dy), fy), mix(along(dz), along(dz + dy), fy), fz)
    }

    /// Gradient per voxel at a coordinate: central differences of the trilinear field over two voxels, one-sided at the
    /// volume's sides. Not finite beside missing data.
    #[inline(always)]
    pub(crate) fn gradient(&self, at: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|a| {
            let here = at[a].max(0.0).min(self.shape.top[a]);
            let (below, above) = ((here - 1.0).max(0.0), (here + 1.0).min(self.shape.top[a]));
            if above <= below {
                return 0.0;
            }
            let value = |coordinate: f32| {
                let mut there = at;
                there[a] = coordinate;
                self.value(&self.shape.place(there))
            };
            (value(above) - value(below)) / (above - below)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(dims: [usize; 3]) -> Vec<f32> {
        let at = |i: usize| [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        (0..dims.iter().product()).map(at).map(|[x, y, z]| (x + 10 * y + 100 * z) as f32).collect()
    }

    #[test]
    fn a_linear_field_is_sampled_and_differentiated_exactly() {
        let dims = [7, 6, 5];
        let voxels = ramp(dims);
        let samples = Samples::new(&voxels, Shape::new(dims));
        for at in [[0.0_f32, 0.0, 0.0], [6.0, 5.0, 4.0], [2.25, 3.5, 1.125], [-0.4, 5.4, 4.49]] {
            let clamped = [at[0].clamp(0.0, 6.0), at[1].clamp(0.0, 5.0), at[2].clamp(0.0_f32, 4.0)];
            let value = samples.value(&samples.shape.place(at));
            assert!((value - (clamped[0] + 10.0 * clamped[1] + 100.0 * clamped[2])).abs() < 1e-3);
            let gradient = samples.gradient(at);
            for (g, e) in gradient.iter().zip([1.0, 10.0, 100.0]) {
                assert!((g - e).abs() < 1e-2, "{gradient:?} at {at:?}");
            }
        }
    }

    #[test]
    fn axes_of_one_voxel_are_constant() {
        let voxels = [3_u8, 5];
        let samples = Samples::new(&voxels, Shape::new([1, 2, 1]));
        assert_eq!(samples.value(&samples.shape.place([0.4, 0.5, -0.3])), 4.0);
        assert_eq!(samples.gradient([0.0, 0.5, 0.0]), [0.0, 2.0, 0.0]);
    }

    #[test]
    fn the_nearest_voxel_is_found_up_to_the_sides() {
        let shape = Shape::new([4, 3, 2]);
        assert_eq!(shape.nearest(&shape.place([3.4, -0.5, 0.6])), 3 + 12);
        assert_eq!(shape.nearest(&shape.place([1.4, 1.6, 0.0])), 1 + 4 * 2);
    }
}
