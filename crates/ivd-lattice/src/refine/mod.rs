//! Refinement of a lattice: fewer of the same vertices.
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
//! **Locks.** A vertex whose triangles aren't one closed fan (on a border, a non-manifold edge or a bow tie) stays.

mod blocks;
mod certified;
mod deviation;
mod distance;
mod half_edge;
mod mean;
mod numbering;
mod params;
mod passes;
mod quadric;
mod queue;
mod shared;
mod star;
mod surface;
mod tree;

use ivd_core::{Exec, Lattice};
use serde::{Deserialize, Serialize};

use crate::Error;
pub use certified::{Distances, distances};
pub use params::{Method, RefineParams, Target};
use surface::Surface;

/// A refined lattice and how far it is from its input.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// A subset of the input's vertices, with their keys and places, and new triangles between them.
    pub lattice: Lattice,
    /// How far the refinement went, and what ended it.
    pub reached: Reached,
    /// Bound on the distance between input and result, both ways (mm): the Hausdorff distance is at most this.
    pub max_error_mm: f64,
    /// Mean distance of the input's vertices from the result (mm), weighted by the area round them; perhaps a little
    /// too large, as the search for the nearest triangle is local. Above 2¹⁶ vertices it is that of every n-th.
    pub mean_error_mm: f64,
    /// Vertices of the input.
    pub vertices_in: usize,
    /// Triangles of the input.
    pub triangles_in: usize,
    /// Passes over the surface.
    pub passes: u32,
}

/// How far a refinement went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// Share of the triangles that is left; 1 for an empty lattice.
    pub ratio: f64,
    /// Level that the vertices left amount to: log₄ of how many times fewer they are.
    pub level: f64,
    /// What ended it.
    pub stopped_by: StoppedBy,
    /// Vertices that the last pass wanted to remove and why they are still there.
    pub refused: Refused,
}

/// What ended a refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StoppedBy {
    /// The level or ratio asked for was reached.
    Target,
    /// No vertex can go within the error asked for.
    MaxError,
    /// Most of what is left would pinch the surface: handles and thin necks.
    Links,
    /// Most of what is left would turn triangles over.
    Flips,
    /// Most of what is left are components of four vertices.
    Specks,
    /// Most of what is left lies on borders or where the input isn't a manifold.
    Locks,
}

/// Vertices left, counted by what kept them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Refused {
    /// Vertices whose every collapse would pinch the surface.
    pub links: u64,
    /// Vertices whose every collapse would turn a triangle over.
    pub flips: u64,
    /// Vertices of components that are tetrahedra.
    pub specks: u64,
    /// Vertices whose triangles aren't one closed fan.
    pub locks: u64,
    /// Vertices whose every collapse would exceed the error asked for.
    pub max_error: u64,
}

/// Refines a lattice by half-edge collapse.
///
/// The result is a subset of the input's vertices: same keys, same places, ascending. A closed manifold stays one, with
/// the same components and genus. A target that can't be reached isn't an error: [`Refined::reached`] says what stopped it.
///
/// # Errors
/// [`Error::Param`] for parameters outside their domain, [`ivd_core::Error::Inconsistent`] for a lattice whose parts
/// don't fit, [`ivd_core::Error::MemoryLimit`], [`ivd_core::Error::Cancelled`].
pub fn collapse(lattice: &Lattice, params: &RefineParams, exec: &Exec) -> Result<Refined, Error> {
    params.check()?;
    lattice.check()?;
    exec.check_memory("the surface to be refined", bytes_for(lattice))?;
    exec.run(|| {
        let mut surface = Surface::new(lattice);
        let run = passes::run(&mut surface, params, exec)?;
        exec.check_cancelled()?;
        let mean_error_mm = mean::mean_distance(&surface);
        exec.check_cancelled()?;
        Ok(finish(lattice, &surface, &run, mean_error_mm))
    })
}

/// Bytes of a surface with its quadrics, stars and bounds.
fn bytes_for(lattice: &Lattice) -> u64 {
    140 * lattice.keys.len() as u64 + 44 * lattice.triangles.len() as u64
}

fn finish(input: &Lattice, surface: &Surface, run: &passes::Run, mean_error_mm: f64) -> Refined {
    // Back to the input's order of vertices and triangles.
    let mut rank = vec![u32::MAX; input.keys.len()];
    for (_, &number) in surface.numbers.iter().enumerate().filter(|v| surface.is_left(v.0)) {
        rank[number as usize] = 0;
    }
    let kept: Vec<usize> = (0..rank.len()).filter(|&v| rank[v] == 0).collect();
    for (new, &old) in kept.iter().enumerate() {
        rank[old] = new as u32;
    }
    let mut order: Vec<u32> = (0..surface.triangles.len() as u32).collect();
    order.sort_unstable_by_key(|&t| surface.triangles.number(t));
    let corners = |t: &u32| surface.triangles.corners(*t).map(|v| rank[surface.numbers[v as usize] as usize]);
    let triangles: Vec<_> = order.iter().map(corners).collect();
    let max_error_mm = surface.max_bound();
    let level = if kept.is_empty() { 0.0 } else { (input.keys.len() as f64 / kept.len() as f64).log(4.0) };
    let share = triangles.len() as f64 / input.triangles.len() as f64;
    Refined {
        lattice: Lattice {
            grid: input.grid.clone(),
            source: input.source.clone(),
            keys: kept.iter().map(|&v| input.keys[v]).collect(),
            places: kept.iter().map(|&v| input.places[v]).collect(),
            triangles,
            level: input.level.saturating_add(level.round() as u8),
            max_error_mm: input.max_error_mm + max_error_mm,
        },
        reached: Reached {
            ratio: if input.triangles.is_empty() { 1.0 } else { share },
            level,
            stopped_by: run.stopped_by,
            refused: run.refused,
        },
        max_error_mm,
        mean_error_mm,
        vertices_in: input.keys.len(),
        triangles_in: input.triangles.len(),
        passes: run.passes,
    }
}
