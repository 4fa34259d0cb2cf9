//! The level function of a mask: a Gaussian of one voxel over it, less a half. Its zero passes through the steps of the voxels, where a
//! smooth border that these came from lies.
//!
//! What is thin, a sheet of two voxels or a rod of three, would lose volume to the Gaussian, or all of it: there, and round it, the level is
//! that of the mask itself, a half to either side, whose zero lies midway between voxels. So it is of thin gaps.

use ivd_core::{BRICK, Error, Exec, parallel};

/// Weights of a Gaussian of one voxel.
const REACH: usize = 3;

/// Values away from the border.
const FAR: f32 = 0.5;
/// Least distance from 0 on a voxel's own side.
const LEAST: f32 = 1e-3;
/// Least level, with its side's sign, that a voxel or one that touches it has where its side isn't thin. In the middle of a sheet of two
/// voxels it is 0.14, of a rod of three voxels' width 0.18 and of three layers 0.38; a voxel below the surface of a ball of radius 5, 0.3.
const THICK: f32 = 0.25;

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
    let (mut level, mixed) = smoothed(inside, dims, exec)?;
    step_where_thin(&mut level, dims, &mixed, exec)?;
    Ok(level)
}

/// The Gaussian over the mask, less a half, with the mask's sign; and the bricks that aren't all on one side.
fn smoothed(inside: &[u8], dims: [usize; 3], exec: &Exec) -> Result<(Vec<f32>, Vec<[usize; 3]>), Error> {
    let [nx, ny, nz] = dims;
    let layer = nx * ny;
    let weights = weights();
    let sides = sides(inside, dims, exec)?;
    let mut out = vec![0.0_f32; inside.len()];
    let mixed: Vec<Vec<[usize; 3]>> = parallel::try_map_pieces_mut(&mut out, layer * BRICK, &|bz, out| {
        exec.check_cancelled()?;
        let layers = out.len() / layer;
        let (mut room, mut mixed) = (Room::default(), Vec::new());
        for by in 0..ny.div_ceil(BRICK) {
            for bx in 0..nx.div_ceil(BRICK) {
                let low = [bx * BRICK, by * BRICK, bz * BRICK];
                let size = [BRICK.min(nx - low[0]), BRICK.min(ny - low[1]), layers];
                let near =
                    |a: usize, n: usize| low[a].saturating_sub(REACH)..(low[a] + size[a] + REACH).min(n);
                let (xs, ys, zs) = (near(0, nx), near(1, ny), near(2, nz));
                let first = inside[xs.start + nx * (ys.start + ny * zs.start)];
                let by_voxels = || {
                    zs.clone().all(|z| {
                        ys.clone().all(|y| {
                            let row = nx * (y + ny * z);
                            inside[row + xs.start..row + xs.end].iter().all(|&v| v == first)
                        })
                    })
                };
                let alike = are_alike(&sides, [bx, by, bz], dims) || by_voxels();
                let smoothed = (!alike).then(|| room.smooth(inside, dims, low, size, &weights));
                if !alike {
                    mixed.push([bx, by, bz]);
                }
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
        Ok::<_, Error>(mixed)
    })?;
    Ok((out, mixed.concat()))
}

/// For every brick 0 or 1 where all of its voxels are outside or inside, and 2 where some are either.
fn sides(inside: &[u8], dims: [usize; 3], exec: &Exec) -> Result<Vec<u8>, Error> {
    let [nx, ny, _] = dims;
    let [bricks_x, bricks_y, bricks_z] = dims.map(|n| n.div_ceil(BRICK));
    let layer = nx * ny;
    let by_layers = parallel::try_map(bricks_z, &|bz| {
        exec.check_cancelled()?;
        let from = bz * BRICK * layer;
        let voxels = &inside[from..(from + BRICK * layer).min(inside.len())];
        let mut counts = vec![[0_u16; 2]; bricks_x * bricks_y];
        for (i, row) in voxels.chunks(nx).enumerate() {
            let counts = &mut counts[i % ny / BRICK * bricks_x..][..bricks_x];
            for (part, [count, all]) in row.chunks(BRICK).zip(counts) {
                *count += part.iter().map(|&v| u16::from(v)).sum::<u16>();
                *all += part.len() as u16;
            }
        }
        let side = |[count, all]: [u16; 2]| if count == 0 { 0 } else { 2 - u8::from(count == all) };
        Ok::<_, Error>(counts.into_iter().map(side).collect::<Vec<u8>>())
    })?;
    Ok(by_layers.concat())
}

/// Whether a brick and those that touch it are all on one side.
fn are_alike(sides: &[u8], brick: [usize; 3], dims: [usize; 3]) -> bool {
    let bricks = dims.map(|n| n.div_ceil(BRICK));
    let own = sides[brick[0] + bricks[0] * (brick[1] + bricks[1] * brick[2])];
    own < 2 && touching(brick, bricks).all(|(i, _)| sides[i] == own)
}

/// Gives the voxels of thin places, and those that touch them, the level of the mask itself. Only the bricks that aren't all on one side are
/// looked at: elsewhere the level is that already.
fn step_where_thin(
    level: &mut [f32],
    dims: [usize; 3],
    mixed: &[[usize; 3]],
    exec: &Exec,
) -> Result<(), Error> {
    let bricks = dims.map(|n| n.div_ceil(BRICK));
    let brick_of = |at: [usize; 3]| at[0] + bricks[0] * (at[1] + bricks[1] * at[2]);
    let mut slots = vec![u32::MAX; bricks.iter().product()];
    for (slot, brick) in (0..).zip(mixed) {
        slots[brick_of(*brick)] = slot;
    }
    let is_thick = |i: usize, sign: f32| level[i] * sign >= THICK;
    let thin: Vec<[u64; BRICK]> = parallel::try_map(mixed.len(), &|slot| {
        exec.check_cancelled()?;
        let mut thin = [0; BRICK];
        for (i, at) in voxels_of(mixed[slot], dims) {
            let sign = level[i].signum();
            if !is_thick(i, sign) && !touching(at, dims).any(|(j, _)| is_thick(j, sign)) {
                set(&mut thin, at);
            }
        }
        Ok::<_, Error>(thin)
    })?;
    if thin.iter().flatten().all(|bits| *bits == 0) {
        return Ok(());
    }
    let is_thin = |at: [usize; 3]| {
        let slot = slots[brick_of(at.map(|v| v / BRICK))] as usize;
        thin.get(slot).is_some_and(|thin| is_set(thin, at))
    };
    let stepped: Vec<Vec<usize>> = parallel::try_map(mixed.len(), &|slot| {
        exec.check_cancelled()?;
        let voxels = voxels_of(mixed[slot], dims).filter(|(i, _)| level[*i].abs() < FAR);
        let near_thin = voxels.filter(|(_, at)| touching(*at, dims).any(|(_, near)| is_thin(near)));
        Ok::<_, Error>(near_thin.map(|(i, _)| i).collect())
    })?;
    for i in stepped.into_iter().flatten() {
        level[i] = FAR.copysign(level[i]);
    }
    Ok(())
}

/// The voxels of a brick: linear index and place.
fn voxels_of(brick: [usize; 3], [nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = (usize, [usize; 3])> {
    let [x, y, z] = brick.map(|b| b * BRICK);
    (z..(z + BRICK).min(nz)).flat_map(move |z| {
        (y..(y + BRICK).min(ny))
            .flat_map(move |y| (x..(x + BRICK).min(nx)).map(move |x| (x + nx * (y + ny * z), [x, y, z])))
    })
}

/// Sets the bit of a voxel in its brick's bits.
fn set(bits: &mut [u64; BRICK], at: [usize; 3]) {
    let [x, y, z] = at.map(|v| v % BRICK);
    bits[z] |= 1 << (x + BRICK * y);
}

fn is_set(bits: &[u64; BRICK], at: [usize; 3]) -> bool {
    let [x, y, z] = at.map(|v| v % BRICK);
    bits[z] >> (x + BRICK * y) & 1 == 1
}

/// The voxels that share a face, an edge or a corner with one, and itself: linear index and place.
fn touching(at: [usize; 3], [nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = (usize, [usize; 3])> {
    let near = |v: usize, n: usize| v.saturating_sub(1)..(v + 2).min(n);
    let (xs, ys, zs) = (near(at[0], nx), near(at[1], ny), near(at[2], nz));
    zs.flat_map(move |z| {
        let xs = xs.clone();
        ys.clone().flat_map(move |y| xs.clone().map(move |x| (x + nx * (y + ny * z), [x, y, z])))
    })
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
        let whole_rows = low[0] >= REACH && low[0] + BRICK + REACH <= nx;
        for z in 0..size[2] + 2 * REACH {
            for y in 0..size[1] + 2 * REACH {
                let row = nx * (clamped(low[1], y, ny) + ny * clamped(low[2], z, nz));
                if whole_rows {
                    let from = &inside[row + low[0] - REACH..][..PADDED];
                    let to = &mut self.padded[PADDED * (y + PADDED * z)..][..PADDED];
                    to.iter_mut().zip(from).for_each(|(to, from)| *to = f32::from(*from));
                    continue;
                }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Voxels between the zeros of a level along x, in the row through the middle: what the part is wide.
    fn width(holds: &dyn Fn([usize; 3]) -> bool) -> f64 {
        let n = 24;
        let at = |i: usize| [i % n, i / n % n, i / n / n];
        let inside: Vec<u8> = (0..n * n * n).map(|i| u8::from(holds(at(i)))).collect();
        let level = level(&inside, [n; 3], &Exec::default()).unwrap();
        assert!(level.iter().zip(&inside).all(|(level, inside)| (*level > 0.0) == (*inside != 0)));
        let row = &level[n * (n / 2 + n * (n / 2))..][..n];
        let mut zeros = row
            .windows(2)
            .enumerate()
            .filter(|(_, pair)| pair[0] * pair[1] < 0.0)
            .map(|(x, pair)| x as f64 + f64::from(pair[0] / (pair[0] - pair[1])));
        let [from, to] = [zeros.next().unwrap(), zeros.next().unwrap()];
        assert_eq!(zeros.next(), None);
        to - from
    }

    #[test]
    fn thin_parts_and_thin_gaps_are_as_wide_as_their_voxels() {
        for thick in 1..5 {
            let within = |v: usize| (12..12 + thick).contains(&v);
            let wide = thick as f64;
            let sheet = width(&|[x, ..]| within(x));
            assert!((sheet / wide - 1.0).abs() < 0.1, "a sheet of {thick}: {sheet}");
            let gap = width(&|[x, ..]| !within(x));
            assert!((gap / wide - 1.0).abs() < 0.1, "a gap of {thick}: {gap}");
            let rod = width(&|[x, y, _]| within(x) && (12 - (thick - 1) / 2..=12 + thick / 2).contains(&y));
            assert!((rod / wide - 1.0).abs() < 0.1 || thick > 2, "a rod of {thick}: {rod}");
        }
        // A fin of one voxel on a block is cut nowhere.
        let fin = width(&|[x, y, _]| x == 12 || (y < 6 && (6..18).contains(&x)));
        assert!((fin - 1.0).abs() < 0.1, "{fin}");
    }

    /// Every voxel asked, whatever brick it lies in.
    fn step_everywhere(level: &mut [f32], dims: [usize; 3]) {
        let at = |i: usize| [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        let thin: Vec<bool> = (0..level.len())
            .map(|i| {
                let sign = level[i].signum();
                !touching(at(i), dims).any(|(j, _)| level[j] * sign >= THICK)
            })
            .collect();
        for i in 0..level.len() {
            if level[i].abs() < FAR && touching(at(i), dims).any(|(j, _)| thin[j]) {
                level[i] = FAR.copysign(level[i]);
            }
        }
    }

    #[test]
    fn bricks_of_one_side_need_no_look_for_thin_places() {
        let mut state = 5_u64;
        let mut below = |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % n
        };
        let exec = Exec::default();
        for _ in 0..60 {
            let dims = [1 + below(33), 1 + below(30), 1 + below(20)];
            let mut inside = vec![0_u8; dims.iter().product()];
            for _ in 0..4 {
                let low = dims.map(&mut below);
                let high: [usize; 3] = std::array::from_fn(|a| (low[a] + 1 + below(9)).min(dims[a]));
                for (i, inside) in inside.iter_mut().enumerate() {
                    let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
                    *inside |= u8::from((0..3).all(|a| (low[a]..high[a]).contains(&at[a])));
                }
            }
            let (mut plain, mixed) = smoothed(&inside, dims, &exec).unwrap();
            let mut fast = plain.clone();
            step_where_thin(&mut fast, dims, &mixed, &exec).unwrap();
            step_everywhere(&mut plain, dims);
            assert!(fast == plain, "{dims:?}");
        }
    }

    #[test]
    fn a_slice_is_a_sheet_that_goes_on() {
        let inside: Vec<u8> = (0..400).map(|i| u8::from((5..15).contains(&(i % 20)))).collect();
        let level = level(&inside, [20, 20, 1], &Exec::default()).unwrap();
        assert!((level[100 + 10] - 0.5).abs() < 1e-3 && (level[100 + 5] - 0.195).abs() < 0.01);
    }
}
