//! Mapping: the motion of a lattice carried to the voxels (I-DOGME), certified free of folds, with its inverse.
//!
//! Three methods find the field, [`octree()`], [`biharmonic()`] and [`fem()`]; what follows is the same for both.
//!
//! # The field of `octree`
//!
//! Let `Ω` be the union of the handles' balls (centre `cᵢ`, radius `rᵢ`), each widened by the margin `m`, inside the
//! lattice *and outside it*. With `n(x)` the lattice point nearest to voxel `x`, `d = |x − n(x)|`, and `U` the vertices'
//! motion, linear on each triangle:
//!
//! ```text
//! u(x) = ω(x) · w(d / depth)  · U(n(x))      inside the lattice
//! u(x) = ω(x) · s(d / m)      · U(n(x))      outside it (a band that moves along)
//! ω(x) = 1 − Π (1 − s((|x − cᵢ| − rᵢ) / m))
//! s(t) = 1 − 3t² + 2t³ for 0 ≤ t ≤ 1;  1 below, 0 above
//! ```
//!
//! `w` is a [`DepthWeight`]. `u` and its slope fall to 0 on `∂Ω`; beyond it nothing moves, bit for bit. With
//! [`DepthWeight::One`] the inside of the balls moves exactly as the lattice does under a translation. A rotation of the
//! lattice is met on its surface only: inside, the error grows as `‖R − I‖ · d`.
//!
//! The slope of `s` is at most 3/2, so with the default margin and depth of four times the largest motion neither band
//! nor cut-off can fold by itself.
//!
//! # The field of `biharmonic`
//!
//! ```text
//! u = A_ω + ω r,      r minimises  ∫ ‖∇²r‖² + Σ_v ‖A_ω(x_v) + ω(x_v) r(x_v) − U_v‖² / σ²
//! ```
//!
//! `r` is trilinear on cells of some 4³ voxels in the same `Ω`, 0 with its slope on `∂Ω`; the integral is in world space. `A` is
//! the affine motion of the whole lattice where that explains it to a quarter, and exact in the balls. Motion is smooth through
//! the lattice, rotations are followed inside, and neither depth nor weight is to be chosen. A motion that folds in one step is
//! made in up to 16 and more, each from where the one before has brought the vertices.
//!
//! # The field of `fem`
//!
//! In the same `Ω` the equilibrium of neo-Hookean matter, softer outside the lattice ([`FemParams::filler`]), whose vertices move as
//! they are told to; on hexahedra that are finest round the lattice. See its page.
//!
//! # No folds
//!
//! 1. The nearest point jumps across the medial axis, and neighbouring pieces of a lattice may move differently. Where
//!    that folds a cell, or squeezes it below a twentieth, the field is diffused round the cell, and only there, in a few
//!    rounds.
//! 2. If cells still fold, the map is replaced by a flow in `2ᵏ` equal steps, `k ≤ 6`, resampled and certified again.
//! 3. The certificate ([`crate::certificate`]) must hold at the end, and the vertices that move most must have followed
//!    to within [`Band::tolerance`]; else the map is refused: nothing can push deeper than what is left to compress.
//!
//! # A part that moves alone
//!
//! With [`Outside::Free`] voxels outside the lattice don't take part, except as the far corners of the cells at its
//! surface: in a layer of two voxel diagonals the field continues the part's. The certificate covers the cells of the
//! part; the inverse is built from them, and what the part left and didn't come to is flagged as vacated.
//!
//! Sources: the thesis, 6.2–6.3 (the nearest lattice point through the octree; it leaves `w` open) and 7.4.

mod biharmonic;
mod compose;
mod fem;
mod incremental;
mod nearest_weight;
mod octree;
mod outcome;
mod params;
mod region;
mod relax;
mod settle;
mod stage;
mod vacate;

use ivd_core::op::Op as _;
use ivd_core::{Exec, FieldBricks, Frame, Grid, Lattice, Mask, Motion, NO_BRICK, VoxelIndex};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;
use crate::sampler::{brick_at, brick_voxels};
pub use biharmonic::{Biharmonic, biharmonic};
pub use fem::fem;
pub use incremental::Live;
pub use nearest_weight::{Found, Hit, Nearest};
use nearest_weight::{Kept, Part, carry, seek};
pub use octree::{Prepared, frames, octree};
pub(crate) use outcome::lengths;
pub use outcome::{MapFigures, MapResult, Moved, Solved, SurfaceFit};
pub(crate) use params::smooth_fall;
pub use params::{Band, BiharmonicParams, DepthWeight, Elastic, FemParams, OctreeParams, Outside};
use region::{Region, largest};
pub(crate) use relax::THIN;
use settle::Settle;
pub(crate) use settle::{check_residual, folded};
pub use stage::STAGE;
pub(crate) use vacate::{invert_within, lies_beyond};

/// Largest motion that is mapped (mm): sums of a few such vectors still are finite in `f32`.
pub(crate) const FARTHEST: f64 = 1e37;

/// Maps frame `frame` of a motion with nearest points from any source.
///
/// - `inside`: the voxels inside the lattice, on its grid.
/// - `nearest`: finds the nearest lattice point.
///
/// # Errors
/// Inputs that don't belong together; parameters out of their domain; [`Error::Folded`] or [`Error::Untrusted`] where no
/// map free of folds follows the motion; the memory limit; cancellation.
pub fn nearest<N: Nearest>(
    lattice: &Lattice,
    inside: &Mask,
    nearest: &N,
    motion: &Motion,
    frame: usize,
    params: &OctreeParams,
    exec: &Exec,
) -> Result<MapResult, Error> {
    params.check()?;
    let frame = frame_of(lattice, motion, frame)?;
    inside.grid().require(lattice.grid(), "inside", "lattice")?;
    exec.run(|| {
        let positions = lattice.local_positions();
        let part = Part { lattice, positions: &positions, inside, nearest };
        let region = Region::new(motion, frame, &positions, &params.band, params.depth);
        let field = carried(&part, frame, &region, params, None, exec)?;
        settle_of(&part, frame, &region, &params.band).settle(field, exec)
    })
}

/// The field of one frame before any repair, with the nearest points that `part` finds or that are kept.
fn carried<N: Nearest>(
    part: &Part<'_, N>,
    frame: &Frame,
    region: &Region,
    params: &OctreeParams,
    mut kept: Option<&mut Kept>,
    exec: &Exec,
) -> Result<FieldBricks, Error> {
    let grid = part.lattice.grid();
    check_size(frame)?;
    let bricks = moving_bricks(grid, region, frame, exec)?;
    // Where there is no room nothing is kept: what was mapped before decides over no refusal.
    if let Some(kept) = &mut kept
        && !room(kept.with(&bricks), exec)
    {
        kept.clear();
    }
    let kept = kept.filter(|_| room(bricks.len(), exec));
    let carried = carry(part, &frame.displacement, region, params, &bricks, kept, exec)?;
    all_bricks(grid, &bricks, carried)
}

/// Whether nearest points of so many bricks may be kept.
fn room(bricks: usize, exec: &Exec) -> bool {
    exec.check_memory("the nearest points of the map", Kept::BRICK * bricks as u64).is_ok()
}

/// Finds the nearest points of a region before they are asked for, where there is room.
fn look_ahead<N: Nearest>(
    part: &Part<'_, N>,
    region: &Region,
    params: &OctreeParams,
    kept: &mut Kept,
    exec: &Exec,
) -> Result<(), Error> {
    let bricks = region.bricks(part.lattice.grid());
    if room(kept.with(&bricks), exec) { seek(part, region, params, &bricks, kept, exec) } else { Ok(()) }
}

fn settle_of<'a, N>(part: &Part<'a, N>, frame: &'a Frame, region: &'a Region, band: &'a Band) -> Settle<'a> {
    let alone = (band.outside == Outside::Free).then_some(part.inside);
    Settle { lattice: part.lattice, alone, region, frame, band }
}

/// The bricks in which something may move; all of them where nothing is to be skipped.
fn moving_bricks(grid: &Grid, region: &Region, frame: &Frame, exec: &Exec) -> Result<Vec<usize>, Error> {
    let bricks = match (largest(frame) == 0.0, exec.skip) {
        (_, false) => (0..grid.dims().iter().map(|n| n.div_ceil(8)).product()).collect(),
        (true, true) => Vec::new(),
        (false, true) => region.bricks(grid),
    };
    exec.check_memory("the displacement", 2 * 12 * 512 * bricks.len() as u64)?;
    Ok(bricks)
}

/// Vectors (mm) at the voxels of bricks, one brick after another; `at` may keep what it likes from voxel to voxel of a brick.
pub(crate) fn sampled<T: Default>(
    stage: &'static str,
    dims: [usize; 3],
    bricks: &[usize],
    exec: &Exec,
    at: impl Fn(VoxelIndex, &mut T) -> Vector3<f64> + Sync,
) -> Result<Vec<[f32; 3]>, Error> {
    let observer = exec.observer();
    observer.begin(stage, bricks.len() as u64);
    let mut vectors = vec![[0.0; 3]; FieldBricks::VOXELS * bricks.len()];
    let all = bricks.par_iter().zip(vectors.par_chunks_exact_mut(FieldBricks::VOXELS));
    let sampled = all.try_for_each(|(&brick, out)| {
        exec.check_cancelled()?;
        let mut kept = T::default();
        for (slot, voxel) in brick_voxels(dims, brick_at(dims.map(|n| n.div_ceil(8)), brick)) {
            out[slot] = at(voxel, &mut kept).map(|c| c as f32).into();
        }
        observer.advance(stage, 1);
        Ok(())
    });
    observer.end(stage);
    sampled.map(|()| vectors)
}

fn check_size(frame: &Frame) -> Result<(), Error> {
    if largest(frame) <= FARTHEST {
        return Ok(());
    }
    Err(Error::Untrusted {
        what: "the map",
        problem: format!("a motion of {:e} mm is more than its vectors hold", largest(frame)),
        remedy: "move the handle less",
    })
}

/// Frame `frame` of a motion of the lattice.
fn frame_of<'a>(lattice: &Lattice, motion: &'a Motion, frame: usize) -> Result<&'a Frame, Error> {
    check_inputs(lattice, motion)?;
    motion.frames().get(frame).ok_or_else(|| Error::Mismatch {
        what: "frame",
        problem: format!("frame {frame} of {}", motion.frames().len()),
        remedy: "name a frame of the motion, counted from 0",
    })
}

/// A field that stores every brick of Ω, zero or not, so that it can be worked on.
fn all_bricks(grid: &Grid, bricks: &[usize], vectors: Vec<[f32; 3]>) -> Result<FieldBricks, Error> {
    let mut table = vec![NO_BRICK; grid.dims().iter().map(|n| n.div_ceil(8)).product()];
    for (slot, &brick) in bricks.iter().enumerate() {
        table[brick] = slot as u32;
    }
    Ok(FieldBricks::new(grid.dims(), table, vectors.into())?)
}

/// Checks that lattice and motion belong together.
pub(crate) fn check_inputs(lattice: &Lattice, motion: &Motion) -> Result<(), Error> {
    if !lattice.grid().matches(motion.grid()) {
        return Err(Error::Mismatch {
            what: "motion",
            problem: format!(
                "it moves a lattice on {:?}, not on {:?}",
                motion.grid().dims(),
                lattice.grid().dims()
            ),
            remedy: "map the motion onto the lattice that it was computed for",
        });
    }
    if lattice.keys().len() != motion.vertex_count() {
        return Err(Error::Mismatch {
            what: "motion",
            problem: format!(
                "it moves {} vertices, the lattice has {}",
                motion.vertex_count(),
                lattice.keys().len()
            ),
            remedy: "map the motion onto the lattice that it was computed for (the same level of refinement)",
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
