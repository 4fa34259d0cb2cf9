//! One slice of a volume.

use ivd_core::{ParamError, Volume};

use super::params::{ContourParams, SliceAxis};
use crate::Error;
use crate::component::seed_voxel;

/// Values of a slice, and the circle on it.
pub(super) struct Slice {
    axis: usize,
    number: usize,
    /// Voxels along the two axes of the slice, the faster one first.
    pub(super) size: [usize; 2],
    /// Edges of a voxel along these (mm).
    pub(super) edges: [f64; 2],
    /// Real values; NaN without data.
    pub(super) values: Vec<f64>,
    /// Middle of the circle (voxels), and its radius (mm).
    pub(super) middle: [f64; 2],
    pub(super) radius: f64,
}

impl Slice {
    /// The slice that is asked for.
    ///
    /// # Errors
    /// A slice or a seed outside the volume, a slice without two values.
    pub(super) fn of(volume: &Volume, params: &ContourParams) -> Result<Self, Error> {
        let grid = volume.grid();
        let dims = grid.dims();
        let axis = match params.axis {
            SliceAxis::X => 0,
            SliceAxis::Y => 1,
            SliceAxis::Z => 2,
        };
        let [a, b] = [[1, 2], [0, 2], [0, 1]][axis];
        let seed = params.seed.map(|seed| seed_voxel(volume, seed)).transpose()?;
        let number = match params.slice {
            Some(number) if (number as usize) < dims[axis] => number as usize,
            Some(number) => {
                let problem = format!("{number} is none of the {} slices", dims[axis]);
                return Err(ParamError::new("slice", problem, format!("give 0 … {}", dims[axis] - 1)).into());
            }
            None => seed.map_or(dims[axis] / 2, |seed| seed[axis]),
        };
        let edges = [a, b].map(|axis| grid.spacing()[axis]);
        let size = [dims[a], dims[b]];
        let stride = [1, dims[0], dims[0] * dims[1]];
        let values: Vec<f64> = (0..size[0] * size[1])
            .map(|i| {
                let at = stride[axis] * number + stride[a] * (i % size[0]) + stride[b] * (i / size[0]);
                let value = volume.real(volume.voxels().get(at));
                if value.is_finite() { value } else { f64::NAN }
            })
            .collect();
        let ends = values
            .iter()
            .filter(|v| !v.is_nan())
            .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, v| [ends[0].min(*v), ends[1].max(*v)]);
        if ends[0] >= ends[1] {
            let problem = format!("slice {number} has one value only");
            return Err(Error::no_boundary(problem, "choose another slice"));
        }
        let shorter = (size[0] as f64 * edges[0]).min(size[1] as f64 * edges[1]);
        Ok(Self {
            axis,
            number,
            size,
            edges,
            values,
            middle: seed
                .map_or(size.map(|n| (n as f64 - 1.0) / 2.0), |seed| [seed[a] as f64, seed[b] as f64]),
            radius: params.radius.unwrap_or(0.2 * shorter),
        })
    }

    /// Which voxels lie in the circle.
    pub(super) fn circle(&self) -> Vec<bool> {
        (0..self.values.len())
            .map(|i| {
                let at = [(i % self.size[0]) as f64, (i / self.size[0]) as f64];
                let away = [0, 1].map(|a| (at[a] - self.middle[a]) * self.edges[a]);
                away[0].hypot(away[1]) <= self.radius || at == self.middle.map(f64::round)
            })
            .collect()
    }

    /// A set of the slice as one of the volume.
    pub(super) fn into_volume(self, inside: &[u8], dims: [usize; 3]) -> Vec<u8> {
        let mut all = vec![0_u8; dims.iter().product()];
        let stride = [1, dims[0], dims[0] * dims[1]];
        let [a, b] = [[1, 2], [0, 2], [0, 1]][self.axis];
        for (i, &inside) in inside.iter().enumerate() {
            let at = [i % self.size[0], i / self.size[0]];
            all[stride[self.axis] * self.number + stride[a] * at[0] + stride[b] * at[1]] =
                u8::from(inside != 0 && !self.values[i].is_nan());
        }
        all
    }
}
