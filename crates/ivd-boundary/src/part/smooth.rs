//! The level function of a mask: a Gaussian of one voxel over it, less a half. Its zero passes through the steps of the voxels, where a
//! smooth border that these came from lies.

use ivd_core::{BRICK, Error, Exec, parallel};

/// Weights of a Gaussian of one voxel.
const REACH: usize = 3;

/// Values away from the border.
const FAR: f32 = 0.5;
/// Least distance from 0 on a voxel's own side.
const LEAST: f32 = 1e-3;

fn weights() -> [f32; 2 * REACH + 1] {
    let of = |i: usize| (-0.5 * (i as f64 - REACH as f64).powi(2)).exp();
    let sum: f64 = (0..=2 * REACH).map(of).sum();
    std::array::from_fn(|i| (of(i) / sum) as f32)
}

/// A level function, positive inside, whose sign is that of the mask. Beyond the volume the mask goes on as at its border.
///
/// # Errors
/// Memory, cancelled.
pub(crate) fn level(inside: &[u8], dims: [usize; 3], exec: &Exec) -> Result<Vec<f32>, Error> {
    exec.check_memory("the level function", 4 * inside.len() as u64)?;
    let [nx, ny, nz] = dims;
    let layer = nx * ny;
    let weights = weights();
    let mut out = vec![0.0_f32; inside.len()];
    parallel::try_for_each_piece_mut(&mut out, layer * BRICK, &|bz, out| {
        exec.check_cancelled()?;
        let layers = out.len() / layer;
        let mut room = Room::default();
        for by in 0..ny.div_ceil(BRICK) {
            for bx in 0..nx.div_ceil(BRICK) {
                let low = [bx * BRICK, by * BRICK, bz * BRICK];
                let size = [BRICK.min(nx - low[0]), BRICK.min(ny - low[1]), layers];
                let near =
                    |a: usize, n: usize| low[a].saturating_sub(REACH)..(low[a] + size[a] + REACH).min(n);
                let (xs, ys, zs) = (near(0, nx), near(1, ny), near(2, nz));
                let first = inside[xs.start + nx * (ys.start + ny * zs.start)];
                let alike = zs.clone().all(|z| {
                    ys.clone().all(|y| {
                        let row = nx * (y + ny * z);
                        inside[row + xs.start..row + xs.end].iter().all(|&v| v == first)
                    })
                });
                let smoothed = (!alike).then(|| room.smooth(inside, dims, low, size, &weights));
                for z in 0..size[2] {
                    for y in 0..size[1] {
                        let to = low[0] + nx * (low[1] + y) + layer * z;
                        let out = &mut out[to..to + size[0]];
                        let Some(smoothed) = &smoothed else {
                            out.fill(if first != 0 { FAR } else { -FAR });
                            continue;
                        };
                        let own = low[0] + nx * (low[1] + y + ny * (low[2] + z));
                        for (x, out) in out.iter_mut().enumerate() {
                            let value = smoothed[x + BRICK * (y + BRICK * z)] - 0.5;
                            *out = if inside[own + x] != 0 { value.max(LEAST) } else { value.min(-LEAST) };
                        }
                    }
                }
            }
        }
        Ok::<_, Error>(())
    })?;
    Ok(out)
}

const PADDED: usize = BRICK + 2 * REACH;

/// Room to smooth a brick in.
struct Room {
    padded: Vec<f32>,
    along_x: Vec<f32>,
    along_y: Vec<f32>,
}

impl Default for Room {
    fn default() -> Self {
        Self {
            padded: vec![0.0; PADDED * PADDED * PADDED],
            along_x: vec![0.0; BRICK * PADDED * PADDED],
            along_y: vec![0.0; BRICK * BRICK * PADDED],
        }
    }
}

impl Room {
    fn smooth(
        &mut self,
        inside: &[u8],
        [nx, ny, nz]: [usize; 3],
        low: [usize; 3],
        size: [usize; 3],
        weights: &[f32; 2 * REACH + 1],
    ) -> [f32; BRICK * BRICK * BRICK] {
        let clamped = |from: usize, i: usize, n: usize| (from + i).saturating_sub(REACH).min(n - 1);
        for z in 0..size[2] + 2 * REACH {
            for y in 0..size[1] + 2 * REACH {
                let row = nx * (clamped(low[1], y, ny) + ny * clamped(low[2], z, nz));
                for x in 0..size[0] + 2 * REACH {
                    self.padded[x + PADDED * (y + PADDED * z)] =
                        f32::from(inside[row + clamped(low[0], x, nx)]);
                }
            }
        }
        for (row, out) in self.padded.chunks(PADDED).zip(self.along_x.chunks_mut(BRICK)) {
            weigh(out, weights, |i| &row[i..]);
        }
        for (z, layer) in self.along_y.chunks_mut(BRICK * BRICK).enumerate() {
            for (y, out) in layer.chunks_mut(BRICK).enumerate() {
                weigh(out, weights, |i| &self.along_x[BRICK * (y + i + PADDED * z)..]);
            }
        }
        let mut out = [0.0; BRICK * BRICK * BRICK];
        for (row, out) in out.chunks_mut(BRICK).enumerate() {
            weigh(out, weights, |i| &self.along_y[BRICK * row + BRICK * BRICK * i..]);
        }
        out
    }
}

/// A row of weighted sums of rows.
#[inline(always)]
fn weigh<'a>(out: &mut [f32], weights: &[f32; 2 * REACH + 1], row: impl Fn(usize) -> &'a [f32]) {
    let mut sums = [0.0_f32; BRICK];
    for (i, weight) in weights.iter().enumerate() {
        for (sum, value) in sums.iter_mut().zip(&row(i)[..BRICK]) {
            *sum += weight * value;
        }
    }
    out.copy_from_slice(&sums);
}
