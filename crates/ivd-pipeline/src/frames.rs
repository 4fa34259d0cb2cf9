//! Single frames of a motion, outside of scenes.

use ivd_core::op::{Stage, Want};
use ivd_core::{Motion, Value as _};
use serde_json::{Value as Json, json};

use crate::export::check_frame;
use crate::runner::{Runner, StageResult};
use crate::{Error, Input, Inputs, Section};

/// The displacement of a frame of a lattice's motion, mapped as `map.frame` maps it, with what the stages do where nothing else is said,
/// and certified.
///
/// # Errors
/// A usage error where the value is no motion or has no such frame, and those of the stages: a frame that folds is refused.
pub fn map_frame(
    lattice: &Input,
    motion: &Input,
    frame: usize,
    runner: Runner<'_>,
) -> Result<StageResult, Error> {
    let frames = Motion::of(&motion.artefact).ok_or_else(|| {
        let kind = motion.artefact.kind().name();
        Error::usage("export", format!("a {kind} artefact has no frames; motions have"))
    })?;
    check_frame(frame, frames)?;
    let map = section(&ivd_map::STAGE, &json!({ "frame": frame }))?;
    let mut inputs = Inputs::default().with("lattice", lattice.clone()).with("motion", motion.clone());
    if map.method().has_slot("octree") && map.wants("octree") != Want::No {
        let read = Inputs::default().with("lattice", lattice.clone());
        let octree = runner.run(&section(&ivd_octree::STAGE, &json!({}))?, &read, false)?;
        inputs = inputs.with("octree", octree.input());
    }
    runner.run(&map, &inputs, false)
}

/// A stage with these keys.
fn section(stage: &'static Stage, keys: &Json) -> Result<Section, Error> {
    let parsed = Section::parse(stage, keys.as_object().cloned());
    parsed.map_err(|problem| Error::usage(stage.name, problem.told_of(stage.name)))
}
