//! `ivd compare`.

use std::path::Path;

use ivd_artefact::Cache;
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
    context.print(&error, || format!("{error:#}"))
}
