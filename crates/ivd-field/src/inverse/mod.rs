//! The inverse of a displacement field: for every voxel `y` of the deformed volume the place `ψ(y)` that it came from.
//!
//! `φ(x) = x + u(x)` is trilinear in each cell of eight voxels, so the inverse is exact up to rounding: Newton's method
//! inside the cells, started from the neighbour's answer, with a search over the deformed
//! cells' boxes where Newton stalls at a kink between cells.
//!
//! Where `φ` is one-to-one (see [`crate::certificate`]) a voxel with `u = 0` is its own preimage, so the inverse lives
//! on the bricks of the forward field and is exactly 0 everywhere else.

mod bulk;
mod pieces;
mod residual;
mod solve;

use std::ops::Range;

use ivd_core::{Exec, FieldBricks, Grid, NO_BRICK, SpillVec, VoxelIndex};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;
use crate::sampler::Sampler;
use bulk::BrickSolver;
pub use pieces::{invert_part, invert_within, lies_beyond};
use residual::{SolvedBrick, Worst};
use solve::Solver;

/// Residual above which an inverse is refused (voxels): a hundredth of what could be seen.
const RESIDUAL: f64 = 1e-2;

/// An inverse field.
#[derive(Debug, Clone, PartialEq)]
pub struct Inverse {
    /// Deformed → rest (mm): `ψ(y) = y + field(y)`.
    pub field: FieldBricks,
    /// Largest `|φ(ψ(y)) − y|` over its voxels, as stored in `f32` (voxels).
    pub residual_max_voxels: f64,
    /// The voxel with the largest residual; `None` where nothing moves.
    pub worst: Option<VoxelIndex>,
}

impl Inverse {
    /// Refuses an inverse that isn't one: `what` it is of, and what to do instead.
    ///
    /// # Errors
    /// [`Error::Untrusted`] where its residual is more than a hundredth of a voxel.
    pub fn check_residual(&self, what: &'static str, remedy: &'static str) -> Result<(), Error> {
        if self.residual_max_voxels <= RESIDUAL {
            return Ok(());
        }
        let (residual, voxel) = (self.residual_max_voxels, self.worst.map(|v| v.0));
        let problem = format!("a residual of {residual:.3} voxels at voxel {voxel:?}");
        Err(Error::Untrusted { what, problem, remedy })
    }
}

/// Inverts a forward field (mm) on its grid.
///
/// The field should be one-to-one: where it folds, one of the preimages is found and the residual still tells whether
/// it is one. Beyond the grid the field continues as its border voxels, so a place that moved into the volume from
/// outside has a preimage outside the grid.
///
/// # Errors
/// A field of other dims than the grid; cancellation.
///
/// ```
/// use ivd_core::{Exec, FieldBricks, Grid, VoxelIndex};
///
/// let grid = Grid::with_spacing([8, 8, 8], [0.5; 3])?;
/// let shift = FieldBricks::new([8, 8, 8], vec![0], vec![[0.75_f32, 0.0, 0.0]; 512].into())?;
/// let inverse = ivd_field::inverse::invert(&shift, &grid, &Exec::default())?;
/// assert_eq!(inverse.field.at(VoxelIndex([3, 3, 3])), [-0.75, 0.0, 0.0]);
/// assert!(inverse.residual_max_voxels < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn invert(forward: &FieldBricks, grid: &Grid, exec: &Exec) -> Result<Inverse, Error> {
    forward.require(grid.dims(), "forward field", "grid")?;
    exec.run(|| {
        let observer = exec.observer();
        observer.begin("inverse", forward.stored() as u64);
        let stored: Vec<usize> =
            (0..forward.table().len()).filter(|&b| forward.table()[b] != NO_BRICK).collect();
        let mut vectors: SpillVec<[f32; 3]> =
            exec.bulk("the inverse field", FieldBricks::VOXELS * stored.len())?;
        let (solver, mut worst) = (Solver::seldom(forward, grid), Worst::default());
        for part in layers(&stored, forward.brick_dims()) {
            let bulk = BrickSolver::new(forward, grid, &solver, &stored, part.clone(), exec.simd);
            let out = &mut vectors[FieldBricks::VOXELS * part.start..FieldBricks::VOXELS * part.end];
            let solved =
                out.par_chunks_exact_mut(FieldBricks::VOXELS).zip(&stored[part]).map(|(out, &brick)| {
                    exec.check_cancelled()?;
                    let worst = bulk.brick(brick, out);
                    observer.advance("inverse", 1);
                    Ok(worst)
                });
            solved.collect::<Result<Vec<Worst>, Error>>()?.into_iter().for_each(|w| worst.merge(w));
        }
        observer.end("inverse");
        let field = moving(grid.dims(), &stored, vectors)?;
        Ok(Inverse { field, residual_max_voxels: worst.residual, worst: worst.voxel })
    })
}

/// Stored bricks that are worked on together: whole layers, of at least [`TOGETHER`] bricks but for the last.
fn layers(stored: &[usize], brick_dims: [usize; 3]) -> Vec<Range<usize>> {
    let layer = |at: usize| stored[at] / (brick_dims[0] * brick_dims[1]);
    let mut parts = Vec::new();
    let mut start = 0;
    for at in 1..=stored.len() {
        if at == stored.len() || at - start >= TOGETHER && layer(at) != layer(at - 1) {
            parts.push(start..at);
            start = at;
        }
    }
    parts
}

/// Bricks whose vectors are made ready together, 16 KiB each: enough to keep all threads busy, and little beside the field.
const TOGETHER: usize = 512;

/// A field of these bricks, without those that are 0 throughout.
fn moving(dims: [usize; 3], bricks: &[usize], mut vectors: SpillVec<[f32; 3]>) -> Result<FieldBricks, Error> {
    let of = |slot: usize| FieldBricks::VOXELS * slot..FieldBricks::VOXELS * (slot + 1);
    let mut kept = Vec::with_capacity(bricks.len());
    for (slot, &brick) in bricks.iter().enumerate() {
        if vectors[of(slot)].iter().any(|v| *v != [0.0; 3]) {
            if kept.len() < slot {
                vectors.copy_within(of(slot), FieldBricks::VOXELS * kept.len());
            }
            kept.push(brick);
        }
    }
    vectors.truncate(FieldBricks::VOXELS * kept.len());
    FieldBricks::of_bricks(dims, &kept, vectors.into_buffer())
}

/// Puts solved bricks together; bricks that hold nothing but 0 are dropped.
pub(crate) fn assemble(
    dims: [usize; 3],
    bricks: &[usize],
    solved: Vec<SolvedBrick>,
) -> Result<Inverse, Error> {
    let mut worst = Worst::default();
    for (_, w) in &solved {
        worst.merge(*w);
    }
    let field = from_bricks(dims, bricks, solved.into_iter().map(|(vectors, _)| vectors))?;
    Ok(Inverse { field, residual_max_voxels: worst.residual, worst: worst.voxel })
}

/// A field from bricks in ascending order, without those that are 0 throughout.
///
/// # Errors
/// [`Error::Inconsistent`] where a brick hasn't a vector for each of its voxels.
pub fn from_bricks(
    dims: [usize; 3],
    bricks: &[usize],
    vectors: impl Iterator<Item: AsRef<[[f32; 3]]>>,
) -> Result<FieldBricks, Error> {
    let total: usize = dims.iter().map(|n| n.div_ceil(8)).product();
    let mut table = vec![NO_BRICK; total];
    let mut all = Vec::new();
    let mut slot = 0;
    for (&brick, vectors) in bricks.iter().zip(vectors) {
        let vectors = vectors.as_ref();
        if vectors.iter().any(|v| *v != [0.0; 3]) {
            table[brick] = slot;
            slot += 1;
            all.extend_from_slice(vectors);
        }
    }
    FieldBricks::new(dims, table, all.into())
}

/// The stored vector (mm) that takes `y` to `x` (both voxel coordinates), and the residual that it leaves (voxels).
pub(crate) fn store(sampler: &Sampler<'_>, grid: &Grid, y: Vector3<f64>, x: Vector3<f64>) -> ([f32; 3], f64) {
    let vector: [f32; 3] = (grid.linear_part() * (x - y)).map(|c| c as f32).into();
    let kept = y + grid.inverse_linear_part() * Vector3::from(vector).map(f64::from);
    (vector, (kept + sampler.at(kept) - y).norm())
}

#[cfg(test)]
mod tests;
