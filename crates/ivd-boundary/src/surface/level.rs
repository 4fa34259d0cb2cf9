//! One resolution of a volume, read a row or a brick at a time, and the next coarser one.

use ivd_core::{BRICK, Error, Exec, Scalar, Volume, parallel, with_voxels};

use crate::axes::{edges_along_axes, mean_edge};

/// Voxels of a brick.
pub(super) const CUBE: usize = BRICK * BRICK * BRICK;

/// Where a voxel lies within its brick.
#[inline]
pub(super) fn within_brick(i: usize) -> [usize; 3] {
    [i % BRICK, i / BRICK % BRICK, i / (BRICK * BRICK)]
}

/// From real values to those that are worked on: about 0 … 1 over what there is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unit {
    /// Real value that becomes 0.
    pub(super) zero: f64,
    /// Real units that become 1.
    pub(super) one: f64,
    /// Values beyond are taken as these.
    pub(super) window: Option<[f64; 2]>,
}

impl Unit {
    /// Of a volume's values, or of the window that they are seen through. `None` without data, or where all are equal.
    pub(super) fn of(volume: &Volume, window: Option<[f64; 2]>) -> Option<Self> {
        let [mut low, mut high] = volume.range()?;
        if let Some([from, to]) = window {
            low = low.clamp(from, to);
            high = high.clamp(from, to);
        }
        let one = high - low;
        (one > 0.0 && one.is_finite()).then_some(Self { zero: low, one, window })
    }

    /// The real value of one in these units.
    pub(super) fn real(&self, value: f64) -> f64 {
        self.zero + value * self.one
    }
}

/// Values on a grid of some resolution; voxels without data are NaN.
pub(super) struct Level<'a> {
    pub(super) dims: [usize; 3],
    /// Voxels of the finest level along each axis of a voxel here.
    pub(super) factor: [usize; 3],
    /// Edges of a voxel (mm).
    pub(super) edges: [f64; 3],
    /// Steepness (values per mm) at which area weighs half, where it weighs less in steep places.
    pub(super) edge: Option<f64>,
    values: Values<'a>,
}

enum Values<'a> {
    Stored(&'a Volume, Unit),
    Means(Vec<f32>),
}

impl<'a> Level<'a> {
    /// The volume itself.
    pub(super) fn finest(volume: &'a Volume, unit: Unit, edge: Option<f64>) -> Self {
        let grid = volume.grid();
        let edge = edge.map(|edge| edge / unit.one);
        let values = Values::Stored(volume, unit);
        Self { dims: grid.dims(), factor: [1; 3], edges: grid.spacing(), edge, values }
    }

    /// Voxels of the finest level by axis, but for those that make up the last voxel here.
    fn finest_dims(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.dims[a] * self.factor[a])
    }

    /// Shortest edge of a voxel (mm), of the volume's axes of more than one voxel.
    pub(super) fn finest_edge(&self) -> f64 {
        edges_along_axes(self.finest_dims(), self.edges).fold(f64::INFINITY, f64::min)
    }

    /// Edges of a voxel (mm), with the shortest in place of that along an axis of one voxel, where there is no step.
    pub(super) fn edges_of_axes(&self) -> [f64; 3] {
        let (dims, finest) = (self.finest_dims(), self.finest_edge());
        std::array::from_fn(|a| if dims[a] > 1 { self.edges[a] } else { finest })
    }

    /// The volume's axes of more than one voxel; three where there is no such axis.
    pub(super) fn axes(&self) -> usize {
        edges_along_axes(self.finest_dims(), self.edges).count()
    }

    /// Mean edge of a voxel (mm), of the volume's axes of more than one voxel.
    pub(super) fn mean_edge(&self) -> f64 {
        mean_edge(self.finest_dims(), self.edges)
    }

    /// The same of the finest level.
    pub(super) fn mean_edge_of_finest(&self) -> f64 {
        let edges = std::array::from_fn(|a| self.edges[a] / self.factor[a] as f64);
        mean_edge(self.finest_dims(), edges)
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// Number of bricks by axis.
    pub(super) fn bricks(&self) -> [usize; 3] {
        self.dims.map(|n| n.div_ceil(BRICK))
    }

    /// The values from a voxel on.
    pub(super) fn row(&self, first: usize, out: &mut [f32]) {
        match &self.values {
            Values::Means(means) => out.copy_from_slice(&means[first..first + out.len()]),
            Values::Stored(volume, unit) => {
                let scale = 1.0 / unit.one;
                let value = |real: f64| ((real - unit.zero) * scale) as f32;
                with_voxels!(volume.voxels(), voxels => {
                    let stored = out.iter_mut().zip(&voxels[first..]);
                    let Some([low, high]) = unit.window else {
                        for (out, stored) in stored {
                            let value = value(volume.real(stored.to_f64()));
                            *out = if stored.is_data() { value } else { f32::NAN };
                        }
                        return;
                    };
                    for (out, stored) in stored {
                        let value = value(volume.real(stored.to_f64()).clamp(low, high));
                        *out = if stored.is_data() { value } else { f32::NAN };
                    }
                });
            }
        }
    }

    /// The values of a brick; NaN beyond the volume too.
    pub(super) fn brick(&self, brick: [usize; 3], out: &mut [f32; CUBE]) {
        let [nx, ny, nz] = self.dims;
        let [x, y, z] = brick.map(|b| b * BRICK);
        let width = BRICK.min(nx - x);
        let whole = brick.iter().zip(self.dims).all(|(b, n)| (b + 1) * BRICK <= n);
        if !whole {
            out.fill(f32::NAN);
        }
        for dz in 0..BRICK.min(nz - z) {
            for dy in 0..BRICK.min(ny - y) {
                let to = BRICK * (dy + BRICK * dz);
                self.row(x + nx * (y + dy + ny * (z + dz)), &mut out[to..to + width]);
            }
        }
    }

    /// Share of its weight that area has at each voxel of a brick: 1 / (1 + (steepness / edge)²), by differences of neighbours; beside the
    /// volume's border and voxels without data of the voxel itself.
    pub(super) fn softness(&self, brick: [usize; 3], edge: f64) -> [f32; CUBE] {
        const WIDE: usize = BRICK + 2;
        let dims = self.dims;
        let mut values = vec![f32::NAN; WIDE * WIDE * WIDE];
        let low = brick.map(|b| b * BRICK);
        let rows = |a: usize| low[a].saturating_sub(1)..(low[a] + BRICK + 1).min(dims[a]);
        let xs = rows(0);
        for z in rows(2) {
            for y in rows(1) {
                let to = (xs.start + 1 - low[0]) + WIDE * ((y + 1 - low[1]) + WIDE * (z + 1 - low[2]));
                self.row(xs.start + dims[0] * (y + dims[1] * z), &mut values[to..to + xs.len()]);
            }
        }
        std::array::from_fn(|i| {
            let at = within_brick(i).map(|v| v + 1);
            let own = at[0] + WIDE * (at[1] + WIDE * at[2]);
            let square: f64 = (0..3)
                .map(|a| {
                    let stride = WIDE.pow(a as u32);
                    let near = [values[own - stride], values[own + stride]];
                    let [before, after] = near.map(|v| if v.is_nan() { values[own] } else { v });
                    let steps = near.iter().filter(|v| !v.is_nan()).count().max(1);
                    (f64::from(after - before) / (steps as f64 * self.edges[a])).powi(2)
                })
                .sum();
            let half = (edge * edge).max(f64::MIN_POSITIVE);
            if square.is_nan() { 1.0 } else { (1.0 / (1.0 + square / half)) as f32 }
        })
    }

    /// The next coarser level: means over two voxels along every axis that is no coarser than 1.5 × the finest one.
    ///
    /// # Errors
    /// Memory, cancelled.
    pub(super) fn coarser(&self, exec: &Exec) -> Result<Level<'static>, Error> {
        let finest = self.finest_edge();
        let step: [usize; 3] =
            std::array::from_fn(|a| if self.dims[a] > 1 && self.edges[a] <= 1.5 * finest { 2 } else { 1 });
        let dims: [usize; 3] = std::array::from_fn(|a| self.dims[a].div_ceil(step[a]));
        let [nx, ny, nz] = self.dims;
        let layer = dims[0] * dims[1];
        exec.check_memory("a coarser level of the volume", (layer * dims[2] * 4) as u64)?;
        let mut means = vec![0.0_f32; layer * dims[2]];
        parallel::try_for_each_piece_mut(&mut means, layer, &|z, out| {
            exec.check_cancelled()?;
            let mut row = vec![0.0_f32; nx + 1];
            let mut sums = vec![[0.0_f32; 2]; dims[0]];
            for (y, out) in out.chunks_mut(dims[0]).enumerate() {
                sums.fill([0.0; 2]);
                for z in z * step[2]..((z + 1) * step[2]).min(nz) {
                    for y in y * step[1]..((y + 1) * step[1]).min(ny) {
                        self.row(nx * (y + ny * z), &mut row[..nx]);
                        row[nx] = f32::NAN;
                        add(&row, step[0], &mut sums);
                    }
                }
                for (out, [sum, count]) in out.iter_mut().zip(&sums) {
                    *out = if *count > 0.0 { sum / count } else { f32::NAN };
                }
            }
            Ok::<_, Error>(())
        })?;
        Ok(Level {
            dims,
            factor: std::array::from_fn(|a| self.factor[a] * step[a]),
            edges: std::array::from_fn(|a| self.edges[a] * step[a] as f64),
            edge: self.edge,
            values: Values::Means(means),
        })
    }
}

/// Adds a row, with a voxel without data at its end, to sums and counts of one or two voxels.
fn add(row: &[f32], step: usize, sums: &mut [[f32; 2]]) {
    let of = |i: usize, [sum, count]: &mut [f32; 2]| {
        let value = row[i];
        if !value.is_nan() {
            *sum += value;
            *count += 1.0;
        }
    };
    for (x, into) in sums.iter_mut().enumerate() {
        of(step * x, into);
        if step == 2 {
            of(2 * x + 1, into);
        }
    }
}

/// The levels that are worked on, the coarsest first: that has at most `whole` voxels, or can't be halved.
///
/// # Errors
/// Memory, cancelled.
pub(super) fn levels<'a>(finest: Level<'a>, whole: usize, exec: &Exec) -> Result<Vec<Level<'a>>, Error> {
    let mut levels = vec![finest];
    loop {
        let last = levels.last().expect("there is the finest");
        if last.len() <= whole {
            break;
        }
        let coarser = last.coarser(exec)?;
        if coarser.len() == last.len() {
            break;
        }
        levels.push(coarser);
    }
    levels.reverse();
    Ok(levels)
}
