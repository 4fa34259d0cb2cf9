//! Relaxation: local smoothing of a field where it folds or nearly does.
//!
//! The field of nearest points jumps where the nearest point changes sides (the medial axis) and where neighbouring
//! pieces of the lattice move differently. Where such a jump is steep enough to fold cells, the field is diffused round
//! them, and only there:
//!
//! ```text
//! u ← u + α(x) (ū(x) − u),   ū = Σ_a (u(x + s e_a) + u(x − s e_a)) / h_a²  /  Σ_a 2 / h_a²
//! ```
//!
//! with `h` the spacing, `s` a stride that is halved down to 1 in every round (so that wide jumps even out in few passes)
//! and `α` falling linearly from 1 at the bad cells to 0 a few voxels away. Then the cells near by are certified again.
//! A constant field is left as it is, and so is every field without bad cells: a translation stays exact.

use ivd_core::{Exec, FieldBricks, Grid, NO_BRICK, VoxelCoord};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::region::Region;
use crate::Error;
use crate::certificate::{CellBound, Certificate, Detail, certify_bricks};
use crate::sampler::{brick_at, brick_voxels};

/// Determinant up to which a cell is relaxed. At 0.05 a cell is squeezed to a twentieth of its size; less would pass as
/// fold-free but leaves the inverse with gradients that no interpolation follows.
pub(crate) const THIN: f64 = 0.05;
/// Rounds of relaxation. On real lattices with a reach of eight times the motion 3 to 12 were enough; what folds after
/// 32 is a push deeper than what is left to compress.
const ROUNDS: u32 = 32;

/// A field and its certificate.
pub(super) struct Relaxed {
    pub(super) field: FieldBricks,
    pub(super) certificate: Certificate,
    /// Rounds that were needed.
    pub(super) rounds: u32,
}

/// Relaxes `field` until no cell is thin, or the rounds are used up. `detail`: of the certificate that it ends with.
pub(super) fn relax(
    mut field: FieldBricks,
    grid: &Grid,
    region: &Region,
    counts: &(impl Fn([i64; 3]) -> bool + Sync),
    detail: Detail,
    exec: &Exec,
) -> Result<Relaxed, Error> {
    let all = |field: &FieldBricks| {
        certify_bricks(field, grid, THIN, counts, &crate::certificate::touched(field), detail, exec)
    };
    let mut certificate = all(&field)?;
    let mut rounds = 0;
    let mut bad: Vec<CellBound> = bad_cells(&certificate);
    while !bad.is_empty() && rounds < ROUNDS {
        exec.check_cancelled()?;
        let reach = Reach::of_round(rounds);
        let patch = Patch::round_cells(&field, grid, region, &bad, reach);
        for stride in reach.strides() {
            field = patch.diffuse(field, grid, stride)?;
        }
        rounds += 1;
        let near = patch.owners(&field);
        bad = bad_cells(&certify_bricks(&field, grid, THIN, counts, &near, Detail::least(exec), exec)?);
        exec.observer().iteration(ivd_core::Iteration {
            method: "map relaxation",
            index: u64::from(rounds),
            value: bad.len() as f64,
        });
    }
    if rounds > 0 {
        certificate = all(&field)?;
    }
    Ok(Relaxed { field, certificate, rounds })
}

fn bad_cells(certificate: &Certificate) -> Vec<CellBound> {
    certificate.folded.iter().chain(&certificate.thin).copied().collect()
}

/// How far a round of relaxation goes, in voxels.
#[derive(Clone, Copy)]
struct Reach {
    /// Distance (city block) at which α has fallen to 0.
    radius: u8,
    /// Largest stride.
    stride: usize,
}

impl Reach {
    /// The first rounds mend single cells; later ones reach further.
    fn of_round(round: u32) -> Self {
        Self { radius: (4 + round).min(16) as u8, stride: 1 << (round / 6).min(3) }
    }

    /// Eight passes at stride 1, after some at the wider ones.
    fn strides(self) -> impl Iterator<Item = usize> {
        let wide = (1..=self.stride.ilog2()).rev().flat_map(|p| [1_usize << p; 4]);
        wide.chain([1; 8])
    }

    /// Bricks on each side of a bad one that a round can read or change.
    fn bricks(self) -> usize {
        (usize::from(self.radius)).div_ceil(8)
    }
}

/// The bricks that a round changes, with α by voxel.
struct Patch {
    bricks: Vec<usize>,
    alpha: Vec<Box<[f32]>>,
}

impl Patch {
    fn round_cells(
        field: &FieldBricks,
        grid: &Grid,
        region: &Region,
        bad: &[CellBound],
        reach: Reach,
    ) -> Self {
        let brick_dims = field.brick_dims();
        let mut hit = vec![false; field.table().len()];
        for cell in bad {
            let own: [usize; 3] = std::array::from_fn(|a| cell.cell[a].max(0) as usize / 8);
            let lo = own.map(|b| b.saturating_sub(reach.bricks()));
            let hi: [usize; 3] =
                std::array::from_fn(|a| (own[a] + 1 + reach.bricks()).min(brick_dims[a] - 1));
            for z in lo[2]..=hi[2] {
                for y in lo[1]..=hi[1] {
                    for x in lo[0]..=hi[0] {
                        hit[x + brick_dims[0] * (y + brick_dims[1] * z)] = true;
                    }
                }
            }
        }
        let bricks: Vec<usize> = (0..hit.len()).filter(|&b| hit[b] && field.table()[b] != NO_BRICK).collect();
        let mut slots = vec![NO_BRICK; hit.len()];
        for (slot, &b) in bricks.iter().enumerate() {
            slots[b] = slot as u32;
        }
        let distance =
            Distance { dims: field.dims(), brick_dims, slots: &slots }.by_voxel(&bricks, bad, reach.radius);
        let linear = grid.linear_part();
        let alpha = bricks
            .par_iter()
            .zip(distance)
            .map(|(&brick, near)| {
                let mut alpha = vec![0.0_f32; FieldBricks::VOXELS].into_boxed_slice();
                for (slot, voxel) in brick_voxels(field.dims(), brick_at(brick_dims, brick)) {
                    // Nothing moves beyond Ω, whatever folds near its border.
                    if near[slot] > 0 && region.weight(linear * VoxelCoord::from(voxel).0) > 0.0 {
                        alpha[slot] = f32::from(near[slot]) / f32::from(reach.radius);
                    }
                }
                alpha
            })
            .collect();
        Self { bricks, alpha }
    }

    /// One pass of diffusion with a stride.
    fn diffuse(&self, field: FieldBricks, grid: &Grid, stride: usize) -> Result<FieldBricks, Error> {
        let weights = Vector3::from(grid.spacing()).map(|h| 1.0 / (h * h));
        let weights = (weights / (2.0 * weights.sum())).map(|w| w as f32);
        let changed: Vec<Vec<[f32; 3]>> = self
            .bricks
            .par_iter()
            .zip(&self.alpha)
            .map(|(&brick, alpha)| diffuse_brick(&field, brick, alpha, weights, stride))
            .collect();
        let (dims, table) = (field.dims(), field.table().to_vec());
        let mut vectors = field.buffer().clone();
        drop(field);
        let mut all = std::mem::replace(&mut vectors, Vec::new().into()).into_vec();
        for (&brick, new) in self.bricks.iter().zip(changed) {
            all[table[brick] as usize * FieldBricks::VOXELS..][..FieldBricks::VOXELS].copy_from_slice(&new);
        }
        Ok(FieldBricks::new(dims, table, all.into())?)
    }

    /// The bricks that own cells which this patch may have changed.
    fn owners(&self, field: &FieldBricks) -> Vec<usize> {
        let brick_dims = field.brick_dims();
        let mut owner = vec![false; field.table().len()];
        for &brick in &self.bricks {
            let at = brick_at(brick_dims, brick);
            for corner in 0..8_usize {
                let lower: [usize; 3] = std::array::from_fn(|a| at[a].saturating_sub(corner >> a & 1));
                owner[lower[0] + brick_dims[0] * (lower[1] + brick_dims[1] * lower[2])] = true;
            }
        }
        (0..owner.len()).filter(|&b| owner[b]).collect()
    }
}

fn diffuse_brick(
    field: &FieldBricks,
    brick: usize,
    alpha: &[f32],
    weights: Vector3<f32>,
    stride: usize,
) -> Vec<[f32; 3]> {
    let mut out = field.brick(brick).expect("the patch lies on stored bricks").to_vec();
    let dims = field.dims();
    for (slot, voxel) in brick_voxels(dims, brick_at(field.brick_dims(), brick)) {
        if alpha[slot] == 0.0 {
            continue;
        }
        let old = Vector3::from(out[slot]);
        // Differences are summed, not values, so that a constant field doesn't change by a rounding.
        let mut change = Vector3::zeros();
        for a in 0..3 {
            let (mut below, mut above) = (voxel, voxel);
            below.0[a] = voxel.0[a].saturating_sub(stride);
            above.0[a] = (voxel.0[a] + stride).min(dims[a] - 1);
            let d = (Vector3::from(field.at(below)) - old) + (Vector3::from(field.at(above)) - old);
            change += d * weights[a];
        }
        out[slot] = (old + change * alpha[slot]).into();
    }
    out
}

/// City-block nearness on a set of bricks.
struct Distance<'a> {
    dims: [usize; 3],
    brick_dims: [usize; 3],
    slots: &'a [u32],
}

impl Distance<'_> {
    /// By voxel of the bricks: `radius` at the corners of the cells, one less a step, 0 from `radius` steps on.
    fn by_voxel(&self, bricks: &[usize], cells: &[CellBound], radius: u8) -> Vec<Box<[u8]>> {
        let mut near: Vec<Box<[u8]>> = vec![vec![0_u8; FieldBricks::VOXELS].into_boxed_slice(); bricks.len()];
        for cell in cells {
            for corner in 0..8_usize {
                let at: [usize; 3] = std::array::from_fn(|a| {
                    ((cell.cell[a].max(0) as usize) + (corner >> a & 1)).min(self.dims[a] - 1)
                });
                if let Some((brick, slot)) = self.find(at) {
                    near[brick][slot] = radius;
                }
            }
        }
        for _ in 1..radius {
            near = (0..bricks.len()).into_par_iter().map(|i| self.grow(&near, bricks[i], i)).collect();
        }
        near
    }

    fn find(&self, [x, y, z]: [usize; 3]) -> Option<(usize, usize)> {
        let slot = self.slots[x / 8 + self.brick_dims[0] * (y / 8 + self.brick_dims[1] * (z / 8))];
        (slot != NO_BRICK).then_some((slot as usize, x % 8 + 8 * (y % 8 + 8 * (z % 8))))
    }

    fn grow(&self, near: &[Box<[u8]>], brick: usize, index: usize) -> Box<[u8]> {
        let mut out = near[index].clone();
        for (slot, voxel) in brick_voxels(self.dims, brick_at(self.brick_dims, brick)) {
            let mut most = 0;
            for a in 0..3 {
                for step in [-1_i64, 1] {
                    let mut at = voxel.0;
                    at[a] = at[a].saturating_add_signed(step as isize).min(self.dims[a] - 1);
                    if let Some((b, s)) = self.find(at) {
                        most = most.max(near[b][s]);
                    }
                }
            }
            out[slot] = out[slot].max(most.saturating_sub(1));
        }
        out
    }
}
