//! Mapping: the motion of a lattice carried to the voxels (I-DOGME), certified free of folds, with its inverse.
//!
//! # The field
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
//! # No folds
//!
//! 1. The nearest point jumps across the medial axis, and neighbouring pieces of a lattice may move differently. Where
//!    that folds a cell, or squeezes it below a twentieth, the field is diffused round the cell, and only there, in a few
//!    rounds.
//! 2. If cells still fold, the map is replaced by a flow in `2ᵏ` equal steps, `k ≤ 6`, resampled and certified again.
//! 3. The certificate ([`crate::certificate`]) must hold at the end, and the vertices that move most must have followed
//!    to within [`MapParams::tolerance`]; else the map is refused: nothing can push deeper than what is left to compress.
//!
//! # A part that moves alone
//!
//! With [`Outside::Free`] voxels outside the lattice don't take part, except as the far corners of the cells at its
//! surface: in a layer of two voxel diagonals the field continues the part's. The certificate covers the cells of the
//! part; the inverse is built from them, and what the part left and didn't come to is flagged as vacated.
//!
//! Sources: the thesis, 6.2–6.3 (the nearest lattice point through the octree; it leaves `w` open) and 7.4.

mod carry;
mod compose;
mod free;
mod octree;
mod outcome;
mod params;
mod region;
mod relax;

use ivd_core::{Displacement, Exec, FieldBricks, Frame, Grid, Lattice, Mask, Motion, NO_BRICK};
use nalgebra::Vector3;

use crate::Error;
use crate::certificate::Certificate;
use crate::inverse::{from_bricks, invert};
pub use carry::{Found, Hit, Nearest};
use carry::{Part, carry};
use compose::{Composed, halve};
pub use octree::{Prepared, frames, octree};
pub use outcome::{Followed, Mapped};
pub(crate) use params::smooth_fall;
pub use params::{DepthWeight, MapMethod, MapParams, Outside};
use region::{Region, largest};
use relax::relax;

/// Residual of the inverse above which a map is refused (voxels): a hundredth of what could be seen.
const RESIDUAL: f64 = 1e-2;

/// Largest motion that is mapped (mm): sums of a few such vectors still are finite in `f32`.
const FARTHEST: f64 = 1e37;

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
    params: &MapParams,
    exec: &Exec,
) -> Result<Mapped, Error> {
    params.check()?;
    check_inputs(lattice, motion)?;
    let frame = motion.frames.get(frame).ok_or_else(|| Error::Mismatch {
        what: "frame",
        problem: format!("frame {frame} of {}", motion.frames.len()),
        remedy: "name a frame of the motion, counted from 0",
    })?;
    if inside.grid() != &lattice.grid {
        return Err(ivd_core::Error::GridMismatch {
            a: "inside",
            a_dims: inside.grid().dims(),
            b: "lattice",
            b_dims: lattice.grid.dims(),
        }
        .into());
    }
    exec.run(|| {
        let positions = lattice.local_positions();
        map_frame(&Part { lattice, positions: &positions, inside, nearest }, motion, frame, params, exec)
    })
}

/// Maps one frame with the nearest points that `part` finds.
fn map_frame<N: Nearest>(
    part: &Part<'_, N>,
    motion: &Motion,
    frame: &Frame,
    params: &MapParams,
    exec: &Exec,
) -> Result<Mapped, Error> {
    let grid = &part.lattice.grid;
    if largest(frame) > FARTHEST {
        return Err(Error::Untrusted {
            what: "the map",
            problem: format!("a motion of {:e} mm is more than its vectors hold", largest(frame)),
            remedy: "move the handle less",
        });
    }
    let region = Region::new(motion, frame, part.positions, params);
    let bricks = match (largest(frame) == 0.0, exec.skip) {
        (_, false) => (0..grid.dims().iter().map(|n| n.div_ceil(8)).product()).collect(),
        (true, true) => Vec::new(),
        (false, true) => region.bricks(grid),
    };
    exec.check_memory("the displacement", 2 * 12 * 512 * bricks.len() as u64)?;
    let carried = carry(part, &frame.displacement, &region, params, &bricks, exec)?;
    let field = all_bricks(grid, &bricks, carried)?;
    let counts = |cell: [i64; 3]| params.outside == Outside::Band || touches(part.inside, cell);

    let relaxed = relax(field, grid, &region, &counts, exec)?;
    let (mut field, mut certificate, mut halvings) = (relaxed.field, relaxed.certificate, 0);
    if !certificate.holds() {
        match halve(&field, grid, certificate, &counts, exec)? {
            Composed::Found { field: f, certificate: c, halvings: h } => {
                (field, certificate, halvings) = (f, c, h);
            }
            Composed::Folded(last) => return Err(folded(&last, grid)),
        }
    }
    let field = without_zeros(field)?;
    let followed = Followed::measure(part, &field, frame);
    followed.check(params.tolerance)?;
    let (inverse, vacated) = match params.outside {
        Outside::Band => (invert(&field, grid, exec)?, Vec::new()),
        Outside::Free => free::invert_part(&field, grid, part.inside, exec)?,
    };
    if inverse.residual_max_voxels > RESIDUAL {
        return Err(Error::Untrusted {
            what: "the inverse of the map",
            problem: format!(
                "a residual of {:.3} voxels at voxel {:?}",
                inverse.residual_max_voxels,
                inverse.worst.map(|v| v.0)
            ),
            remedy: "move the handle less, or give it a larger radius",
        });
    }
    let displacement = Displacement {
        grid: grid.clone(),
        time: frame.time,
        forward: field,
        inverse: inverse.field,
        inverse_residual_max: inverse.residual_max_voxels,
        min_det_j: certificate.min_det,
        vacated: vacated.into(),
    };
    Ok(Mapped::new(displacement, certificate, relaxed.rounds, halvings, followed))
}

/// A field that stores every brick of Ω, zero or not, so that it can be worked on.
fn all_bricks(grid: &Grid, bricks: &[usize], carried: Vec<Box<[[f32; 3]]>>) -> Result<FieldBricks, Error> {
    let mut table = vec![NO_BRICK; grid.dims().iter().map(|n| n.div_ceil(8)).product()];
    let mut vectors = Vec::with_capacity(carried.len() * FieldBricks::VOXELS);
    for (slot, (&brick, values)) in bricks.iter().zip(carried).enumerate() {
        table[brick] = slot as u32;
        vectors.extend_from_slice(&values);
    }
    Ok(FieldBricks::new(grid.dims(), table, vectors.into())?)
}

fn without_zeros(field: FieldBricks) -> Result<FieldBricks, Error> {
    let stored: Vec<usize> = (0..field.table().len()).filter(|&b| field.table()[b] != NO_BRICK).collect();
    let some_zero = stored.iter().any(|&b| field.brick(b).is_some_and(|v| v.iter().all(|u| *u == [0.0; 3])));
    if !some_zero {
        return Ok(field);
    }
    let bricks = stored.iter().map(|&b| field.brick(b).expect("the brick is stored").into());
    from_bricks(field.dims(), &stored, bricks)
}

/// Whether a corner of the cell lies in the part.
fn touches(inside: &Mask, cell: [i64; 3]) -> bool {
    let dims = inside.grid().dims();
    (0..8_usize).any(|i| {
        let at: [usize; 3] =
            std::array::from_fn(|a| (cell[a] + (i >> a & 1) as i64).clamp(0, dims[a] as i64 - 1) as usize);
        inside.inside()[at[0] + dims[0] * (at[1] + dims[1] * at[2])] != 0
    })
}

fn folded(certificate: &Certificate, grid: &Grid) -> Error {
    let worst = certificate.worst.expect("a field that folds has a worst cell");
    let middle = Vector3::from(worst.cell).map(|c| c as f64 + 0.5);
    Error::Folded {
        voxel: worst.cell,
        world: grid.world(ivd_core::VoxelCoord(middle)).0.into(),
        lower: worst.lower,
        cells: certificate.folded.len(),
    }
}

/// Checks that lattice and motion belong together.
pub(crate) fn check_inputs(lattice: &Lattice, motion: &Motion) -> Result<(), Error> {
    motion.check()?;
    if !lattice.grid.matches(&motion.grid) {
        return Err(Error::Mismatch {
            what: "motion",
            problem: format!(
                "it moves a lattice on {:?}, not on {:?}",
                motion.grid.dims(),
                lattice.grid.dims()
            ),
            remedy: "map the motion onto the lattice that it was computed for",
        });
    }
    if lattice.keys.len() != motion.vertex_count {
        return Err(Error::Mismatch {
            what: "motion",
            problem: format!(
                "it moves {} vertices, the lattice has {}",
                motion.vertex_count,
                lattice.keys.len()
            ),
            remedy: "map the motion onto the lattice that it was computed for (the same level of refinement)",
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
