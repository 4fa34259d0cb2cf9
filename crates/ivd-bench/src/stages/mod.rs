//! The experiments: one file a stage.

mod atf;
mod clusters;
mod deform;
mod deformation;
mod given;
mod lattice;
mod map;
pub(crate) mod methods;
mod refine;
mod render;
mod segment;
mod solvers;
mod warp;

pub use given::Given;
use ivd_core::Exec;
pub(crate) use map::part;

use crate::Error;
use crate::experiment::{Experiment, Problem};

/// The stages that have experiments, in the order of the pipeline.
pub const NAMES: [&str; 8] = ["segment", "atf", "lattice", "refine", "deform", "map", "warp", "render"];

/// Experiments that run where they are named only: they take longer.
pub const ON_REQUEST: [&str; 8] = [
    "segment-kmvs",
    "segment-emvs",
    "segment-msvs",
    "segment-hvs",
    "refine-methods",
    "solvers",
    "map-methods",
    "deformation",
];

/// The experiments of a stage on generated inputs of `size` voxels along an edge; none for a stage without.
///
/// # Errors
/// [`Error::Failed`] where an input or a reference can't be made.
pub fn experiments(stage: &str, size: usize, exec: &Exec) -> Result<Vec<Experiment>, Error> {
    let made: Result<Experiment, Problem> = match stage {
        "segment" => segment::experiment(size, exec),
        "atf" => atf::experiment(size, exec),
        "lattice" => lattice::experiment(size),
        "refine" => refine::experiment(size, exec),
        "refine-methods" => methods::experiment(size, exec),
        "deform" => deform::experiment(size, exec),
        "solvers" => solvers::experiment(size, exec),
        "map" => map::experiment(size, exec),
        "map-methods" => deformation::maps(size, exec),
        "deformation" => deformation::whole(size, exec),
        "warp" => warp::experiment(size),
        "render" => render::experiment(size, exec),
        _ => match clusters::experiment(stage, size, exec) {
            Some(made) => made,
            None => return Ok(Vec::new()),
        },
    };
    Ok(vec![made.map_err(|problem| failed(stage, &problem))?])
}

/// The experiment of a stage on a given volume; `None` where its truth is a formula that no scan has.
///
/// # Errors
/// [`Error::Failed`] where a reference can't be made.
pub fn given(stage: &str, given: &Given, exec: &Exec) -> Result<Option<Experiment>, Error> {
    given::experiment(stage, given, exec).map_err(|problem| failed(stage, &problem))
}

fn failed(stage: &str, problem: &Problem) -> Error {
    Error::Failed { stage: stage.to_owned(), knobs: "its input".to_owned(), problem: problem.to_string() }
}
