//! The kernel density of every cell, as the height that its voxels climb.

use std::ops::Range;

use ivd_core::{Error, Exec, parallel};
use rayon::prelude::*;

use super::cells::{Cells, REACH};
use super::params::Kernel;

/// What cells climb: of the Gaussian the logarithm of the density, whose gradient is the mean shift itself; of the flat
/// kernel the density of its shadow. A density is a sum of kernel weights, so 1 for a lonely voxel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Heights {
    pub(super) of: Vec<f32>,
    pub(super) kernel: Kernel,
}

/// Height of a cell that no kernel reaches.
pub(super) const GROUND: f32 = f32::NEG_INFINITY;
/// Density below which a cell is passed over. A cell that holds a voxel has at least about 1.
const FAINT: f32 = 0.1;
const FAINT_LOGARITHM: f32 = -std::f32::consts::LN_10;
/// The least logarithm of a density, for slopes down to the ground.
const LEAST: f32 = -104.0;

impl Heights {
    /// Whether the cell matters: it holds a voxel, or lies where voxels nearby add up to a part of one's weight.
    #[inline]
    pub(super) fn reached(&self, cell: usize) -> bool {
        let least = if self.kernel == Kernel::Gaussian { FAINT_LOGARITHM } else { FAINT };
        self.of[cell] >= least
    }

    /// Height for slopes: never infinite.
    #[inline]
    pub(super) fn slope_height(&self, cell: usize) -> f64 {
        let least = if self.kernel == Kernel::Gaussian { LEAST } else { 0.0 };
        f64::from(self.of[cell].max(least))
    }

    /// The density at a height.
    pub(super) fn density(&self, height: f64) -> f64 {
        match self.kernel {
            Kernel::Gaussian => height.exp(),
            Kernel::Flat => height.max(0.0),
        }
    }
}

/// The heights of the cells that hold `counts` voxels.
pub(super) fn of(cells: &Cells, counts: &[u32], kernel: Kernel, exec: &Exec) -> Result<Heights, Error> {
    let mut density = match kernel {
        Kernel::Gaussian => gaussian(cells, counts, exec)?,
        Kernel::Flat => flat(cells, counts, exec)?,
    };
    density.par_iter_mut().for_each(|height| {
        *height = match (kernel, *height > 0.0) {
            (_, false) => GROUND,
            // Through twice the digits: the same on processors whose logarithms differ in the last one.
            (Kernel::Gaussian, true) => f64::from(*height).ln() as f32,
            (Kernel::Flat, true) => *height,
        }
    });
    Ok(Heights { of: density, kernel })
}

/// Weights of a Gaussian at 0, 1, 2, … cells. Voxels lie all over their cell, not at its middle, and that alone spreads them
/// by the variance of `per_cell` equal steps: the blur is narrower by as much (Sheppard 1898), and its weights sum to the same.
fn weights(sigma: f64, per_cell: f64) -> Vec<f32> {
    let spread = (1.0 - 1.0 / (per_cell * per_cell)) / 12.0;
    let narrow = (sigma * sigma - spread).max(0.25 * sigma * sigma).sqrt();
    let reach = (REACH * sigma).ceil() as usize;
    (0..=reach).map(|k| (sigma / narrow * (-0.5 * (k as f64 / narrow).powi(2)).exp()) as f32).collect()
}

/// Separable blur: along the value, x and y in place, along z from one array to another.
fn gaussian(cells: &Cells, counts: &[u32], exec: &Exec) -> Result<Vec<f32>, Error> {
    let [nx, ny, nz, range] = cells.dims;
    let along = |axis: usize| weights(cells.sigma[axis], cells.edge[axis] as f64);
    let value = weights(cells.sigma[3], f64::INFINITY);
    let mut blurred = vec![0_f32; cells.len()];
    parallel::try_for_each_piece_mut(&mut blurred, range * nx, &|i, row| {
        exec.check_cancelled()?;
        let counts = &counts[i * range * nx..];
        let mut padded = vec![0_f32; range + 2 * (value.len() - 1)];
        for (row, counts) in row.chunks_mut(range).zip(counts.chunks(range)) {
            blur_counts(counts, &value, &mut padded, row);
        }
        if nx > 1 {
            blur_rows(row, range, &along(0));
        }
        Ok::<_, Error>(())
    })?;
    if ny > 1 {
        let weights = along(1);
        parallel::try_for_each_piece_mut(&mut blurred, range * nx * ny, &|_, plane| {
            exec.check_cancelled()?;
            blur_rows(plane, range * nx, &weights);
            Ok::<_, Error>(())
        })?;
    }
    if nz == 1 {
        return Ok(blurred);
    }
    let weights = along(2);
    let mut out = vec![0_f32; cells.len()];
    // Parts of a layer, so that a few layers keep many threads busy.
    parallel::try_for_each_piece_mut(&mut out, range * nx, &|i, out| {
        exec.check_cancelled()?;
        let (y, z) = (i % ny, i / ny);
        let row = |z: usize| &blurred[range * nx * (y + ny * z)..][..range * nx];
        gather(out, z, nz, &weights, row);
        Ok::<_, Error>(())
    })?;
    Ok(out)
}

/// Copies the counts of one row of cells between `reach` empty cells on either side, and gives the cells that a kernel
/// reaches from an occupied one; `None`, and nothing is copied, where all are empty.
fn pad(counts: &[u32], reach: usize, padded: &mut [f32]) -> Option<Range<usize>> {
    let first = counts.iter().position(|n| *n > 0)?;
    let last = counts.iter().rposition(|n| *n > 0).expect("one isn't 0");
    let inner = &mut padded[reach..][..counts.len()];
    inner.iter_mut().zip(counts).for_each(|(to, n)| *to = *n as f32);
    Some(first.saturating_sub(reach)..(last + reach + 1).min(counts.len()))
}

/// Blurs the counts of one row of cells along the value.
fn blur_counts(counts: &[u32], weights: &[f32], padded: &mut [f32], out: &mut [f32]) {
    let reach = weights.len() - 1;
    let Some(reached) = pad(counts, reach, padded) else { return };
    let from = reached.start;
    let out = &mut out[reached];
    for (out, n) in out.iter_mut().zip(&padded[from + reach..]) {
        *out = weights[0] * n;
    }
    for (k, w) in weights.iter().enumerate().skip(1) {
        let below = &padded[from + reach - k..];
        let above = &padded[from + reach + k..];
        for ((out, below), above) in out.iter_mut().zip(below).zip(above) {
            *out += w * (below + above);
        }
    }
}

/// Blurs neighbouring stretches of `len` cells into each other, in place.
fn blur_rows(rows: &mut [f32], len: usize, weights: &[f32]) {
    let before = rows.to_vec();
    let count = rows.len() / len;
    for (at, out) in rows.chunks_mut(len).enumerate() {
        gather(out, at, count, weights, |i| &before[i * len..][..len]);
    }
}

/// Sum of `row(i)` over the neighbours `i` of `at`, of `count`, by their weights.
fn gather<'a>(out: &mut [f32], at: usize, count: usize, weights: &[f32], row: impl Fn(usize) -> &'a [f32]) {
    let add = |out: &mut [f32], i: usize, w: f32| {
        for (out, from) in out.iter_mut().zip(row(i)) {
            *out += w * from;
        }
    };
    out.fill(0.0);
    add(out, at, weights[0]);
    for (k, w) in weights.iter().enumerate().skip(1) {
        if let Some(below) = at.checked_sub(k) {
            add(out, below, *w);
        }
        if at + k < count {
            add(out, at + k, *w);
        }
    }
}

/// A row of cells at an offset in space, and what its cells weigh at each distance along the value.
struct Spoke {
    offset: [isize; 3],
    weights: Vec<f32>,
}

/// The shadow of the flat kernel over a ball of cells; it doesn't separate.
fn flat(cells: &Cells, counts: &[u32], exec: &Exec) -> Result<Vec<f32>, Error> {
    let [nx, ny, nz, range] = cells.dims;
    let spokes = spokes(cells);
    let reach = cells.sigma[3].ceil() as usize;
    let mut out = vec![0_f32; cells.len()];
    parallel::try_for_each_piece_mut(&mut out, range, &|i, out| {
        exec.check_cancelled()?;
        let at = [i % nx, i / nx % ny, i / nx / ny].map(|v| v as isize);
        let mut padded = vec![0_f32; range + 2 * reach];
        for spoke in &spokes {
            let [x, y, z] = std::array::from_fn(|axis| at[axis] + spoke.offset[axis]);
            let within = |v: isize, n: usize| (0..n as isize).contains(&v);
            if within(x, nx) && within(y, ny) && within(z, nz) {
                let row = (z as usize * ny + y as usize) * nx + x as usize;
                add_spoke(&counts[row * range..][..range], &spoke.weights, reach, &mut padded, out);
            }
        }
        Ok::<_, Error>(())
    })?;
    Ok(out)
}

fn add_spoke(counts: &[u32], weights: &[f32], reach: usize, padded: &mut [f32], out: &mut [f32]) {
    let Some(reached) = pad(counts, reach, padded) else { return };
    let from = reached.start;
    let out = &mut out[reached];
    for (k, w) in weights.iter().enumerate() {
        let below = &padded[from + reach - k..];
        let above = &padded[from + reach + k..];
        let half = if k == 0 { 0.5 * w } else { *w };
        for ((out, below), above) in out.iter_mut().zip(below).zip(above) {
            *out += half * (below + above);
        }
    }
}

fn spokes(cells: &Cells) -> Vec<Spoke> {
    let reach = |axis: usize| if cells.dims[axis] > 1 { cells.sigma[axis].floor() as isize } else { 0 };
    let square = |k: isize, axis: usize| {
        if k == 0 { 0.0 } else { (k as f64 / cells.sigma[axis]).powi(2) }
    };
    let mut found = Vec::new();
    for z in -reach(2)..=reach(2) {
        for y in -reach(1)..=reach(1) {
            for x in -reach(0)..=reach(0) {
                let left = 1.0 - square(x, 0) - square(y, 1) - square(z, 2);
                let weights: Vec<f32> = (0..=cells.sigma[3].floor() as isize)
                    .map(|k| (left - square(k, 3)) as f32)
                    .take_while(|w| *w > 0.0)
                    .collect();
                if !weights.is_empty() {
                    found.push(Spoke { offset: [x, y, z], weights });
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blur_of_counts_is_the_gaussian_of_the_voxels() {
        for (sigma, per_cell) in [(2.0, 8.0), (3.0, 2.0), (1.0, 1.0)] {
            let blur = weights(sigma, per_cell);
            let sum = f64::from(blur[0]) + 2.0 * blur[1..].iter().map(|w| f64::from(*w)).sum::<f64>();
            let expected = sigma * (2.0 * std::f64::consts::PI).sqrt();
            assert!((sum / expected - 1.0).abs() < 2e-4, "{sum} for {expected}");
            // A smooth density of voxels, at so many places a cell.
            let voxels = |cell: i32| {
                let place = move |i: i32| f64::from(cell) + (f64::from(i) + 0.5) / per_cell - 0.5;
                (0..per_cell as i32).map(move |i| (place(i), (-0.5 * (place(i) / 2.5).powi(2)).exp()))
            };
            for at in 0..4 {
                let direct: f64 = (-30..=30)
                    .flat_map(voxels)
                    .map(|(place, n)| n * (-0.5 * ((place - f64::from(at)) / sigma).powi(2)).exp())
                    .sum();
                let cells = (-30..=30).map(|cell: i32| {
                    let weight = blur.get((cell - at).unsigned_abs() as usize).map_or(0.0, |w| f64::from(*w));
                    weight * voxels(cell).map(|(_, n)| n).sum::<f64>()
                });
                let blurred: f64 = cells.sum();
                assert!((blurred / direct - 1.0).abs() < 1e-3, "{blurred} for {direct}");
            }
        }
    }
}
