//! Runs a scene: what its outputs need, from the cache where it can, and writes the outputs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use ivd_artefact::Cache;
use ivd_core::Exec;
use ivd_core::op::Memory;
use serde::{Deserialize, Serialize};

use crate::clashes;
use crate::control::{Control, Uncontrolled};
use crate::need::{self, Size};
use crate::node::{Context, run_node};
use crate::options::PipelineOptions;
use crate::outputs::{Manifest, OutputFile, Writer};
use crate::plan::{NodeId, Plan, PlanNode};
use crate::resource::peak_rss_mb;
use crate::runner::{Runner, StageRecord, StageResult, State};
use crate::scene::Loaded;
use crate::{Error, series};

/// What a run of a scene did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PipelineReport {
    /// Every stage, needed or not.
    pub stages: Vec<StageRecord>,
    /// Files in the output folder.
    pub outputs: Vec<OutputFile>,
    /// Wall time (s).
    pub wall_s: f64,
    /// Peak resident memory (MiB) of the process so far, where the system tells.
    #[serde(default)]
    pub peak_rss_mb: Option<f64>,
    /// Most memory of the process's own during a stage or an output (MiB), mapped files apart: what a memory limit is held against.
    #[serde(default)]
    pub peak_own_mb: Option<f64>,
}

/// Runs a scene.
///
/// Volumes in the cache are read in parts, as far as the stages look at them.
///
/// # Errors
/// The first failure of a stage or of a file; outputs that were already whole stay, nothing half-written does.
pub fn run(
    loaded: &Loaded,
    options: &PipelineOptions,
    cache: &Cache,
    exec: &Exec,
) -> Result<PipelineReport, Error> {
    run_controlled(loaded, options, cache, exec, || Ok(Uncontrolled)).map(|(report, _)| report)
}

/// As [`run`], with what decides about the run while it goes on: made by `control`, anew where the run has to begin again, and given back
/// at the end.
///
/// # Errors
/// Those of [`run`], and what the control makes of them.
pub fn run_controlled<C: Control>(
    loaded: &Loaded,
    options: &PipelineOptions,
    cache: &Cache,
    exec: &Exec,
    control: impl Fn() -> Result<C, Error>,
) -> Result<(PipelineReport, C), Error> {
    let start = Instant::now();
    match attempt(loaded, options, start, control()?, Runner { exec, cache, lazy: true }) {
        Err(Error::Damaged(problem)) => {
            // Verified whole, the damaged entry shows before anything is made from it, and is made again.
            tracing::warn!(problem, "a cached volume is damaged; the scene is run again");
            attempt(loaded, options, start, control()?, Runner { exec, cache, lazy: false })
        }
        answer => answer,
    }
}

/// Runs a scene, which began at `start`.
fn attempt<C: Control>(
    loaded: &Loaded,
    options: &PipelineOptions,
    start: Instant,
    mut control: C,
    runner: Runner<'_>,
) -> Result<(PipelineReport, C), Error> {
    options.check()?;
    let mut plan = Plan::new(loaded, options.input.as_deref(), options.until.as_deref())?;
    if !runner.exec.skip {
        plan.want_everything();
    }
    for node in plan.nodes().iter().filter(|node| node.is_in_vain() && options.until.is_none()) {
        runner.exec.observer().note(&format!("{}: not done: {}", node.id.stage, node.why));
    }
    if options.until.is_none() {
        let needed = plan.nodes().iter().filter(|node| node.needed).filter_map(|node| node.stage.as_ref());
        // What can't be listed is told by the stage that reads it.
        let sources = needed.flat_map(|stage| stage.sources().unwrap_or_default());
        clashes::check_sources(loaded, options.input.as_deref(), &options.out, sources)?;
    }
    let mut stages = Vec::new();
    let outputs = if options.dry_run {
        let state = |node: &PlanNode| if node.needed { State::Planned } else { State::NotNeeded };
        stages.extend(plan.nodes().iter().filter(|n| n.is_reported()).map(|n| idle(n, state(n))));
        Vec::new()
    } else {
        let stages_of = plan.nodes().iter().filter(|n| n.needed).filter_map(|n| n.stage.as_ref());
        let needed: Vec<Memory> = stages_of.map(|stage| stage.memory()).collect();
        let mut seen = Size::default();
        walk(loaded, options, plan, &mut control, &mut stages, (&mut seen, runner)).map_err(|error| {
            let error = whole(error, &needed, seen, runner.exec);
            control.explain(error, runner.exec, &stages)
        })?
    };
    let wall_s = start.elapsed().as_secs_f64();
    // The system counts in batches of each thread: its mark can lie a little below what was looked at.
    let parts =
        stages.iter().map(|stage| stage.peak_rss_mb).chain(outputs.iter().map(|file| file.peak_rss_mb));
    let peak_rss_mb = parts.chain([peak_rss_mb()]).flatten().reduce(f64::max);
    let own = stages.iter().map(|stage| stage.peak_own_mb).chain(outputs.iter().map(|file| file.peak_own_mb));
    let peak_own_mb = own.flatten().reduce(f64::max);
    Ok((PipelineReport { stages, outputs, wall_s, peak_rss_mb, peak_own_mb }, control))
}

/// The error of a run, where a memory limit ended it with one that does for all that was needed.
fn whole(error: Error, needed: &[Memory], seen: Size, exec: &Exec) -> Error {
    let takes = needed.iter().map(|memory| need::about(*memory, seen)).max().flatten();
    if let Error::OverMemory { about_mib, source } = error {
        let about_mib = about_mib.max(takes.unwrap_or_default().div_ceil(1 << 20));
        return Error::OverMemory { about_mib, source };
    }
    need::explained(error, exec, None, takes)
}

/// Does what the plan needs, stage by stage, and writes the outputs; `stages` tells how far it came, and `seen` how large what came was.
fn walk(
    loaded: &Loaded,
    options: &PipelineOptions,
    mut plan: Plan,
    control: &mut dyn Control,
    stages: &mut Vec<StageRecord>,
    (seen, runner): (&mut Size, Runner<'_>),
) -> Result<Vec<OutputFile>, Error> {
    let manifest = Manifest::load(&options.out);
    let mut done: BTreeMap<NodeId, StageResult> = BTreeMap::new();
    let mut writer = Writer::new(&loaded.scene, &options.out, &manifest, runner.exec);
    for at in 0..plan.nodes().len() {
        if !plan.nodes()[at].needed {
            stages.extend(plan.nodes()[at].is_reported().then(|| idle(&plan.nodes()[at], State::NotNeeded)));
            continue;
        }
        let ready = control.before(at, &mut plan, &done, runner)?;
        let node = &plan.nodes()[at];
        let mut result = match ready {
            Some(result) => result,
            None => run_node(node, &done, runner, options)?,
        };
        *seen = seen.with(&result.artefact);
        control.after(node.id, &result);
        if options.until.is_none()
            && let Some(remark) = series::still(&loaded.scene, &result.artefact)
        {
            runner.exec.observer().note(&remark);
        }
        if node.id == NodeId::IMPORT {
            // Where the volume lies is known: places far outside it are wrong whatever is found in it.
            for stage in
                plan.nodes().iter().filter(|node| node.needed).filter_map(|node| node.stage.as_deref())
            {
                stage.look_ahead("", &result.artefact)?;
            }
        }
        for (heir, slot) in plan.heirs(at) {
            heir.stage.as_deref().map_or(Ok(()), |stage| stage.look_ahead(slot, &result.artefact))?;
        }
        note_remark(&result.record, runner.exec);
        node.id.variant.clone_into(&mut result.record.variant);
        explain(&mut result.record, node, &manifest);
        if options.until.is_none() {
            writer.stage_done(node, &result, &done)?;
        }
        stages.push(result.record.clone());
        done.insert(node.id, result);
        if options.until.is_none() && plan.series() == Some(at) {
            let context = Context { loaded, options, runner };
            stages.extend(series::write(&plan, &done, &mut writer, context)?);
        }
        release(&plan, at, &mut done);
    }
    if options.until.is_none() {
        let force = options.force.contains("report");
        writer.set_decisions(control.summary());
        let mut shown = loaded.clone();
        shown.scene.input.file = options.input.clone().or(shown.scene.input.file);
        if options.input.is_some() {
            shown.folder = PathBuf::new();
        }
        let report = writer.report(&shown, stages, force)?;
        note_remark(&report, runner.exec);
        stages.push(report);
    }
    writer.finish(stages)
}

/// Tells what a stage's figures say for people.
fn note_remark(record: &StageRecord, exec: &Exec) {
    if let Some(told) = record.told_remark() {
        exec.observer().note(&told);
    }
}

/// Says what changed since the last run into the same folder, where something did.
fn explain(record: &mut StageRecord, node: &PlanNode, manifest: &Manifest) {
    let change = manifest.change_since(record);
    record.why = match (record.state, change) {
        (State::Ran, Some(change))
            if !record.why.starts_with("its cached entry") && record.why != "forced" =>
        {
            format!("{}; {change}", node.why)
        }
        _ => format!("{}; {}", node.why, record.why),
    };
}

/// Drops values that no later place and no output reads.
fn release(plan: &Plan, at: usize, done: &mut BTreeMap<NodeId, StageResult>) {
    let later = || plan.nodes()[at + 1..].iter().filter(|node| node.needed);
    // What every frame of a series goes by is read again, and its last frame is the scene's own.
    let frames = plan.series().is_some_and(|last| last > at);
    let again = if frames { plan.moved() } else { Vec::new() };
    let read = |node: &PlanNode, id: &NodeId| node.inputs.iter().any(|(_, from)| from == id);
    done.retain(|id, _| {
        later().any(|n| n.beside.contains(id) || read(n, id))
            || again.iter().any(|&again| read(&plan.nodes()[again], id))
            || frames && plan.of_frames().any(|(of, _)| plan.nodes()[of].id == *id)
    });
}

/// The record of a stage that did nothing.
fn idle(node: &PlanNode, state: State) -> StageRecord {
    StageRecord {
        variant: node.id.variant.to_owned(),
        why: node.why.clone(),
        revision: node.stage.as_ref().map_or(0, |s| s.facts().revision),
        params: node.stage.as_ref().map_or(serde_json::Value::Null, |s| s.params()),
        ..StageRecord::new(node.id.stage, state)
    }
}

/// Folder for a scene's outputs where none is given: `out/` and the scene's name.
pub fn default_out(scene: &Path) -> PathBuf {
    Path::new("out").join(scene.file_stem().unwrap_or_else(|| "scene".as_ref()))
}
