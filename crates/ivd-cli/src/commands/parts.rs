//! `ivd lattice … --parts`: the lattices of several labels, cut at once, in a folder.

use std::path::Path;

use ivd_artefact::{Artefact, Kind};
use ivd_lattice::extract::occurring;
use ivd_pipeline::stages::PartLattice;
use ivd_pipeline::{Inputs, OutputRecord};
use serde_json::json;

use super::stage::write_result;
use super::volume::volume_or_artefact;
use crate::context::Context;
use crate::exit::Failure;

/// Cuts them and writes `label-ID.ivd` for each that has voxels.
pub(super) fn run(
    volume: &Path,
    labels: &Path,
    parts: &str,
    folder: &Path,
    context: &Context,
) -> anyhow::Result<()> {
    let cache = context.stage_cache()?;
    let input = context.artefact(labels)?;
    let Artefact::Labels(found) = &*input.artefact else {
        return Err(Failure::usage(format!(
            "--labels {}: a {} artefact, not labels (`ivd import --labels` makes one of a label volume)",
            labels.display(),
            input.artefact.kind().name()
        )));
    };
    let volume_input = volume_or_artefact(volume, &cache, context)?;
    let same = match &*volume_input.artefact {
        Artefact::Volume(volume) => volume.grid().matches(found.grid()),
        Artefact::Labels(labels) => labels.grid().matches(found.grid()),
        other => {
            let (kind, wanted) = (other.kind().name(), Kind::Volume.name());
            return Err(Failure::usage(format!("{}: a {kind} artefact, not a {wanted}", volume.display())));
        }
    };
    if !same {
        return Err(Failure::usage(format!(
            "{} and {}: their grids differ; segment that volume, or give the labels' own",
            volume.display(),
            labels.display()
        )));
    }
    let ids = match parts {
        "all" => context.exec.run(|| occurring(found)),
        list => ids(list)?,
    };
    if ids.is_empty() {
        return Err(Failure::usage(format!("--parts {parts}: {} has no label but 0", labels.display())));
    }
    if let Some(problem) = unmade(folder) {
        return Err(Failure::usage(problem));
    }
    let mut records = Vec::new();
    for stage in PartLattice::all(&ids) {
        let inputs = Inputs::default().with("labels", input.clone());
        let mut done = context.run(&cache, &stage, &inputs)?;
        let path = folder.join(format!("label-{}.ivd", stage.label()));
        write_result(&done, &path, context)?;
        done.record.output = Some(OutputRecord {
            path: Some(path.clone()),
            kind: done.artefact.kind().name().to_owned(),
            hash: done.hash.to_string(),
        });
        let vertices = done.record.metrics.get("vertices").map(ToString::to_string).unwrap_or_default();
        context.say(&format!("label {}: vertices {vertices} → {}", stage.label(), path.display()));
        let mut record = serde_json::to_value(&done.record)?;
        record["label"] = json!(stage.label());
        records.push(record);
    }
    context.print(&json!({ "stage": "lattice", "parts": records }), String::new)
}

/// Ids from a list with commas.
fn ids(list: &str) -> anyhow::Result<Vec<u16>> {
    let id = |text: &str| {
        text.trim().parse().map_err(|_| {
            Failure::usage(format!(
                "--parts {list}: `{text}` is no label; give ids from 1 to 65535, or `all`"
            ))
        })
    };
    list.split(',').map(id).collect()
}

/// Why the folder for the lattices can't be had, if it can't.
fn unmade(folder: &Path) -> Option<String> {
    let problem = |what: &str| {
        Some(format!("-o {}: {what}; --parts writes a file for each label into a folder", folder.display()))
    };
    if folder.is_dir() {
        return None;
    }
    if folder.exists() {
        return problem("it is a file");
    }
    match std::fs::create_dir_all(folder) {
        Ok(()) => None,
        Err(error) => problem(&error.to_string()),
    }
}
