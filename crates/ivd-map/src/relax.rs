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

use ivd_core::{Error, Exec, FieldBricks, Grid, NO_BRICK, VoxelCoord};
use ivd_field::certificate::{CellBound, Certificate, Detail, Looks, Quick, THIN, certify_bricks, touched};
use ivd_field::sampler::{brick_at, brick_voxels};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::region::Region;

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
    let mut looks = Looks::default();
    let mut certificate = if detail == Detail::Least {
        let quick = Quick::new(&field, grid, exec.simd);
        looks.take(&quick, &touched(&field), exec)?;
        looks.certify(&quick, THIN, counts, exec)?
    } else {
        certify_bricks(&field, grid, THIN, counts, &touched(&field), detail, exec)?
    };
    let mut rounds = 0;
    let mut bad: Vec<CellBound> = bad_cells(&certificate);
    while !bad.is_empty() && rounds < ROUNDS {
        exec.check_cancelled()?;
        let reach = Reach::of_round(rounds);
        let patch = Patch::round_cells(&field, grid, region, &bad, reach);
        field = patch.diffuse(field, grid, reach.strides())?;
        rounds += 1;
        let near = patch.owners(&bad);
        let certificate = if exec.skip {
            let quick = Quick::new(&field, grid, exec.simd);
            let mut fresh = Looks::default();
            fresh.take(&quick, &near, exec)?;
            let certificate = fresh.certify(&quick, THIN, counts, exec)?;
            looks.replace(fresh);
            certificate
        } else {
            certify_bricks(&field, grid, THIN, counts, &near, Detail::All, exec)?
        };
        bad = bad_cells(&certificate);
        exec.observer().iteration(ivd_core::Iteration {
            method: "map relaxation",
            index: u64::from(rounds),
            value: bad.len() as f64,
        });
    }
    if rounds > 0 {
        certificate = if detail == Detail::Least {
            looks.certify(&Quick::new(&field, grid, exec.simd), THIN, counts, exec)?
        } else {
            certify_bricks(&field, grid, THIN, counts, &touched(&field), detail, exec)?
        };
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

    /// Bricks on each side of a bad one that a round can change. It reads up to its stride beyond.
    fn bricks(self) -> usize {
        (usize::from(self.radius)).div_ceil(8)
    }
}

/// The voxels that a round changes, with α.
struct Patch {
    /// Ascending by brick, then in the brick's order.
    voxels: Vec<Changing>,
    dims: [usize; 3],
    brick_dims: [usize; 3],
}

/// A voxel that a round changes.
#[derive(Clone, Copy)]
struct Changing {
    voxel: [usize; 3],
    /// Where its vector is in the field's buffer.
    at: usize,
    alpha: f32,
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
        let mut near = Nearness::on(field, &round(brick_dims, bad, reach));
        near.spread(bad, reach.radius);
        let linear = grid.linear_part();
        let voxels = near
            .bricks
            .par_iter()
            .zip(&near.by_brick)
            .map(|(&brick, near)| {
                let first = field.table()[brick] as usize * FieldBricks::VOXELS;
                let changing =
                    brick_voxels(field.dims(), brick_at(brick_dims, brick)).filter(|(slot, voxel)| {
                        // Nothing moves beyond Ω, whatever folds near its border.
                        near[*slot] > 0 && region.weight(linear * VoxelCoord::from(*voxel).0) > 0.0
                    });
                let alpha = |slot: usize| f32::from(near[slot]) / f32::from(reach.radius);
                changing
                    .map(|(slot, voxel)| Changing { voxel: voxel.0, at: first + slot, alpha: alpha(slot) })
                    .collect::<Vec<_>>()
            })
            .flatten_iter()
            .collect();
        Self { voxels, dims: field.dims(), brick_dims }
    }

    /// Passes of diffusion, each with its stride.
    fn diffuse(
        &self,
        field: FieldBricks,
        grid: &Grid,
        strides: impl Iterator<Item = usize>,
    ) -> Result<FieldBricks, Error> {
        let weights = Vector3::from(grid.spacing()).map(|h| 1.0 / (h * h));
        let weights = (weights / (2.0 * weights.sum())).map(|w| w as f32);
        let (dims, table, buffer) = (field.dims(), field.table().to_vec(), field.buffer().clone());
        drop(field);
        let mut vectors = buffer.into_vec();
        let (mut near, mut of_stride) = (Vec::new(), 0);
        let mut changed = Vec::new();
        for stride in strides {
            if stride != of_stride {
                let neighbours = |own: &Changing| self.neighbours(&table, own.voxel, stride);
                self.voxels.par_iter().map(neighbours).collect_into_vec(&mut near);
                of_stride = stride;
            }
            let step = |(own, near): (&Changing, &[usize; 6])| diffused(&vectors, own, near, weights);
            self.voxels.par_iter().zip(&near).map(step).collect_into_vec(&mut changed);
            for (own, new) in self.voxels.iter().zip(&changed) {
                vectors[own.at] = *new;
            }
        }
        FieldBricks::new(dims, table, vectors.into())
    }

    /// Where the vectors of a voxel's neighbours are, below and above along each axis; [`usize::MAX`] where nothing is stored.
    fn neighbours(&self, table: &[u32], voxel: [usize; 3], stride: usize) -> [usize; 6] {
        std::array::from_fn(|i| {
            let (a, mut at) = (i / 2, voxel);
            at[a] = if i % 2 == 0 {
                voxel[a].saturating_sub(stride)
            } else {
                (voxel[a] + stride).min(self.dims[a] - 1)
            };
            let slot = table[brick_of(self.brick_dims, at)];
            if slot == NO_BRICK { usize::MAX } else { slot as usize * FieldBricks::VOXELS + slot_of(at) }
        })
    }

    /// The bricks that own cells which this patch may have changed, and those of `cells`.
    fn owners(&self, cells: &[CellBound]) -> Vec<usize> {
        let mut owner = vec![false; self.brick_dims.iter().product()];
        for own in &self.voxels {
            for corner in 0..8_usize {
                let cell = std::array::from_fn(|a| own.voxel[a].saturating_sub(corner >> a & 1));
                owner[brick_of(self.brick_dims, cell)] = true;
            }
        }
        for cell in cells {
            owner[brick_of(self.brick_dims, cell.cell.map(|c| c.max(0) as usize))] = true;
        }
        (0..owner.len()).filter(|&b| owner[b]).collect()
    }
}

/// The bricks about cells that a round can change.
fn round(brick_dims: [usize; 3], cells: &[CellBound], reach: Reach) -> Vec<usize> {
    let mut hit = vec![false; brick_dims.iter().product()];
    for cell in cells {
        let own: [usize; 3] = std::array::from_fn(|a| cell.cell[a].max(0) as usize / 8);
        let lo = own.map(|b| b.saturating_sub(reach.bricks()));
        let hi: [usize; 3] = std::array::from_fn(|a| (own[a] + 1 + reach.bricks()).min(brick_dims[a] - 1));
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                for x in lo[0]..=hi[0] {
                    hit[x + brick_dims[0] * (y + brick_dims[1] * z)] = true;
                }
            }
        }
    }
    (0..hit.len()).filter(|&b| hit[b]).collect()
}

/// A voxel's vector after a pass of diffusion.
fn diffused(vectors: &[[f32; 3]], own: &Changing, near: &[usize; 6], weights: Vector3<f32>) -> [f32; 3] {
    let at = |i: usize| Vector3::from(vectors.get(i).copied().unwrap_or_default());
    let old = at(own.at);
    // Differences are summed, not values, so that a constant field doesn't change by a rounding.
    let mut change = Vector3::zeros();
    for a in 0..3 {
        let d = (at(near[2 * a]) - old) + (at(near[2 * a + 1]) - old);
        change += d * weights[a];
    }
    (old + change * own.alpha).into()
}

/// The brick of a voxel.
fn brick_of(brick_dims: [usize; 3], [x, y, z]: [usize; 3]) -> usize {
    x / 8 + brick_dims[0] * (y / 8 + brick_dims[1] * (z / 8))
}

/// The place of a voxel in its brick.
fn slot_of([x, y, z]: [usize; 3]) -> usize {
    x % 8 + 8 * (y % 8 + 8 * (z % 8))
}

/// City-block nearness on a set of bricks.
struct Nearness {
    dims: [usize; 3],
    brick_dims: [usize; 3],
    /// The bricks of the set that the field stores, ascending.
    bricks: Vec<usize>,
    /// Where each brick of the grid is among them.
    slots: Vec<u32>,
    by_brick: Vec<Box<[u8]>>,
}

impl Nearness {
    fn on(field: &FieldBricks, bricks: &[usize]) -> Self {
        let stored = |b: &usize| field.table()[*b] != NO_BRICK;
        let bricks: Vec<usize> = bricks.iter().copied().filter(stored).collect();
        let mut slots = vec![NO_BRICK; field.table().len()];
        for (slot, &b) in bricks.iter().enumerate() {
            slots[b] = slot as u32;
        }
        let by_brick = vec![vec![0_u8; FieldBricks::VOXELS].into_boxed_slice(); bricks.len()];
        Self { dims: field.dims(), brick_dims: field.brick_dims(), bricks, slots, by_brick }
    }

    /// `radius` at the corners of the cells, one less a step, 0 from `radius` steps on.
    fn spread(&mut self, cells: &[CellBound], radius: u8) {
        let mut front = Vec::new();
        for cell in cells {
            for corner in 0..8_usize {
                let at = |a: usize| (cell.cell[a].max(0) as usize + (corner >> a & 1)).min(self.dims[a] - 1);
                self.reach([at(0), at(1), at(2)], radius, &mut front);
            }
        }
        for level in (1..radius).rev() {
            let mut next = Vec::new();
            for voxel in front {
                for a in 0..3 {
                    for step in [-1, 1] {
                        let mut at = voxel;
                        at[a] = at[a].saturating_add_signed(step).min(self.dims[a] - 1);
                        self.reach(at, level, &mut next);
                    }
                }
            }
            front = next;
        }
    }

    /// Makes a voxel of the set as near as `level`; into `front` where it was farther.
    fn reach(&mut self, at: [usize; 3], level: u8, front: &mut Vec<[usize; 3]>) {
        let slot = self.slots[brick_of(self.brick_dims, at)];
        if slot == NO_BRICK {
            return;
        }
        let near = &mut self.by_brick[slot as usize][slot_of(at)];
        if *near < level {
            *near = level;
            front.push(at);
        }
    }
}
