//! Meyer's flooding: the volume's gradient as a land that fills from the seeds.

use ivd_core::{Exec, Scalar, Volume, parallel, with_voxels};

use crate::Error;

/// Heights of the land: magnitudes are told apart in this many steps.
const HEIGHTS: usize = 1 << 12;
/// Share of the voxels that aren't flat whose gradients are less than the greatest height.
const SEEN: f64 = 0.998;

/// The seed of each voxel.
///
/// # Errors
/// Memory, cancelled.
pub(super) fn flood(
    volume: &Volume,
    seeds: &[u16],
    blocked: Option<&[u8]>,
    window: Option<[f64; 2]>,
    exec: &Exec,
) -> Result<Vec<u16>, Error> {
    let dims = volume.grid().dims();
    exec.check_memory("the gradient's heights", 12 * seeds.len() as u64)?;
    let heights = heights(volume, window, exec)?;
    let mut ids = seeds.to_vec();
    let closed = |i: usize| heights[i] == CLOSED || blocked.is_some_and(|blocked| blocked[i] != 0);
    (0..ids.len()).filter(|&i| closed(i)).for_each(|i| ids[i] = 0);
    let mut queues: Vec<Vec<u32>> = vec![Vec::new(); HEIGHTS];
    // A voxel is queued once: by whoever comes to it first.
    for i in 0..ids.len() {
        if ids[i] != 0 {
            queues[0].push(i as u32);
        }
    }
    let mut height = 0;
    let mut next: Vec<u32> = Vec::new();
    while height < HEIGHTS {
        // Those of one height in the order in which they were reached.
        std::mem::swap(&mut next, &mut queues[height]);
        if next.is_empty() {
            height += 1;
            continue;
        }
        exec.check_cancelled()?;
        for &i in &next {
            let i = i as usize;
            each_neighbour(i, dims, |j| {
                if ids[j] == 0 && !closed(j) {
                    ids[j] = ids[i];
                    queues[height.max(usize::from(heights[j]))].push(j as u32);
                }
            });
        }
        next.clear();
    }
    Ok(ids)
}

fn each_neighbour(i: usize, [nx, ny, nz]: [usize; 3], mut of: impl FnMut(usize)) {
    let (x, y, z) = (i % nx, i / nx % ny, i / nx / ny);
    if x > 0 {
        of(i - 1);
    }
    if x + 1 < nx {
        of(i + 1);
    }
    if y > 0 {
        of(i - nx);
    }
    if y + 1 < ny {
        of(i + nx);
    }
    if z > 0 {
        of(i - nx * ny);
    }
    if z + 1 < nz {
        of(i + nx * ny);
    }
}

/// Of voxels without data.
const CLOSED: u16 = u16::MAX;

/// Height of every voxel: the gradient's magnitude by central differences.
fn heights(volume: &Volume, window: Option<[f64; 2]>, exec: &Exec) -> Result<Vec<u16>, Error> {
    let grid = volume.grid();
    let [nx, ny, nz] = grid.dims();
    let layer = nx * ny;
    let edges = grid.spacing();
    let [low, high] = window.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let magnitudes: Vec<Vec<f32>> = parallel::try_map(nz, &|z| {
        exec.check_cancelled()?;
        Ok::<_, Error>(with_voxels!(volume.voxels(), voxels => {
            let value = |i: usize| -> f64 {
                let stored = voxels[i];
                if stored.is_data() { volume.real(stored.to_f64()).clamp(low, high) } else { f64::NAN }
            };
            let mut out = Vec::with_capacity(layer);
            for y in 0..ny {
                for x in 0..nx {
                    let i = x + nx * (y + ny * z);
                    let own = value(i);
                    if own.is_nan() {
                        out.push(f32::NAN);
                        continue;
                    }
                    let mut square = 0.0;
                    for (a, (c, n, stride)) in [(x, nx, 1), (y, ny, nx), (z, nz, layer)].into_iter().enumerate() {
                        let before = if c > 0 { value(i - stride) } else { own };
                        let after = if c + 1 < n { value(i + stride) } else { own };
                        let before = if before.is_nan() { own } else { before };
                        let after = if after.is_nan() { own } else { after };
                        square += ((after - before) / (2.0 * edges[a])).powi(2);
                    }
                    out.push(square.sqrt() as f32);
                }
            }
            out
        }))
    })?;
    // The steepest few are alike: a step of metal must not make all else flat. Flat places don't count: a part may be a small share.
    let mut some: Vec<f32> =
        magnitudes.iter().flatten().copied().filter(|m| *m > 0.0 && m.is_finite()).step_by(7).collect();
    let top = if some.is_empty() {
        1.0
    } else {
        let at = ((some.len() - 1) as f64 * SEEN) as usize;
        let (_, top, _) = some.select_nth_unstable_by(at, f32::total_cmp);
        *top
    };
    let highest = (HEIGHTS - 1) as f64;
    let height = |m: &f32| {
        if m.is_nan() { CLOSED } else { (f64::from(*m) / f64::from(top) * highest).min(highest) as u16 }
    };
    Ok(magnitudes.iter().flatten().map(height).collect())
}

#[cfg(test)]
mod tests {
    use std::cmp::Reverse;
    use std::collections::BinaryHeap;

    use ivd_core::{Grid, noise};

    use super::*;

    /// One voxel after the other, the lowest pass first, of equal ones the earlier.
    fn plain(heights: &[u16], seeds: &[u16], blocked: &[u8], dims: [usize; 3]) -> Vec<u16> {
        let mut ids = seeds.to_vec();
        let closed = |i: usize| heights[i] == CLOSED || blocked[i] != 0;
        (0..ids.len()).filter(|&i| closed(i)).for_each(|i| ids[i] = 0);
        let mut order = 0..;
        let mut heap: BinaryHeap<_> =
            (0..ids.len()).filter(|&i| ids[i] != 0).map(|i| Reverse((0, order.next(), i))).collect();
        while let Some(Reverse((height, _, i))) = heap.pop() {
            each_neighbour(i, dims, |j| {
                if ids[j] == 0 && !closed(j) {
                    ids[j] = ids[i];
                    heap.push(Reverse((height.max(heights[j]), order.next(), j)));
                }
            });
        }
        ids
    }

    #[test]
    fn floods_by_heights_are_those_of_a_queue_of_voxels() {
        for case in 0..60 {
            let dims: [usize; 3] = std::array::from_fn(|a| 1 + noise::below(case, a as u64, 9) as usize);
            let grid = Grid::with_spacing(dims, [1.0, 0.5, 2.0]).unwrap();
            let n = grid.len() as u64;
            let of = |seed: u64, i: u64| noise::below(case + seed, i, 40);
            let voxels: Vec<f32> =
                (0..n).map(|i| if of(1000, i) == 0 { f32::NAN } else { (of(2000, i) / 8) as f32 }).collect();
            let seeds: Vec<u16> =
                (0..n).map(|i| if of(3000, i) < 3 { of(3000, i) as u16 } else { 0 }).collect();
            let blocked: Vec<u8> = (0..n).map(|i| u8::from(of(4000, i) < 4)).collect();
            let volume = Volume::new(grid, voxels.into()).unwrap();
            let exec = Exec::default();
            let found = flood(&volume, &seeds, Some(&blocked), None, &exec).unwrap();
            assert_eq!(
                found,
                plain(&heights(&volume, None, &exec).unwrap(), &seeds, &blocked, dims),
                "case {case}"
            );
        }
    }
}
