//! Operands as the first one's grid meets them.

use std::borrow::Cow;

use ivd_core::{Displacement, Exec, Grid, NO_BRICK, Scalar, Volume, parallel, with_voxels};
use nalgebra::{Matrix3, Vector3};

use super::operand::Operand;
use super::params::Window;
use crate::Error;
use crate::warp::{self, Order, Slabs, Source, WarpParams, check_grid, stored_background};

/// Slices of a slab: those of a layer of bricks.
pub(super) const SIDE: usize = 8;

/// Where an operand's voxels are, seen from the first operand's grid.
pub(super) enum Place<'a> {
    /// At the same places.
    Here,
    /// At the same places once they are deformed. `background`: a stored value.
    Through { displacement: &'a Displacement, background: f64 },
    /// Elsewhere: from voxels of the first operand's grid to voxel coordinates of a grid of `dims` voxels.
    Elsewhere { linear: Matrix3<f64>, offset: Vector3<f64>, dims: [usize; 3] },
}

impl<'a> Place<'a> {
    /// The place of an operand on `grid`, seen from `first`. Where it is elsewhere, whoever has a displacement deforms it before.
    pub(super) fn new(
        first: &Grid,
        grid: &Grid,
        displacement: Option<&'a Displacement>,
        what: &'static str,
        background: f64,
    ) -> Result<Self, Error> {
        if let Some(displacement) = displacement {
            check_grid(grid, displacement, what)?;
        }
        if !grid.matches(first) {
            let inverse = grid.inverse_linear_part();
            let offset = inverse * (Vector3::from(first.origin()) - Vector3::from(grid.origin()));
            let linear = inverse * first.linear_part();
            return Ok(Self::Elsewhere { linear, offset, dims: grid.dims() });
        }
        Ok(displacement.map_or(Self::Here, |displacement| Self::Through { displacement, background }))
    }

    pub(super) fn is_elsewhere(&self) -> bool {
        matches!(self, Self::Elsewhere { .. })
    }

    /// Slab `bz` of an operand on the first one's grid, of `dims` voxels, as stored.
    pub(super) fn slab<'v, T: Scalar>(
        &self,
        dims: [usize; 3],
        voxels: &'v [T],
        bz: usize,
        order: Order,
        simd: bool,
    ) -> Cow<'v, [T]> {
        if let Self::Through { displacement, background } = self {
            let background = T::from_f64(*background);
            return Slabs { voxels, displacement, order, background, simd }.slab(bz).into();
        }
        let slice = dims[0] * dims[1];
        Cow::from(&voxels[slice * SIDE * bz..slice * (SIDE * (bz + 1)).min(dims[2])])
    }
}

/// Fills a stretch of a row with real values, NaN where there is no data: from its first voxel on, its slab's slices counted
/// from 0.
pub(super) type Row<'a> = Box<dyn Fn([usize; 3], &mut [f64]) + 'a>;

/// A volume that is read as the first one's grid meets it.
pub(super) struct Read<'a> {
    pub(super) volume: Cow<'a, Volume>,
    pub(super) window: Window,
    place: Place<'a>,
    /// Voxels of the first one's grid.
    dims: [usize; 3],
    simd: bool,
}

impl<'a> Read<'a> {
    /// Operand `n`, counted from 0, as seen from `first`.
    pub(super) fn new(
        operand: &Operand<'a, Volume>,
        n: usize,
        first: &Grid,
        window: Option<Window>,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let params = WarpParams::default();
        let (mut volume, mut place) = (Cow::Borrowed(operand.value), Place::Here);
        match operand.displacement {
            Some(displacement) if operand.value.grid().matches(first) => {
                check_grid(operand.value.grid(), displacement, "volume")?;
                let background = stored_background(operand.value, displacement, &params);
                place = Place::new(first, volume.grid(), Some(displacement), "volume", background)?;
            }
            Some(displacement) => {
                volume = Cow::Owned(warp::volume(operand.value, displacement, &params, exec)?.output);
                place = Place::new(first, volume.grid(), None, "volume", 0.0)?;
            }
            None if !operand.value.grid().matches(first) => {
                place = Place::new(first, volume.grid(), None, "volume", 0.0)?;
            }
            None => {}
        }
        let mut read = Self { volume, window: Window::UNIT, place, dims: first.dims(), simd: exec.simd };
        read.window = match window {
            Some(window) => window,
            None => Window::of_range(read.range(exec)?, n)?,
        };
        Ok(read)
    }

    /// Smallest and largest real value, of the deformed volume where it is deformed.
    fn range(&self, exec: &Exec) -> Result<Option<[f64; 2]>, Error> {
        if !matches!(self.place, Place::Through { .. }) {
            return Ok(self.volume.range());
        }
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let [lo, hi] = with_voxels!(self.volume.voxels(), slice => {
            parallel::try_map(parallel::pieces(self.dims[2], SIDE), &|bz| {
                exec.check_cancelled()?;
                let slab = self.slab(slice, bz);
                let data = slab.iter().filter(|v| v.is_data());
                Ok::<_, Error>(data.fold(none, |all, v| join(all, [v.to_f64(); 2])))
            })?
        })
        .into_iter()
        .fold(none, join);
        let [a, b] = [lo, hi].map(|stored| self.volume.real(stored));
        Ok((lo <= hi).then_some([a.min(b), a.max(b)]))
    }

    /// Slab `bz`, as stored.
    pub(super) fn slab<'v, T: Scalar>(&self, voxels: &'v [T], bz: usize) -> Cow<'v, [T]> {
        self.place.slab(self.dims, voxels, bz, Order::Linear, self.simd)
    }

    /// What reads rows of slab `bz`.
    pub(super) fn rows(&self, bz: usize) -> Row<'_> {
        let (slope, intercept, [nx, ny, _]) = (self.volume.slope(), self.volume.intercept(), self.dims);
        with_voxels!(self.volume.voxels(), voxels => {
            if let Place::Elsewhere { linear, offset, dims } = &self.place {
                let source = Source { voxels, dims: *dims };
                return Box::new(move |[x, y, z], out| {
                    for (i, out) in out.iter_mut().enumerate() {
                        let voxel = Vector3::new((x + i) as f64, y as f64, (SIDE * bz + z) as f64);
                        let stored = source.sample((linear * voxel + offset).into(), Order::Linear);
                        *out = stored.map_or(f64::NAN, |stored| slope * stored + intercept);
                    }
                });
            }
            let slab = self.slab(voxels, bz);
            Box::new(move |[x, y, z], out| {
                let first = x + nx * (y + ny * z);
                for (out, stored) in out.iter_mut().zip(&slab[first..]) {
                    *out = if stored.is_data() { slope * stored.to_f64() + intercept } else { f64::NAN };
                }
            })
        })
    }

    /// Between what the opacities of a brick of the first one's grid lie; 0 to 1 where nothing is known.
    pub(super) fn bounds(&self, brick: [usize; 3]) -> [f64; 2] {
        let bricks = self.dims.map(|n| n.div_ceil(SIDE));
        let index = brick[0] + bricks[0] * (brick[1] + bricks[1] * brick[2]);
        match &self.place {
            Place::Through { displacement, .. }
                if !displacement.vacated().is_empty()
                    || displacement.inverse().table()[index] != NO_BRICK =>
            {
                [0.0, 1.0]
            }
            Place::Elsewhere { linear, offset, dims } => {
                if self.misses(linear, offset, *dims, brick) {
                    [0.0; 2]
                } else {
                    [0.0, 1.0]
                }
            }
            _ => {
                let range = self.volume.bricks().range(index);
                if range.min > range.max {
                    return [0.0; 2];
                }
                let real = |stored: f32| self.window.opacity(self.volume.real(f64::from(stored)));
                let [a, b] = [real(range.min), real(range.max)];
                [if range.missing { 0.0 } else { a.min(b) }, a.max(b)]
            }
        }
    }

    /// Whether the voxels of a brick all lie outside the operand's own grid.
    fn misses(
        &self,
        linear: &Matrix3<f64>,
        offset: &Vector3<f64>,
        dims: [usize; 3],
        brick: [usize; 3],
    ) -> bool {
        let [mut low, mut high] = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
        for corner in 0..8_usize {
            let voxel = Vector3::from_fn(|a, _| {
                let end = if corner >> a & 1 == 0 { SIDE * brick[a] } else { SIDE * (brick[a] + 1) };
                end.min(self.dims[a] - 1) as f64
            });
            let place = linear * voxel + offset;
            (low, high) = (low.inf(&place), high.sup(&place));
        }
        // Half a voxel is the grid's own extent; the rest is room for rounding.
        (0..3).any(|a| high[a] < -1.0 || low[a] > dims[a] as f64)
    }
}
