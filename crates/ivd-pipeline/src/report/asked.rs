//! What was asked of time and of the volume, beside where the lattice was to go: frames, a combination, a clip.

use ivd_field::clip::{self, ClipParams, SceneClip};
use ivd_field::combine::{self, SceneCombine};
use ivd_motion::deform;
use ivd_report::{pairs, shown};
use serde_json::Value as Json;

use super::recorded::{in_full, of_record};
use crate::StageRecord;
use crate::scene::Scene;

/// Each in a line; nothing where nothing was asked.
pub(super) fn asked(scene: &Scene, records: &[StageRecord]) -> String {
    let mut rows = Vec::new();
    rows.extend(frames(records).map(|frames| ("through time", frames)));
    rows.extend(
        scene.get::<SceneCombine>(&combine::STAGE).and_then(combination).map(|said| ("combined", said)),
    );
    rows.extend(scene.get::<SceneClip>(&clip::STAGE).and_then(kept).map(|said| ("clipped", said)));
    if rows.is_empty() { String::new() } else { pairs(&rows) }
}

/// The frames of a motion of several, and when they are.
fn frames(records: &[StageRecord]) -> Option<String> {
    let [frames, duration] = ["frames", "duration"].map(|key| of_record(records, deform::STAGE.name, key));
    let several = frames.parse::<usize>().ok().filter(|frames| *frames > 1)?;
    let last = several - 1;
    Some(format!(
        "{several} frames, evenly in {duration} s: frame 0 is the first on the way, frame {last} the end"
    ))
}

/// How a volume was put together with another.
fn combination(asked: &SceneCombine) -> Option<String> {
    let with = asked.with.as_ref()?;
    // Folders may carry a patient's name.
    let name = std::path::Path::new(with).file_name().unwrap_or_default().to_string_lossy();
    let op = serde_json::to_value(asked.combine.op).ok();
    Some(format!("{} with {name}", op.as_ref().and_then(Json::as_str).unwrap_or("put together")))
}

/// What a clip keeps.
fn kept(asked: &SceneClip) -> Option<String> {
    let ClipParams { planes, boxes, class, invert, .. } = &asked.clip;
    let planes = planes.iter().map(|plane| {
        format!("beyond the plane through ({}) towards ({})", in_full(plane.point), in_full(plane.normal))
    });
    let boxes = boxes
        .iter()
        .map(|inside| format!("in the box from ({}) to ({})", in_full(inside.min), in_full(inside.max)));
    let tag = asked.tag.as_ref().map(|_| match class {
        Some(class) => format!("tagged as class {class}"),
        None => "tagged".to_owned(),
    });
    let all: Vec<String> = planes.chain(boxes).chain(tag).collect();
    if all.is_empty() {
        return None;
    }
    let whose = shown(serde_json::to_value(asked.of).ok().as_ref());
    let does = if *invert { "leaves out" } else { "keeps" };
    Some(format!("of the {whose} {does} what lies {}", all.join(", and ")))
}
