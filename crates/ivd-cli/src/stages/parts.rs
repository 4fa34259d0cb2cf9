//! `ivd lattice … --parts`: the lattices of several labels, cut at once, in a folder.

use std::path::Path;

use ivd_artefact::{Artefact, Kind};
use ivd_core::{ErrorClass, Labels, Value as _, Volume};
use ivd_lattice::extract::{LatticeFigures, labels_present};
use ivd_pipeline::stages::part_lattices;
use ivd_pipeline::{OutputRecord, Runner};
use serde_json::json;

use crate::context::Context;
use crate::exit::Failure;
use crate::files::{volume_or_artefact, write_result};

/// Cuts them and writes `label-ID.ivd` for each.
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
    let made = &*volume_input.artefact;
    let grid = Volume::of(made).map(Volume::grid).or_else(|| Labels::of(made).map(Labels::grid));
    let Some(grid) = grid else {
        let (kind, wanted) = (made.kind().name(), Kind::Volume.name());
        return Err(Failure::usage(format!("{}: a {kind} artefact, not a {wanted}", volume.display())));
    };
    if !grid.matches(found.grid()) {
        return Err(Failure::usage(format!(
            "{} and {}: their grids differ; segment that volume, or give the labels' own",
            volume.display(),
            labels.display()
        )));
    }
    let labels_present = context.exec.run(|| labels_present(found));
    let ids = if parts == "all" { labels_present.clone() } else { ids(parts)? };
    if ids.is_empty() {
        return Err(Failure::usage(format!("--parts {parts}: {} has no label but 0", labels.display())));
    }
    if let Some(id) = ids.iter().find(|id| !labels_present.contains(id)) {
        let listed: Vec<String> = labels_present.iter().take(20).map(ToString::to_string).collect();
        let more = if labels_present.len() > 20 { ", …" } else { "" };
        return Err(Failure::usage(format!(
            "--parts {parts}: no voxel of {} has label {id}; there are {}{more}",
            labels.display(),
            listed.join(", ")
        )));
    }
    make_folder(folder)?;
    let mut records = Vec::new();
    let runner = Runner { exec: &context.exec, cache: &cache, lazy: false };
    for made in part_lattices(runner, input.clone(), &ids) {
        let (label, mut done) = made?;
        let path = folder.join(format!("label-{label}.ivd"));
        write_result(&done, &path, context)?;
        done.record.output = Some(OutputRecord {
            path: Some(path.clone()),
            kind: done.artefact.kind().name().to_owned(),
            hash: done.hash.to_string(),
        });
        let LatticeFigures { vertices, .. } = done.record.figures()?;
        context.say(&format!("label {label}: vertices {vertices} → {}", path.display()));
        let mut record = serde_json::to_value(&done.record)?;
        record["label"] = json!(label);
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
    let ids: Vec<u16> = list.split(',').map(id).collect::<anyhow::Result<_>>()?;
    if ids.contains(&0) {
        return Err(Failure::usage(format!("--parts {list}: 0 stands for no data and has no lattice")));
    }
    match ids.iter().enumerate().find(|(i, id)| ids[..*i].contains(id)) {
        Some((_, id)) => Err(Failure::usage(format!("--parts {list}: {id} is named twice"))),
        None => Ok(ids),
    }
}

/// Makes the folder for the lattices, where it isn't there.
fn make_folder(folder: &Path) -> anyhow::Result<()> {
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::usage(format!(
            "-o {}: a file; --parts writes a file for each label into a folder",
            folder.display()
        )));
    }
    std::fs::create_dir_all(folder).map_err(|e| {
        Failure::of(ErrorClass::Io, format!("-o {}: can't make the folder: {e}", folder.display()))
    })
}
