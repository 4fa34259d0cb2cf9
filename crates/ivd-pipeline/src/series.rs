//! What every frame of a motion makes of the volume: the stages behind the motion, once for each.

use std::collections::BTreeMap;

use ivd_artefact::Artefact;
use ivd_core::{Motion, Value as _};
use serde_json::Value as Json;

use crate::Error;
use crate::node::{Context, run_node_as};
use crate::outputs::Writer;
use crate::plan::{NodeId, Plan};
use crate::runner::{StageRecord, StageResult};
use crate::scene::{OF_FRAMES, Scene};

/// Where the displacement of the last frame stands among what is done, while another frame is drawn by the same camera.
const LAST: NodeId = NodeId { stage: ivd_map::STAGE.name, variant: "last frame" };

/// How records of single frames are told apart begins so.
pub(crate) const FRAME: &str = "frame";

/// Writes what is asked for of every frame; `done` holds what the scene's own was made of.
///
/// Every frame is mapped and certified by itself. That of the last frame is the scene's own; pictures of all are by its camera.
///
/// # Errors
/// The first frame that can't be made, with its number.
pub(crate) fn write(
    plan: &Plan,
    done: &BTreeMap<NodeId, StageResult>,
    writer: &mut Writer<'_>,
    context: Context<'_>,
) -> Result<Vec<StageRecord>, Error> {
    let motion = done.get(&plan.motion()).and_then(|done| ivd_core::Value::of(&done.artefact));
    let frames = motion.map_or(0, |motion: &Motion| motion.frames().len());
    let wanted: Vec<(usize, &str)> = plan.of_frames().collect();
    let named = wanted.iter().map(|(_, key)| format!("output.{key}")).collect::<Vec<_>>().join(" and ");
    let mut records = Vec::new();
    for frame in 0..frames {
        let (mut results, is_last) = (done.clone(), frame + 1 == frames);
        if !is_last {
            let made = of_frame(plan, frame, &mut results, &named, context);
            records.extend(made.map_err(|error| in_frame(error, frame, frames, &named))?);
        }
        for (at, key) in &wanted {
            writer.frame(key, frame, &results[&plan.nodes()[*at].id])?;
        }
    }
    for (_, key) in &wanted {
        writer.animation(key)?;
    }
    Ok(records)
}

/// What is to say of a motion of one frame where a scene asks for pictures, meshes or volumes of all.
pub(crate) fn still(scene: &Scene, made: &Artefact) -> Option<String> {
    Motion::of(made).filter(|motion| motion.frames().len() == 1)?;
    let is_of_all = |key: &str| key == "animation" || OF_FRAMES.contains(&key);
    let asked = scene.output.files().into_iter().map(|(key, _)| key).filter(|key| is_of_all(key));
    let asked: Vec<String> = asked.map(|key| format!("output.{key}")).collect();
    (!asked.is_empty()).then(|| format!(
        "{}: the motion has one frame, its end; deform.frames gives more, by a deform.solver that goes through time (dynamics, projective, xpbd)",
        asked.join(" and ")
    ))
}

/// Puts what the stages behind the motion make of one frame in the place of the scene's own.
fn of_frame(
    plan: &Plan,
    frame: usize,
    done: &mut BTreeMap<NodeId, StageResult>,
    named: &str,
    Context { loaded, options, runner }: Context<'_>,
) -> Result<Vec<StageRecord>, Error> {
    let loaded = loaded.with(ivd_map::STAGE.name, "frame", Json::from(frame))?;
    let mut own = Plan::new(&loaded, options.input.as_deref(), None)?;
    let (moved, mut records) = (plan.moved(), Vec::new());
    for &at in &moved {
        if let Some(shown) = own.hold(at, LAST) {
            let last = done[&shown].clone();
            done.insert(LAST, last);
        }
    }
    for at in moved {
        // Settings that a budget chose are those of all frames.
        let node = &own.nodes()[at];
        let chosen = if node.id.stage == ivd_map::STAGE.name { node } else { &plan.nodes()[at] };
        let mut result = run_node_as(node, chosen.stage.as_deref(), done, runner, options)?;
        result.record.variant = format!("{FRAME} {frame}");
        result.record.why = format!("needed for {named}; {}", result.record.why);
        records.push(result.record.clone());
        done.insert(node.id, result);
    }
    Ok(records)
}

/// A failure with the frame that it came from.
fn in_frame(error: Error, frame: usize, frames: usize, named: &str) -> Error {
    if let Error::Stage { stage, source, class } = error {
        let told = format!("frame {frame} of {frames}, from 0 ({named}): {source}");
        return Error::Stage { stage, source: told.into(), class };
    }
    error
}
