//! Mapping by finite elements: the body and what surrounds it as elastic matter that the lattice pulls along.
//!
//! # The field
//!
//! ```text
//! u minimises  ∫ E(x) W(I + ∇u)   where  u(x_v) = U_v at the vertices  and  u = 0 on ∂Ω
//! ```
//!
//! - `W` is the compressible neo-Hookean energy of [`ivd_elastic`], so that turns cost nothing. `E` is 1 inside the lattice and
//!   [`FemParams::filler`] outside, or what [`FemParams::material`] say of a voxel's class; only ratios matter.
//! - Elements are hexahedra on the cells of a 2:1 balanced octree, finest ([`FemParams::cell`] voxels) round the vertices and at
//!   borders between materials, at most a quarter of the margin long elsewhere; with eight Gauss points, Lamé's constants at each
//!   the mean over its octant. Nodes that hang on a coarser cell take its values, so that the field is continuous.
//! - Cells that aren't wholly in Ω (in one of its balls) are left out, and their nodes held at 0: beyond Ω nothing moves, bit
//!   for bit. The end of the grid is natural.
//! - Vertices are pulled to their places between the nodes by springs, which are relieved by multipliers (augmented
//!   Lagrangian) until they hardly stretch. Where there are more vertices in a cell than it can follow, it does so by least
//!   squares.
//!
//! # The way
//!
//! The motion grows in up to [`INCREMENTS`] parts, each started from the last one's field, carried on. Newton's method with a
//! line search on the energy keeps `J > 0` at the Gauss points. Steps are bounded; where no equilibrium is found in them the
//! map is refused.
//!
//! Trilinear displacements lock as ν → 1/2, hence ν ≤ 0.45.
//!
//! Sources: Bonet & Wood 2008 (the law); Hestenes 1969, Powell 1969 (multipliers); Nocedal & Wright 2006 (Newton's method with
//! conjugate gradients).

mod build;
mod materials;

use ivd_core::Error as CoreError;
use ivd_core::op::Op as _;
use ivd_core::vertex_class;
use ivd_core::{Exec, FieldBricks, Frame, Grid, Labels, Lattice, Mask, Motion, VoxelCoord};
use ivd_elastic::{Body, Cells, Triple};
use ivd_field::sampler::interpolate;
use ivd_field::vectors::sampled;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::alone::cut;
use super::frame::{check_size, frame_of, moving_bricks, still};
use super::limit::as_far;
use super::outcome::SolveFigures;
use super::region::{Region, largest};
use super::settle::Settle;
use super::{FemParams, MapResult, Outside};
use crate::Error;
use build::{body, cells};
use materials::Materials;

/// Most parts that the motion grows in.
const INCREMENTS: u32 = 8;
/// What is left of the forces at the end, relative to those that cancel; and on the way.
const TOLERANCE: f64 = 1e-5;
const LOOSE: f64 = 1e-2;
/// Steps of Newton's method at the end, and for every increment.
const STEPS: u32 = 60;
const FEW: u32 = 12;
/// Times that the springs are relieved.
const RELIEFS: u32 = 10;
/// What the springs may leave of the motion (voxels, root mean square).
const FOLLOWED: f64 = 1e-3;

/// Maps frame `frame` of a motion by the equilibrium of elastic matter in which the lattice moves.
///
/// - `labels`: on the lattice's grid, for [`FemParams::material`].
///
/// # Errors
/// Inputs that don't belong together; material by class without labels; parameters out of their domain; a lattice that isn't closed; [`Error::Folded`] or
/// [`ivd_core::Error::Untrusted`] where no equilibrium is found, or no map free of folds follows the motion; the memory limit;
/// cancellation.
pub fn fem(
    lattice: &Lattice,
    labels: Option<&Labels>,
    motion: &Motion,
    frame: usize,
    params: &FemParams,
    exec: &Exec,
) -> Result<MapResult, Error> {
    params.check()?;
    check_size(frame_of(lattice, motion, frame)?)?;
    labels.map_or(Ok(()), |labels| vertex_class::check(lattice, labels))?;
    let labels = labels.filter(|_| !params.material.is_empty());
    if labels.is_none() && !params.material.is_empty() {
        return Err(CoreError::Mismatch {
            what: "material",
            problem: "there are no labels to know them by".into(),
            remedy: "give labels (--labels), or no material by class",
        }
        .into());
    }
    labels.map_or(Ok(()), |labels| labels.require_classes(params.material.keys().copied(), "material"))?;
    let inside = ivd_octree::inside(lattice, exec)?;
    exec.run(|| {
        as_far(motion, params.band.limit, |motion| {
            let frame = frame_of(lattice, motion, frame)?;
            map_frame(lattice, labels, &inside, motion, frame, params, exec)
        })
    })
}

fn map_frame(
    lattice: &Lattice,
    labels: Option<&Labels>,
    inside: &Mask,
    motion: &Motion,
    frame: &Frame,
    params: &FemParams,
    exec: &Exec,
) -> Result<MapResult, Error> {
    let region = Region::new(motion, frame, &lattice.local_positions(), &params.band, None);
    let bricks = moving_bricks(lattice.grid(), &region, frame, exec)?;
    let alone = (params.band.outside == Outside::Free).then_some(inside);
    let settle = Settle { lattice, alone, region: &region, motion, frame, band: &params.band };
    if largest(frame) == 0.0 {
        return settle.settle(still(lattice.grid(), &bricks)?, exec);
    }
    let cells = cells(lattice, &region, params.cell);
    let materials = Materials::new(inside, labels, params);
    let mut body = body(&cells, lattice, &materials, &|v| motion.role(v).constrains(), exec)?;
    exec.check_memory("the equations of the map", body.bytes())?;
    let (field, solved) = equilibrium(&mut body, lattice, frame, cells.length(), exec)?;
    let sampled = sample(&body, &cells, lattice.grid(), &field, &bricks, exec)?;
    let mut mapped = settle
        .settle(cut(FieldBricks::of_bricks(lattice.grid().dims(), &bricks, sampled.into())?, alone)?, exec)?;
    mapped.figures.solved = Some(solved);
    Ok(mapped)
}

/// The nodes' motion (mm) for which the forces cancel. `length`: edge of the finest cells (mm).
fn equilibrium(
    body: &mut Body,
    lattice: &Lattice,
    frame: &Frame,
    length: f64,
    exec: &Exec,
) -> Result<(Vec<Triple>, SolveFigures), Error> {
    let nodes = body.mesh.held.iter().filter(|h| !**h).count() as u64;
    let increments = ((largest(frame) / (2.0 * length)).ceil() as u32).clamp(1, INCREMENTS);
    let mut solved = SolveFigures { nodes, increments, ..SolveFigures::default() };
    let mut u = vec![[0.0; 3]; body.mesh.nodes.len()];
    let observer = exec.observer();
    observer.begin("equilibrium", u64::from(increments));
    for increment in 1..=increments {
        let part = f64::from(increment) / f64::from(increments);
        for pull in body.pulls_mut() {
            pull.goal = Vector3::from(frame.displacement[pull.vertex as usize]) * part;
        }
        if increment > 1 {
            carry_on(body, &mut u, f64::from(increment) / f64::from(increment - 1));
        }
        if increment < increments {
            let balance = body.balance(&mut u, LOOSE, FEW, exec)?;
            solved.iterations += balance.iterations;
        }
        observer.advance("equilibrium", 1);
    }
    let relieved = relieve(body, &mut u, lattice.grid(), &mut solved, exec);
    observer.end("equilibrium");
    relieved?;
    Ok((u, solved))
}

/// The field made larger as the motion grows, where that leaves J > 0 and is the better start.
fn carry_on(body: &Body, u: &mut Vec<Triple>, times: f64) {
    let longer: Vec<Triple> = u.iter().map(|v| v.map(|c| c * times)).collect();
    if let (Some(now), Some(then)) = (body.energy(u), body.energy(&longer))
        && then.0 < now.0
    {
        *u = longer;
    }
}

/// Balances the forces, and relieves the springs of what they still hold, until they hardly stretch.
fn relieve(
    body: &mut Body,
    u: &mut Vec<Triple>,
    grid: &Grid,
    solved: &mut SolveFigures,
    exec: &Exec,
) -> Result<(), Error> {
    let to_voxel = grid.inverse_linear_part();
    let (mut steps, mut before) = (0, f64::INFINITY);
    for relief in 0..=RELIEFS {
        let found = (relief > 0).then(|| (u.clone(), solved.residual));
        let balance = body.balance(u, TOLERANCE, STEPS - steps, exec)?;
        steps += balance.steps;
        solved.iterations += balance.iterations;
        solved.residual = balance.residual;
        if !balance.reached {
            // The balance before this relief is one; how closely it follows is judged with the map.
            let Some((kept, residual)) = found else {
                return Err(no_balance(balance.residual, steps).into());
            };
            (*u, solved.residual) = (kept, residual);
            return Ok(());
        }
        let left: Vec<Vector3<f64>> =
            body.pulls().par_iter().map(|p| p.left(&body.mesh.gather(p.cell as usize, u))).collect();
        let squares: f64 = left.iter().map(|l| (to_voxel * l).norm_squared()).sum();
        let apart = (squares / left.len().max(1) as f64).sqrt();
        // What cells can't follow stays, however often the springs are relieved.
        if apart <= FOLLOWED || apart > 0.8 * before || steps >= STEPS || relief == RELIEFS {
            return Ok(());
        }
        before = apart;
        for (pull, left) in body.pulls_mut().iter_mut().zip(left) {
            pull.multiplier += left * pull.spring;
        }
    }
    Ok(())
}

fn no_balance(residual: f64, steps: u32) -> CoreError {
    CoreError::Untrusted {
        what: "the map",
        problem: format!(
            "no balance of forces is found: {residual:.1e} of them are left after {steps} steps, more than {TOLERANCE:.0e}"
        ),
        remedy: "move the handle less, give it a larger radius, raise filler, or lower poisson and the contrast of classes",
    }
}

/// The motion at the voxels of bricks.
fn sample(
    body: &Body,
    cells: &Cells,
    grid: &Grid,
    u: &[Triple],
    bricks: &[usize],
    exec: &Exec,
) -> Result<Vec<[f32; 3]>, CoreError> {
    sampled("map", grid.dims(), bricks, exec, |voxel, (): &mut ()| {
        let Some((cell, place)) = body.mesh.locate(cells.place(VoxelCoord::from(voxel).0)) else {
            return Vector3::zeros();
        };
        interpolate(&body.mesh.gather(cell, u).map(Vector3::from), place.into())
    })
}

#[cfg(test)]
mod tests;
