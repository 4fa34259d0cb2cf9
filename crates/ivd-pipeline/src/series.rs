//! What every frame of a motion makes of the volume: the stages behind the motion, once for each.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ivd_core::Motion;
use serde_json::Value as Json;

use crate::outputs::Writer;
use crate::pipeline::{Context, run_node};
use crate::plan::{NodeId, Plan, SERIES};
use crate::runner::{StageRecord, StageResult};
use crate::{Error, ending};

/// Writes the volume of every frame; `last` is the place that the scene's own came from, and `done` what it was made of.
///
/// Every frame is mapped and certified by itself. That of the last frame is the scene's own.
///
/// # Errors
/// The first frame that can't be made, with its number.
pub(crate) fn write(
    plan: &Plan,
    last: usize,
    done: &BTreeMap<NodeId, StageResult>,
    writer: &mut Writer<'_>,
    context: Context<'_>,
) -> Result<Vec<StageRecord>, Error> {
    let motion = done.get(&plan.motion()).and_then(|done| ivd_core::Value::of(&done.artefact));
    let frames = motion.map_or(0, |motion: &Motion| motion.frames().len());
    let mut records = Vec::new();
    for frame in 0..frames {
        let whole = &done[&plan.nodes()[last].id];
        if frame + 1 == frames {
            writer.frame(frame, whole)?;
            continue;
        }
        let made = of_frame(plan, last, frame, done, context);
        let (result, more) = made.map_err(|error| in_frame(error, frame, frames))?;
        writer.frame(frame, &result)?;
        records.extend(more);
    }
    Ok(records)
}

/// What the stages behind the motion make of one frame.
fn of_frame(
    plan: &Plan,
    last: usize,
    frame: usize,
    done: &BTreeMap<NodeId, StageResult>,
    Context { loaded, options, runner }: Context<'_>,
) -> Result<(StageResult, Vec<StageRecord>), Error> {
    let loaded = loaded.with(ivd_map::STAGE.name, "frame", Json::from(frame))?;
    let own = Plan::new(&loaded, options.input.as_deref(), None)?;
    let (mut done, mut records) = (done.clone(), Vec::new());
    for at in plan.moved_until(last) {
        let node = &own.nodes()[at];
        let mut result = run_node(node, &done, runner, options)?;
        result.record.variant = format!("frame {frame}");
        result.record.why = format!("needed for output.{SERIES}; {}", result.record.why);
        records.push(result.record.clone());
        done.insert(node.id, result);
    }
    let id = own.nodes()[last].id;
    let made = done
        .remove(&id)
        .ok_or_else(|| Error::usage("pipeline", format!("output.{SERIES}: nothing moves the volume")))?;
    Ok((made, records))
}

/// A failure with the frame that it came from.
fn in_frame(error: Error, frame: usize, frames: usize) -> Error {
    if let Error::Stage { stage, source, class } = error {
        let told = format!("frame {frame} of {frames}, from 0 (output.{SERIES}): {source}");
        return Error::Stage { stage, source: told.into(), class };
    }
    error
}

/// The file of a frame, counted from 0 as `map.frame` counts: `name_0000.nii.gz` is that of the first.
pub(crate) fn file_of(path: &Path, frame: usize) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let dots = if ending(path) == "nii.gz" { 2 } else { 1 };
    let parts: Vec<&str> = name.rsplitn(dots + 1, '.').collect();
    let Some((stem, endings)) = parts.split_last().filter(|(_, endings)| !endings.is_empty()) else {
        return path.with_file_name(format!("{name}_{frame:04}"));
    };
    let ending: Vec<&str> = endings.iter().rev().copied().collect();
    path.with_file_name(format!("{stem}_{frame:04}.{}", ending.join(".")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered_before_the_ending() {
        let cases = [
            ("a/b.nii.gz", 0, "a/b_0000.nii.gz"),
            ("v.1.mha", 41, "v.1_0041.mha"),
            ("İ.NRRD", 7, "İ_0007.NRRD"),
            ("volumé", 3, "volumé_0003"),
        ];
        for (path, frame, file) in cases {
            assert_eq!(file_of(Path::new(path), frame), Path::new(file));
        }
    }
}
