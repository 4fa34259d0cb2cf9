//! Files that a command reads for its inputs, and writes its results to.

use std::path::Path;
use std::sync::Arc;

use ivd_artefact::{Artefact, Cache, Provenance, write_again, write_with_metrics};
use ivd_core::op::{self, Field, alternatives, fields};
use ivd_core::{Classified, Kind, Labels, Mask, Value as _};
use ivd_io::volume::ReadOptions;
use ivd_pipeline::stages::{Import, ImportLabels, ImportMask, ImportSource, ImportTransfer};
use ivd_pipeline::{
    Input, Inputs, OutputRecord, Stage, StageRecord, StageResult, ending, export, labels_volume, mask_volume,
};

use crate::context::Context;
use crate::exit::{Failure, error_class};

/// Slots filled from files, where there are any. `kinds` tells what may fill a slot.
pub(crate) fn filled(
    files: &[(&'static str, Option<&Path>)],
    kinds: impl Fn(&str) -> &'static [Kind],
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Inputs> {
    let mut inputs = Inputs::default();
    for (slot, file) in files {
        if let Some(file) = file {
            inputs = inputs.with(slot, file_for(file, kinds(slot), cache, context)?);
        }
    }
    Ok(inputs)
}

/// As [`filled`], where labels or a mask may stand in the volume's place.
pub(crate) fn filled_with_parts(
    files: &[(&'static str, Option<&Path>)],
    kinds: impl Fn(&str) -> &'static [Kind],
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Inputs> {
    let mut inputs = filled(files, &kinds, cache, context)?;
    let mut parts: Option<Input> = None;
    for (slot, _) in files.iter().filter(|(slot, _)| kinds(slot).contains(&Kind::Volume)) {
        let Some(input) = inputs.input(slot).filter(|input| !kinds(slot).contains(&input.artefact.kind()))
        else {
            continue;
        };
        if let Some(volume) = as_volume(&input)? {
            inputs = inputs.with(slot, volume);
            parts = parts.or(Some(input));
        }
    }
    // Labels or a mask in place of the volume stand for themselves too, where nothing else does.
    let empty = |kind: Kind| files.iter().find(|(slot, file)| file.is_none() && kinds(slot).contains(&kind));
    if let Some(input) = parts
        && let Some((slot, _)) = empty(input.artefact.kind())
    {
        inputs = inputs.with(slot, input);
    }
    Ok(inputs)
}

/// Labels or a mask as a volume of their numbers; `None` of anything else.
fn as_volume(input: &Input) -> anyhow::Result<Option<Input>> {
    let volume = if let Some(labels) = Labels::of(&input.artefact) {
        labels_volume(labels)?
    } else if let Some(mask) = Mask::of(&input.artefact) {
        mask_volume(mask)?
    } else {
        return Ok(None);
    };
    Ok(Some(Input { artefact: Arc::new(Artefact::Volume(volume)), ..input.clone() }))
}

/// Kinds that fill a slot of some method of a stage.
pub(crate) fn kinds_of(stage: &op::Stage, slot: &str) -> &'static [Kind] {
    let known = stage.methods.iter().flat_map(|method| method.slots).find(|known| known.name == slot);
    known.map_or(&[], |known| known.kinds)
}

/// A file's value: an artefact's, or what a volume file of any format is taken for where one of the kinds can be read from one, or what a JSON
/// file holds where a transfer function is wanted.
pub(crate) fn file_for(
    file: &Path,
    kinds: &[Kind],
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Input> {
    if *kinds == [Kind::Transfer] && !ivd_artefact::is_artefact(file) && ending(file) == "json" {
        let stage = ImportTransfer { path: file.to_owned() };
        return Ok(context.run(cache, &stage, &Inputs::default())?.input());
    }
    let read = |kind: &&Kind| matches!(kind, Kind::Volume | Kind::Labels | Kind::Mask);
    let Some(kind) = kinds.iter().find(read).filter(|_| !ivd_artefact::is_artefact(file)) else {
        return context.stage_input(file);
    };
    let volume = volume_or_artefact(file, cache, context)?;
    if *kind == Kind::Volume {
        return Ok(volume);
    }
    let taken: &dyn Stage = if *kind == Kind::Labels { &ImportLabels } else { &ImportMask };
    let done = context.run(cache, taken, &Inputs::default().with("volume", volume));
    Ok(done.map_err(|e| Failure::of(error_class(&e), format!("{}: {e}", file.display())))?.input())
}

/// A file's value, verified whole: an artefact's, or any volume file's through an import.
pub(crate) fn volume_or_artefact(path: &Path, cache: &Cache, context: &Context) -> anyhow::Result<Input> {
    if path.is_file() && ivd_artefact::is_artefact(path) {
        return context.artefact(path);
    }
    imported(path, ReadOptions::default(), cache, context)
}

/// A volume file's value.
pub(crate) fn imported(
    path: &Path,
    options: ReadOptions,
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Input> {
    let source = ImportSource::File { path: path.to_owned(), options, grid_of: None };
    Ok(context.run(cache, &Import { source }, &Inputs::default())?.input())
}

/// A file for a slot that the method in use doesn't look at: its kind is checked, and that it has no effect is said where it isn't
/// among the files that the command always takes.
pub(crate) fn unused(
    stage: &op::Stage,
    slot: &str,
    file: Option<&Path>,
    context: &Context,
) -> anyhow::Result<()> {
    let Some(path) = file else { return Ok(()) };
    let kinds = kinds_of(stage, slot);
    let kind = file_for(path, kinds, &context.stage_cache()?, context)?.artefact.kind();
    if !kinds.contains(&kind) {
        let wanted: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
        let problem = format!("{}: a {} artefact, not {}", path.display(), kind.name(), wanted.join(" or "));
        return Err(Failure::usage(problem));
    }
    if !stage.positional.contains(&slot) {
        context.say(&format!("ivd: note: --{slot} has no effect: nothing in the parameters reads it"));
    }
    Ok(())
}

/// Writes a stage's result and prints its record.
pub(crate) fn finish(
    stage: &dyn Stage,
    mut done: StageResult,
    output: &Path,
    context: &Context,
) -> anyhow::Result<()> {
    write_result(&done, output, context)?;
    let record = &mut done.record;
    record.output = Some(OutputRecord {
        path: Some(output.to_owned()),
        kind: done.artefact.kind().name().to_owned(),
        hash: done.hash.to_string(),
    });
    context.say(&format!(
        "{}: {} in {:.2} s → {}",
        record.stage,
        headline(stage, record),
        record.wall_s,
        output.display()
    ));
    // A target that wasn't met is said with what stood in the way.
    if let Some(told) = record.told_remark() {
        context.say(&format!("ivd: note: {told}"));
    }
    context.print(&record, String::new)
}

/// Where the result of a record comes from.
pub(crate) fn provenance(record: &StageRecord) -> anyhow::Result<Provenance> {
    let hashes = record.inputs.iter();
    let inputs =
        hashes.map(|(slot, hash)| Ok((slot.clone(), hash.parse().map_err(|e| anyhow::anyhow!("{e}"))?)));
    Ok(Provenance {
        stage: record.stage.clone(),
        revision: record.revision,
        params: record.params.clone(),
        inputs: inputs.collect::<anyhow::Result<_>>()?,
        backend: record.backend.clone(),
    })
}

/// Writes a stage's result.
pub(crate) fn write_result(done: &StageResult, output: &Path, context: &Context) -> anyhow::Result<()> {
    // What was too much for a limit isn't written, whether the work noticed or not.
    context.exec.check_cancelled()?;
    if matches!(*done.artefact, Artefact::Image(_)) && ending(output) != "ivd" {
        export(&done.artefact, output, &context.exec)?;
        return Ok(());
    }
    let provenance = provenance(&done.record)?;
    let metrics = serde_json::Value::Object(done.record.metrics.figures.clone());
    let write = || match &done.sections {
        Some(sections) => write_again(output, &*done.artefact, &provenance, &metrics, sections),
        None => write_with_metrics(output, &*done.artefact, &provenance, &metrics),
    };
    context.exec.run(write).map_err(|e| placed(e, output))?;
    Ok(())
}

/// Writes an artefact that no stage made.
pub(crate) fn write_artefact(
    path: &Path,
    artefact: &Artefact,
    provenance: &Provenance,
    context: &Context,
) -> anyhow::Result<()> {
    context.exec.run(|| ivd_artefact::write(path, artefact, provenance)).map_err(|e| placed(e, path))?;
    Ok(())
}

/// Where an artefact can't be written, most often its folder isn't there.
fn placed(error: ivd_artefact::Error, path: &Path) -> anyhow::Error {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.exists() => {
            let problem =
                format!("{}: the folder {} doesn't exist; make it first", path.display(), folder.display());
            Failure::of(error.error_class(), problem)
        }
        _ => error.into(),
    }
}

/// The figures that a person wants first.
fn headline(stage: &dyn Stage, record: &StageRecord) -> String {
    let mut fields: Vec<Field<'_>> =
        alternatives((stage.facts().figures)()).into_iter().flat_map(fields).collect();
    fields.retain(|field| field.headline().is_some());
    fields.sort_by_key(|field| field.headline());
    let figures = &record.metrics.figures;
    let told = fields.iter().filter_map(|field| Some(format!("{} {}", field.name, figures.get(field.name)?)));
    let told: Vec<String> = told.collect();
    if told.is_empty() { "done".to_owned() } else { told.join(", ") }
}
