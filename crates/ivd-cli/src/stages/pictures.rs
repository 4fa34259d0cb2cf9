//! What the files of pictures need of `ivd render`.

use std::path::Path;

use ivd_pipeline::{Section, check_pictures, ending};
use serde_json::Value as Json;

/// An `.exr` holds the light that a picture is made of.
pub(super) fn implied(output: &Path) -> Option<(&'static str, Json)> {
    (ending(output) == "exr").then_some(("keep_light", Json::Bool(true)))
}

/// Refuses a file that can't hold the pictures.
pub(super) fn check(section: &Section, output: &Path) -> anyhow::Result<()> {
    // An artefact holds everything, and figures are of anything.
    if matches!(&*ending(output), "ivd" | "json") {
        return Ok(());
    }
    let params = section.job().params();
    let frames = params.get("turntable").and_then(Json::as_u64).unwrap_or(1);
    let has_light = params.get("keep_light").and_then(Json::as_bool).unwrap_or(false);
    Ok(check_pictures(output, frames as usize, has_light)?)
}
