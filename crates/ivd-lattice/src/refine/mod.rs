//! Refinement of a lattice: fewer of the same vertices.
//!
//! [`refine`] does what the parameters' method says, [`chain`] several levels one from the other. No method makes or moves
//! a vertex.
//!
//! [`collapse`] removes vertices one by one by half-edge collapse: a vertex is pulled onto a neighbour, its two triangles
//! between them vanish, and the others round it follow. No vertex is made or moved, so that every vertex left keeps its
//! address on the grid. What it never does: open a closed surface, join or pinch parts of it, change its genus, let a
//! component vanish (a tetrahedron is the least), turn a triangle over at once, or leave one without area. What it doesn't
//! watch: sheets that come closer than the error may pass through each other.
//!
//! **Order.** Each vertex is judged by the mean squared distance of its target from the planes that met in it and in all
//! that were collapsed onto it (Garland & Heckbert 1997, as half-edge collapse). Passes take the cheapest part of the
//! vertices; a vertex that was collapsed onto waits for the next pass, and so does a collapse whose bound (below) is
//! large for what the pass may cost. Space is cut into blocks, which are worked on side by side, each in the order of
//! cost, ties by index; a vertex whose ring lies across a border of blocks waits, and the next pass has other borders. The
//! result is the same for any number of threads. A vertex that can't go isn't tried again until something changes round
//! it, or nothing else is left to try. The end comes with the target, or with a pass that has tried every free vertex onto
//! each of its neighbours, whatever that costs, and removed none.
//!
//! **Error.** Every triangle carries a bound on its distance from the input, both ways, that grows with each collapse by
//! the displacement of a map between the old and the new fan. [`Refined::max_error_mm`] is the largest: the
//! Hausdorff distance is never above it.
//!
//! **Locks.** A vertex whose triangles aren't one closed fan (on a border, a non-manifold edge or a bow tie) stays, and so
//! do those of [`Locks`] and the corners of features ([`RefineParams::feature_degrees`]).
//!
//! **Decimation** ([`Method::Decimate`]) removes vertices in the order of their distance from the average plane round them
//! and triangulates the hole anew. What it keeps, and what its bound means, is the same.

mod blocks;
mod certified;
mod chain;
mod decimate;
mod deviation;
mod distance;
mod features;
mod half_edge;
mod inverse;
mod locks;
mod loop_levels;
mod mean;
mod measured;
mod merge;
mod mesh;
mod numbering;
mod params;
mod passes;
mod patch;
mod pull;
mod quadric;
mod queue;
mod refusal;
pub mod repair;
mod report;
mod sample;
mod shared;
mod slivers;
mod small_parts;
mod stage;
mod star;
mod surface;
mod topology;
mod tree;

use ivd_core::{Exec, Lattice};

use crate::Error;
pub use certified::{Distances, distances};
pub use chain::{chain, with_levels};
pub use locks::{Locks, vertices_within};
pub use params::{Method, RefineParams, Target, TargetKeys};
pub use refusal::{Refused, StopReason};
pub use report::{RefineStatus, Refined};
use small_parts::SmallParts;
pub use stage::{LevelFigures, Lock, RefineFigures, Refinement, STAGE};
use surface::{Surface, bytes_for};

/// Refines a lattice by the method that the parameters name.
///
/// Whatever the method, the result is a subset of the input's vertices: same keys, same places, ascending. A target that
/// can't be reached isn't an error: [`Refined::reached`] says what stopped it.
///
/// - `locks`: vertices that stay, whatever the method.
///
/// # Errors
/// [`ivd_core::Error::Param`] for parameters outside their domain or a lock that names no vertex,
/// [`ivd_core::Error::Inconsistent`] for a lattice whose parts don't fit, [`ivd_core::Error::MemoryLimit`],
/// [`ivd_core::Error::Cancelled`].
pub fn refine(
    lattice: &Lattice,
    params: &RefineParams,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    params.check()?;
    locks.check(lattice)?;
    match params.method {
        Method::Collapse => collapse_locked(lattice, params, locks, exec),
        Method::Decimate => decimate::decimate(lattice, params, locks, exec),
        Method::Loop => loop_levels::loop_levels(lattice, params, locks, exec),
        Method::Merge => merge::merge(lattice, params, locks, exec),
        Method::Sample => sample::sample(lattice, params, locks, exec),
    }
}

/// Refines a lattice by half-edge collapse, whatever method the parameters name, and without locks.
///
/// A closed manifold stays one, with the same components and genus.
///
/// # Errors
/// As [`refine`].
pub fn collapse(lattice: &Lattice, params: &RefineParams, exec: &Exec) -> Result<Refined, Error> {
    params.check()?;
    collapse_locked(lattice, params, Locks::NONE, exec)
}

fn collapse_locked(
    lattice: &Lattice,
    params: &RefineParams,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    exec.check_memory("the surface to be refined", bytes_for(lattice))?;
    exec.run(|| {
        let mut surface = Surface::new(lattice, locks, params.feature_degrees);
        let mut run = passes::run(&mut surface, params, SmallParts::of(lattice, params), exec)?;
        if params.allow_topology && run.stopped_by != StopReason::Target {
            run = topology::run(&mut surface, params, lattice.triangles().len(), run.passes, exec)?;
        }
        exec.check_cancelled()?;
        let seen = mean::distances_seen(&surface);
        exec.check_cancelled()?;
        Ok(run.outcome(&surface, seen).report(lattice))
    })
}
