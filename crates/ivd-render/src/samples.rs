//! Trilinear samples of the stored voxels: the innermost kernel, with unchecked gathers.
//!
//! The argument for the `unsafe` blocks: [`Top`] never exceeds 2³⁰ and [`Top::clamp`] brings any number, NaN too, into `0 ..= top`, so that it converts to
//! an `i32`. [`Shape::place`], the only maker of a [`Place`], thereby finds a cell of at most `n - 2` along each axis (0 for one voxel), so that the cell's
//! first voxel plus the steps `next` along any of the axes is a voxel of the grid; [`Samples::new`] asserts that there is a value for each voxel of its own shape,
//! and [`Samples::value`] that the place is one of that shape (in debug builds; a renderer has one shape). Checking eight
//! indices a sample costs about a third of the time of a picture.

use std::borrow::Cow;

use ivd_core::{Error, Exec, Scalar, Volume, Voxels, parallel, with_voxels};

use crate::cell::mix;

/// Voxels that are converted at a time.
const PIECE: usize = 1 << 16;

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
pub(crate) enum KernelVoxels<'a> {
    U8(&'a [u8]),
    U16(&'a [u16]),
    I16(&'a [i16]),
    F32(Cow<'a, [f32]>),
}

/// The voxels of a volume for the kernels, and the shift from fast to stored values. Wide types are taken about the middle of their
/// range, so that an offset costs no precision.
pub(crate) fn fast<'a>(volume: &'a Volume, exec: &Exec) -> Result<(KernelVoxels<'a>, f64), Error> {
    Ok(match volume.voxels() {
        Voxels::U8(buffer) => (KernelVoxels::U8(buffer), 0.0),
        Voxels::U16(buffer) => (KernelVoxels::U16(buffer), 0.0),
        Voxels::I16(buffer) => (KernelVoxels::I16(buffer), 0.0),
        Voxels::F32(buffer) => (KernelVoxels::F32(Cow::Borrowed(buffer)), 0.0),
        wide => {
            exec.check_memory("voxels converted for rendering", 4 * wide.len() as u64)?;
            let shift = volume.bricks().total().map_or(0.0, |(lo, hi)| 0.5 * (f64::from(lo) + f64::from(hi)));
            let converted: Vec<f32> = with_voxels!(wide, stored => {
                let mut converted = vec![0.0; stored.len()];
                parallel::for_each_piece_mut(&mut converted, PIECE, &|i, out| {
                    for (out, v) in out.iter_mut().zip(&stored[i * PIECE..]) {
                        *out = (v.to_f64() - shift) as f32;
                    }
                });
                converted
            });
            (KernelVoxels::F32(Cow::Owned(converted)), shift)
        }
    })
}

/// Upper end of a range of numbers that convert to whole ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Top(f32);

impl Top {
    /// `top`, at most 2³⁰.
    pub(crate) fn new(top: f32) -> Self {
        Self(top.clamp(0.0, (1 << 30) as f32))
    }

    /// The top itself.
    pub(crate) fn number(self) -> f32 {
        self.0
    }

    /// The number in `0 ..= top` nearest to `x`; 0 for NaN. Comparisons rather than `max` and `min`: one instruction each.
    #[inline(always)]
    fn clamp(self, x: f32) -> f32 {
        let low = if x > 0.0 { x } else { 0.0 };
        if low < self.0 { low } else { self.0 }
    }

    /// The whole part of the number in `0 ..= top` nearest to `x`.
    #[inline(always)]
    pub(crate) fn whole(self, x: f32) -> usize {
        // SAFETY: `0 ..= 2³⁰` lies in an `i32`.
        unsafe { self.clamp(x).to_int_unchecked::<i32>() as usize }
    }
}

/// The cell that a voxel coordinate lies in, and where in it (0…1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    cell: [usize; 3],
    within: [f32; 3],
}

impl Place {
    /// The cell's first voxel.
    #[inline(always)]
    pub(crate) fn cell(&self) -> [usize; 3] {
        self.cell
    }

    /// Where in the cell (0…1).
    #[inline(always)]
    pub(crate) fn within(&self) -> [f32; 3] {
        self.within
    }
}

/// Shape of the voxel grid, for finding cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape {
    pub(crate) dims: [usize; 3],
    /// The number just below the last voxel's coordinate, which is in the last cell.
    top: [Top; 3],
    /// The last voxel's coordinate.
    end: [Top; 3],
    /// Distance in memory to the next voxel along each axis; 0 along an axis of one voxel.
    next: [usize; 3],
}

impl Shape {
    pub(crate) fn new(dims: [usize; 3]) -> Self {
        let strides = [1, dims[0], dims[0] * dims[1]];
        Self {
            dims,
            top: dims.map(|n| Top::new(if n > 1 { ((n - 1) as f32).next_down() } else { 0.0 })),
            end: dims.map(|n| Top::new((n - 1) as f32)),
            next: std::array::from_fn(|a| if dims[a] > 1 { strides[a] } else { 0 }),
        }
    }

    /// The cell of a voxel coordinate; beyond the outermost voxel centres the nearest place between them.
    #[inline(always)]
    pub(crate) fn place(&self, at: [f32; 3]) -> Place {
        let cell: [usize; 3] = std::array::from_fn(|a| self.top[a].whole(at[a]));
        let within = std::array::from_fn(|a| self.end[a].clamp(at[a]) - cell[a] as i32 as f32);
        Place { cell, within }
    }

    /// The greatest coordinate whose whole part is a cell, and the last voxel's coordinate, along each axis.
    pub(crate) fn ends(&self) -> [[f32; 3]; 2] {
        [self.top.map(Top::number), self.end.map(Top::number)]
    }

    /// Distance in memory to the next voxel along each axis.
    pub(crate) fn next(&self) -> [usize; 3] {
        self.next
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
        (0..3).all(|a| at[a] >= -0.5 && at[a] <= self.dims[a] as f32 - 0.5)
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
        debug_assert!(base + dx + dy + dz < self.voxels.len(), "a place of this shape");
        let [fx, fy, fz] = place.within;
        let along = |i: usize| {
            // SAFETY: a voxel of the grid and its neighbour along x; see the module's head.
            let (a, b) = unsafe {
                (
                    self.voxels.get_unchecked(base + i).single(),
                    self.voxels.get_unchecked(base + i + dx).single(),
                )
            };
            mix(a, b, fx)
        };
        mix(mix(along(0), along(dy), fy), mix(along(dz), along(dz + dy), fy), fz)
    }

    /// Gradient per voxel at a coordinate: central differences of the trilinear field over two voxels, one-sided at the
    /// volume's sides. Not finite beside missing data.
    #[inline(always)]
    pub(crate) fn gradient(&self, at: [f32; 3]) -> [f32; 3] {
        let place = self.shape.place(at);
        let deep = |a: usize| place.cell[a].wrapping_sub(1) < self.shape.dims[a].saturating_sub(3);
        if deep(0) && deep(1) && deep(2) { self.gradient_inside(&place) } else { self.gradient_anywhere(at) }
    }

    /// The gradient where the cell has a cell on every side. The difference of two trilinear values two voxels apart is the trilinear value of the differences at the
    /// cell's corners, which share 32 voxels.
    #[inline(always)]
    fn gradient_inside(&self, place: &Place) -> [f32; 3] {
        let [_, dy, dz] = self.shape.next;
        let first = self.shape.base(place.cell) - 1 - dy - dz;
        debug_assert!(first + 3 + 3 * dy + 3 * dz < self.voxels.len());
        // SAFETY: the cell lies in 1 ..= n - 3 along every axis, so that the voxels −1 ..= 2 around it exist.
        let at = |x: usize, y: usize, z: usize| unsafe {
            self.voxels.get_unchecked(first + x + y * dy + z * dz).single()
        };
        let [fx, fy, fz] = place.within;
        let rise = |below: f32, above: f32| 0.5 * (above - below);
        let along_x =
            |y: usize, z: usize| mix(rise(at(0, y, z), at(2, y, z)), rise(at(1, y, z), at(3, y, z)), fx);
        let along_y =
            |x: usize, z: usize| mix(rise(at(x, 0, z), at(x, 2, z)), rise(at(x, 1, z), at(x, 3, z)), fy);
        let along_z =
            |x: usize, y: usize| mix(rise(at(x, y, 0), at(x, y, 2)), rise(at(x, y, 1), at(x, y, 3)), fz);
        [
            mix(mix(along_x(1, 1), along_x(2, 1), fy), mix(along_x(1, 2), along_x(2, 2), fy), fz),
            mix(mix(along_y(1, 1), along_y(2, 1), fx), mix(along_y(1, 2), along_y(2, 2), fx), fz),
            mix(mix(along_z(1, 1), along_z(2, 1), fx), mix(along_z(1, 2), along_z(2, 2), fx), fy),
        ]
    }

    /// The gradient anywhere: the plain twin, from six trilinear values.
    #[inline(never)]
    fn gradient_anywhere(&self, at: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|a| {
            let top = (self.shape.dims[a] - 1) as f32;
            let here = at[a].max(0.0).min(top);
            let (below, above) = ((here - 1.0).max(0.0), (here + 1.0).min(top));
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
    fn the_gradient_of_shared_voxels_equals_that_of_six_values() {
        let dims = [9, 8, 7];
        let voxels: Vec<u16> =
            (0..9 * 8 * 7_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as u16).collect();
        let samples = Samples::new(&voxels, Shape::new(dims));
        for i in 0..500_u32 {
            let unit = |salt: u32| (i * 3 + salt).wrapping_mul(2_246_822_519) as f32 / 2_f32.powi(32);
            let at = [9.0 * unit(0) - 0.5, 8.0 * unit(1) - 0.5, 7.0 * unit(2) - 0.5];
            let (fast, plain) = (samples.gradient(at), samples.gradient_anywhere(at));
            for (f, p) in fast.iter().zip(plain) {
                assert!((f - p).abs() < 2e-2, "{fast:?} for {plain:?} at {at:?}");
            }
        }
    }

    #[test]
    fn coordinates_that_are_no_numbers_stay_inside() {
        let voxels = ramp([4, 5, 6]);
        let samples = Samples::new(&voxels, Shape::new([4, 5, 6]));
        for at in [[f32::NAN; 3], [f32::INFINITY; 3], [f32::NEG_INFINITY; 3], [f32::MAX; 3], [-f32::MAX; 3]] {
            let place = samples.shape.place(at);
            assert!((0..3).all(|a| place.cell[a] + 2 <= samples.shape.dims[a]));
            assert!(samples.value(&place).is_finite());
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
