//! `ivd compare`.

use std::path::Path;

use ivd_artefact::Cache;
use ivd_core::Artefact;
use serde_json::json;

use crate::context::Context;
use crate::files::volume_or_artefact;

/// Tells the error between two artefacts (or volume files) of one kind.
pub(super) fn run(a: &Path, b: &Path, context: &Context) -> anyhow::Result<()> {
    let off = Cache::disabled();
    let first = volume_or_artefact(a, &off, context)?;
    let second = volume_or_artefact(b, &off, context)?;
    let mut error = ivd_pipeline::compare(&first.artefact, &second.artefact, &context.exec)?;
    if let Some(unproven) = error["unproven"].as_u64().filter(|n| *n > 0) {
        context.say(&format!(
            "ivd: note: {unproven} classes of {} overlap those of {} in too great a tangle for the best matching; they \
             are matched by Dice, the largest first",
            a.display(),
            b.display()
        ));
    }
    error["a"] = json!(a);
    error["b"] = json!(b);
    error["equal"] = json!(first.hash == second.hash);
    if first.hash != second.hash {
        let differing = differing(&first.artefact, &second.artefact);
        if !differing.is_empty() {
            context.say(&format!("ivd: note: they differ in their {}", differing.join(", ")));
        }
        error["differs_in"] = json!(differing);
    }
    context.print(&error, || format!("{error:#}"))
}

/// What two volumes differ in beside their values.
fn differing(a: &Artefact, b: &Artefact) -> Vec<&'static str> {
    let (Artefact::Volume(a), Artefact::Volume(b)) = (a, b) else { return Vec::new() };
    let (here, there) = (a.grid(), b.grid());
    [
        ("stored type", a.voxel_type() != b.voxel_type()),
        ("scale", (a.slope(), a.intercept()) != (b.slope(), b.intercept())),
        ("modality", a.modality() != b.modality()),
        ("spacing", here.spacing() != there.spacing()),
        ("origin", here.origin() != there.origin()),
        ("axes", here.direction() != there.direction()),
        ("word of where the patient lies", here.in_patient() != there.in_patient()),
    ]
    .into_iter()
    .filter_map(|(what, differs)| differs.then_some(what))
    .collect()
}
