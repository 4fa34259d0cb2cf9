//! The thesis's comparison of refinements (section 5.2) made again: one lattice by every method at the same counts, with
//! pictures, errors and topology.
//!
//! [`refinements`] measures, [`refinements_page`] writes it down with what the thesis concludes beside it.

mod claims;
mod inputs;
mod page;
mod pictures;
mod results;
mod rows;

use std::time::Instant;

use ivd_core::{Exec, Image, Lattice};
use ivd_lattice::refine::{Locks, Method, RefineParams, StopReason, Target, chain};

pub use page::refinements_page;
pub use results::{Claim, LatticeBench, Reach, RefinementBench};
pub use rows::{RefinementRow, Shape};

use crate::experiment::Problem;
use crate::stages::methods::METHODS;
use crate::{Error, Options};
use inputs::{Input, inputs};
use rows::Rows;

/// Shares of the triangles that every method is asked for.
const SHARES: [f64; 4] = [0.25, 0.1, 0.05, 0.01];
/// The share that [`RefinementBench::sheet`] shows.
const SHEET: f64 = 0.01;
/// Levels that are tried.
const LEVELS: [u8; 6] = [1, 2, 3, 4, 5, 6];
/// How many of the coarsest levels of the inverse subdivision are held against other methods.
const COMPARED: usize = 3;

/// Refines lattices by every method, on generated inputs or on the volume of `options`.
///
/// - `iso`: where the given volume is cut; without it, the densest part's own value.
///
/// # Errors
/// [`Error::Failed`] names the lattice; cancelled.
pub fn refinements(options: &Options, iso: Option<f64>, exec: &Exec) -> Result<RefinementBench, Error> {
    let failed = |name: &str, problem: &Problem| Error::Failed {
        stage: "refinements".to_owned(),
        knobs: name.to_owned(),
        problem: problem.to_string(),
    };
    let inputs = inputs(options, iso, exec).map_err(|problem| failed("the input", &problem))?;
    let repeats = options.repeats.max(1);
    let steps = METHODS.len() * (SHARES.len() + 1) + 2;
    exec.observer().begin("refinements", (inputs.len() * steps) as u64);
    let mut lattices = Vec::new();
    for input in &inputs {
        lattices.push(measured(input, repeats, exec).map_err(|problem| failed(&input.words, &problem))?);
    }
    exec.observer().end("refinements");
    Ok(RefinementBench {
        schema: 1,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        threads: exec.threads(),
        repeats,
        lattices,
    })
}

fn measured(input: &Input, repeats: usize, exec: &Exec) -> Result<LatticeBench, Problem> {
    let lattice = &input.lattice;
    if lattice.triangles().is_empty() {
        return Err("there is no surface".into());
    }
    let rows = Rows::new(input, repeats, exec)?;
    let step = || -> Result<(), Problem> {
        exec.check_cancelled()?;
        exec.observer().advance("refinements", 1);
        Ok(())
    };
    let mut shares = Vec::new();
    for share in SHARES {
        for method in METHODS {
            let asked = format!("{} %", 100.0 * share);
            shares.push(rows.row(method, Target::Ratio(share), asked)?);
            step()?;
        }
    }
    let same_counts = same_counts(&rows)?;
    step()?;
    let mut reach = Vec::new();
    for method in METHODS {
        reach.push(reached(&rows, method)?);
        step()?;
    }
    let levels = levels(&rows, lattice, exec)?;
    step()?;
    let mut bench = LatticeBench {
        input: input.words.clone(),
        voxel_mm: rows.voxel_mm,
        crease_vertices: rows.creases.len(),
        shape: rows.shape.clone(),
        shares,
        same_counts,
        reach,
        levels,
        claims: Vec::new(),
    };
    bench.claims = claims::claims(&bench);
    Ok(bench)
}

/// The coarsest levels that the inverse subdivision reaches, and decimation and the default at as many triangles.
fn same_counts(rows: &Rows) -> Result<Vec<RefinementRow>, Problem> {
    let mut reached = Vec::new();
    for level in LEVELS {
        let row = rows.row(Method::Loop, Target::Level(level), format!("level {level}"))?;
        if row.stopped_by != StopReason::Target {
            break;
        }
        reached.push(row);
    }
    let mut all = Vec::new();
    for subdivided in reached.split_off(reached.len().saturating_sub(COMPARED)) {
        let (count, asked) = (subdivided.triangles, subdivided.asked.clone());
        all.push(subdivided);
        for method in [Method::Decimate, RefineParams::default().method] {
            all.push(rows.row(method, Target::Count(count), asked.clone())?);
        }
    }
    Ok(all)
}

fn reached(rows: &Rows, method: Method) -> Result<Reach, Problem> {
    let none = rows.refined(method, Target::Count(0))?;
    let stopped_by = none.reached.stopped_by;
    let (mut levels, mut fewest) = (Vec::new(), none.lattice);
    for level in LEVELS {
        let found = rows.refined(method, Target::Level(level))?;
        let there = found.reached.stopped_by == StopReason::Target;
        levels.push(there.then_some(found.lattice.keys().len()));
        // Sampling for no triangles ends at the first rate that leaves nothing; some coarser ones leave something.
        if there && found.lattice.keys().len() < fewest.keys().len() {
            fewest = found.lattice;
        }
    }
    Ok(Reach {
        method: method.name().to_owned(),
        levels,
        least: fewest.keys().len(),
        stopped_by,
        same_topology: Shape::of(&fewest).is_as(&rows.shape),
    })
}

/// The lattice and levels of it by the default, each from the one before, down to the first that isn't reached.
fn levels(rows: &Rows, lattice: &Lattice, exec: &Exec) -> Result<Vec<RefinementRow>, Problem> {
    let params = RefineParams::default();
    let mut all = vec![rows.whole()?];
    for i in 0..LEVELS.len() {
        let start = Instant::now();
        let found = chain(lattice, &params, &LEVELS[..=i], Locks::NONE, exec)?;
        let seconds = start.elapsed().as_secs_f64();
        let last = found.last().ok_or("a chain has as many levels as were asked for")?;
        let mut row = rows.judged(params.method, format!("level {}", LEVELS[i]), last, seconds)?;
        // Its lattice's bound adds those of the levels before.
        row.bound_mm = last.lattice.max_error_mm() - lattice.max_error_mm();
        all.push(row);
        if last.reached.stopped_by != StopReason::Target {
            break;
        }
    }
    Ok(all)
}

impl RefinementBench {
    /// One picture of the first lattice by every method at a hundredth of the triangles: wire-frames above, coloured by
    /// the distance from the input below.
    pub fn sheet(&self) -> Image {
        let asked = format!("{} %", 100.0 * SHEET);
        let rows = self.lattices.iter().take(1).flat_map(|l| &l.shares).filter(|row| row.asked == asked);
        pictures::sheet(&rows.map(|row| &row.pictures).collect::<Vec<_>>())
    }
}
