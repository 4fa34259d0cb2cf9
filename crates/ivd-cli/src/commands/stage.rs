//! Single stages: artefacts in, one artefact out.

use ivd_core::Faulty;
use std::path::Path;

use ivd_artefact::{Artefact, Cache, Provenance, write_with_metrics};
use ivd_core::op;
use ivd_lattice::foreign::ForeignParams;
use ivd_pipeline::scene::{
    AtfSection, BoundarySection, LatticeSection, RefineSection, RenderSection, WarpSection,
};
use ivd_pipeline::stages::{Atf, Boundary, ForeignLattice, Lattice, Refine, Render, Warp};
use ivd_pipeline::{Done, Inputs, OutputRecord, Stage, StageRecord, ending, export};
use toml::Value;

use super::volume::volume_or_artefact;
use crate::args::Command;
use crate::context::Context;
use crate::exit::Failure;
use crate::parse::{Words, section, section_over};

/// A stage and the files of its slots.
struct Job<'a> {
    stage: Box<dyn Stage>,
    files: Vec<(&'static str, Option<&'a Path>)>,
    output: &'a Path,
}

/// Runs the stage of a command.
pub(super) fn run(command: &Command, context: &Context) -> anyhow::Result<()> {
    if let Command::Segment(args) = command {
        return super::segment::run(args, context);
    }
    let job = job(command, context)?;
    let cache = context.stage_cache()?;
    let inputs = filled(&job.files, &cache, context)?;
    let done = context.run(&cache, job.stage.as_ref(), &inputs)?;
    finish(done, job.output, context)
}

/// Slots filled from files, where there are any.
pub(crate) fn filled(
    files: &[(&'static str, Option<&Path>)],
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<Inputs> {
    let mut inputs = Inputs::default();
    for (slot, file) in files {
        if let Some(file) = file {
            let foreign = *slot == "volume" && !ivd_artefact::is_artefact(file);
            let input = if foreign {
                volume_or_artefact(file, cache, context)?
            } else {
                context.stage_input(file)?
            };
            inputs = inputs.with(slot, input);
        }
    }
    Ok(inputs)
}

/// What a command means.
fn job<'a>(command: &'a Command, context: &Context) -> anyhow::Result<Job<'a>> {
    let params = context.global.params.as_deref();
    Ok(match command {
        Command::Atf { volume, labels, output } => {
            let section: AtfSection = section(params, Words::default().0)?;
            let files = vec![("volume", Some(volume.as_path())), ("labels", Some(labels.as_path()))];
            Job { stage: Box::new(Atf::from_section(&section, None)), files, output: &output.path }
        }
        Command::Boundary { volume, labels, class, seed, above, keep_holes, output } => {
            let mut section: BoundarySection = section(params, Words::default().0)?;
            section.class = class.or(section.class);
            section.seed = seed.or(section.seed);
            section.fill_holes &= !keep_holes;
            section.above = above.or(section.above);
            let files = vec![("volume", Some(volume.as_path())), ("labels", labels.as_deref())];
            Job { stage: Box::new(Boundary::from_section(&section, None)), files, output: &output.path }
        }
        Command::Lattice { volume, mesh: Some(mesh), weld, allow_open, output, .. } => {
            let weld = weld.unwrap_or(ForeignParams::default().weld);
            let params = ForeignParams { weld, allow_open: *allow_open };
            let stage = ForeignLattice { path: mesh.clone(), params };
            let files = vec![("volume", Some(volume.as_path()))];
            Job { stage: Box::new(stage), files, output: &output.path }
        }
        Command::Lattice { volume, labels, class, mask, iso, output, .. } => {
            let section: LatticeSection = section(params, Words::default().0)?;
            let stage = Lattice { iso: iso.unwrap_or(section.iso), class: *class };
            let files = vec![
                ("volume", Some(volume.as_path())),
                ("labels", labels.as_deref()),
                ("mask", mask.as_deref()),
            ];
            Job { stage: Box::new(stage), files, output: &output.path }
        }
        Command::Refine {
            lattice,
            method,
            level,
            ratio,
            max_error,
            count,
            allow_topology,
            feature_degrees,
            lock,
            min_component,
            chain,
            output,
        } => {
            let words = Words::default()
                .with("method", method.clone())
                .with("level", level.map(i64::from))
                .with("ratio", *ratio)
                .with("count", count.map(|n| n as i64))
                .with("max_error", *max_error)
                .with("allow_topology", allow_topology.then_some(true))
                .with("feature_degrees", *feature_degrees)
                .with("min_component", min_component.map(i64::from));
            let mut section: RefineSection = section(params, words.0)?;
            section.lock.extend(lock.iter().cloned());
            if !chain.is_empty() {
                section.chain.clone_from(chain);
            }
            let files = vec![("lattice", Some(lattice.as_path()))];
            Job { stage: Box::new(Refine::from_section(&section)?), files, output: &output.path }
        }
        Command::Warp { volume, displacement, order, output } => {
            let section: WarpSection = section(params, Words::default().with("order", order.clone()).0)?;
            let files =
                vec![("volume", Some(volume.as_path())), ("displacement", Some(displacement.as_path()))];
            Job { stage: Box::new(Warp::from_section(&section)), files, output: &output.path }
        }
        Command::Render { volume, transfer, labels, displacement, mode, iso, size, view, step, output } => {
            // Without a transfer function there is nothing to compose: the maximum shows every volume.
            let default = Words::default().with("mode", transfer.is_none().then(|| "mip".to_owned()));
            let words = Words::default()
                .with("mode", mode.clone())
                .with("iso", *iso)
                .with("size", size.map(|s| s.map(|n| Value::Integer(n as i64)).to_vec()))
                .with("view", view.map(|v| list(v.to_vec())))
                .with("step", *step);
            let section: RenderSection = section_over(default.0, params, words.0)?;
            let files = vec![
                ("volume", Some(volume.as_path())),
                ("transfer", transfer.as_deref()),
                ("labels", labels.as_deref()),
                ("displacement", displacement.as_deref()),
            ];
            Job { stage: Box::new(Render::from_section(&section, None)?), files, output }
        }
        _ => unreachable!("the other commands are no stages"),
    })
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
    let known = stage.methods.iter().flat_map(|method| method.slots).find(|known| known.name == slot);
    let kinds = known.map_or(&[][..], |known| known.kinds);
    let kind = context.artefact(path)?.artefact.kind();
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

pub(super) fn list(values: Vec<f64>) -> Vec<Value> {
    values.into_iter().map(Value::Float).collect()
}

/// Writes a stage's result and prints its record.
pub(crate) fn finish(mut done: Done, output: &Path, context: &Context) -> anyhow::Result<()> {
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
        headline(record),
        record.wall_s,
        output.display()
    ));
    context.print(&record, String::new)
}

/// Where the result of a record comes from.
pub(super) fn provenance(record: &StageRecord) -> anyhow::Result<Provenance> {
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
pub(super) fn write_result(done: &Done, output: &Path, context: &Context) -> anyhow::Result<()> {
    if matches!(*done.artefact, Artefact::Image(_)) && ending(output) != "ivd" {
        export(&done.artefact, output, &context.exec)?;
        return Ok(());
    }
    let provenance = provenance(&done.record)?;
    let metrics = serde_json::Value::Object(done.record.metrics.figures.clone());
    let write = || write_with_metrics(output, &*done.artefact, &provenance, &metrics);
    context.exec.run(write).map_err(|e| placed(e, output))?;
    Ok(())
}

/// Writes an artefact that no stage made.
pub(super) fn write_artefact(
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
            Failure::of(error.fault(), problem)
        }
        _ => error.into(),
    }
}

/// The figures that a person wants first.
fn headline(record: &StageRecord) -> String {
    let picked: Vec<String> = [
        "k",
        "voxels",
        "vertices",
        "triangles",
        "nodes",
        "vertices_moved",
        "voxels_moved",
        "voxels_resampled",
        "voxels_changed",
        "voxels_kept",
        "entries",
    ]
    .iter()
    .filter_map(|key| record.metrics.get(key).map(|value| format!("{key} {value}")))
    .collect();
    // A target that wasn't met is said with what stood in the way.
    let stopped = record.metrics.get("reached").and_then(|r| r.get("stopped_by")).and_then(|s| s.as_str());
    if let Some(reason) = stopped.filter(|s| !["target", "max_error"].contains(s)) {
        return format!("{}, target not reached: stopped by {reason}", picked.join(", "));
    }
    if picked.is_empty() { "done".to_owned() } else { picked.join(", ") }
}
