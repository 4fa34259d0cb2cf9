//! Runs a scene: what its outputs need, from the cache where it can, and writes the outputs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use ivd_artefact::Cache;
use ivd_core::Exec;
use serde::{Deserialize, Serialize};

use crate::budget::{Budget, BudgetReport, Controller};
use crate::outputs::{Manifest, OutputFile, Writer};
use crate::plan::{NodeId, Plan, PlanNode, stage_names};
use crate::runner::{Done, Runner, StageRecord, State};
use crate::scene::Loaded;
use crate::{Error, Inputs};

/// How a scene is run.
#[derive(Debug, Clone, Default)]
pub struct PipelineOptions {
    /// Folder of the outputs.
    pub out: PathBuf,
    /// A volume in place of the scene's.
    pub input: Option<PathBuf>,
    /// Stop after this stage; outputs aren't written.
    pub until: Option<String>,
    /// Stages that run even where the cache has their result.
    pub force: BTreeSet<String>,
    /// Tell what would be done, without doing it.
    pub dry_run: bool,
    /// What the run may take, and how far its result may be off.
    pub budget: Budget,
}

/// What a run of a scene did: the object that `ivd pipeline --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PipelineReport {
    /// Every stage, needed or not.
    pub stages: Vec<StageRecord>,
    /// Files in the output folder.
    pub outputs: Vec<OutputFile>,
    /// Wall time (s).
    pub wall_s: f64,
    /// What the budget did, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<BudgetReport>,
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
    let start = Instant::now();
    match attempt(loaded, options, start, Runner { exec, cache, lazy: true }) {
        Err(Error::Damaged(problem)) => {
            // Verified whole, the damaged entry shows before anything is made from it, and is made again.
            tracing::warn!(problem, "a cached volume is damaged; the scene is run again");
            attempt(loaded, options, start, Runner { exec, cache, lazy: false })
        }
        answer => answer,
    }
}

/// Runs a scene within its budget, which began at `start`.
fn attempt(
    loaded: &Loaded,
    options: &PipelineOptions,
    start: Instant,
    runner: Runner<'_>,
) -> Result<PipelineReport, Error> {
    for stage in &options.force {
        if stage != "report" && stage != NodeId::IMPORT.stage && crate::list::stage(stage).is_none() {
            let known = stage_names();
            return Err(Error::usage("pipeline", format!("--force {stage}: stages are {known}, report")));
        }
    }
    options.budget.check()?;
    if options.budget.max_error_mm.is_some()
        && loaded.scene.section(&ivd_map::space::STAGE).is_some_and(|space| space.job().idle().is_none())
    {
        let problem = "--max-error: what it keeps is the map's error, and a [[space.step]] goes on from there; drop one of them";
        return Err(Error::usage("pipeline", problem));
    }
    let mut plan = Plan::new(loaded, options.input.as_deref(), options.until.as_deref())?;
    if !runner.exec.skip {
        plan.want_everything();
    }
    if options.dry_run {
        let stages = plan
            .nodes()
            .iter()
            .filter(|n| n.is_told())
            .map(|n| idle(n, if n.needed { State::Planned } else { State::NotNeeded }))
            .collect();
        let wall_s = start.elapsed().as_secs_f64();
        return Ok(PipelineReport { stages, outputs: Vec::new(), wall_s, budget: None });
    }
    let exec = &options.budget.bounded(runner.exec, start);
    let mut pilot = options.budget.is_set().then(|| Controller::new(loaded, options, start)).transpose()?;
    let mut stages = Vec::new();
    let outputs = match walk(loaded, options, plan, &mut pilot, &mut stages, Runner { exec, ..runner }) {
        Ok(outputs) => outputs,
        Err(error) => {
            return Err(match pilot {
                Some(pilot) => pilot.explain(error, exec, &stages),
                None => error,
            });
        }
    };
    let wall_s = start.elapsed().as_secs_f64();
    let budget = pilot.map(|pilot| pilot.finish(wall_s)).transpose()?;
    Ok(PipelineReport { stages, outputs, wall_s, budget })
}

/// Does what the plan needs, stage by stage, and writes the outputs; `stages` tells how far it came.
fn walk(
    loaded: &Loaded,
    options: &PipelineOptions,
    mut plan: Plan,
    pilot: &mut Option<Controller<'_>>,
    stages: &mut Vec<StageRecord>,
    runner: Runner<'_>,
) -> Result<Vec<OutputFile>, Error> {
    let manifest = Manifest::load(&options.out);
    let mut done: BTreeMap<NodeId, Done> = BTreeMap::new();
    let mut writer = Writer::new(&loaded.scene, &options.out, &manifest, runner.exec);
    for at in 0..plan.nodes().len() {
        if !plan.nodes()[at].needed {
            stages.extend(plan.nodes()[at].is_told().then(|| idle(&plan.nodes()[at], State::NotNeeded)));
            continue;
        }
        let ready = match pilot {
            Some(pilot) => pilot.before(at, &mut plan, &done, runner)?,
            None => None,
        };
        let node = &plan.nodes()[at];
        let mut result = match ready {
            Some(result) => result,
            None => run_node(node, &done, runner, options)?,
        };
        if let Some(pilot) = pilot {
            pilot.after(node.id, &result);
        }
        node.id.variant.clone_into(&mut result.record.variant);
        explain(&mut result.record, node, &manifest);
        if options.until.is_none() {
            writer.stage_done(node, &result, &done)?;
        }
        stages.push(result.record.clone());
        done.insert(node.id, result);
        release(&plan, at, &mut done);
    }
    if options.until.is_none() {
        let force = options.force.contains("report");
        writer.tell(pilot.as_ref().map(Controller::told).unwrap_or_default());
        stages.push(writer.report(loaded, stages, force)?);
    }
    writer.finish(stages)
}

pub(crate) fn run_node(
    node: &PlanNode,
    done: &BTreeMap<NodeId, Done>,
    runner: Runner<'_>,
    options: &PipelineOptions,
) -> Result<Done, Error> {
    let stage = node.stage.as_deref();
    let stage = stage.ok_or_else(|| Error::usage(node.id.stage, "it has nothing to do in this scene"))?;
    let mut inputs = Inputs::default();
    for (slot, from) in &node.inputs {
        inputs = inputs.with(slot, done[from].input());
    }
    runner.run(stage, &inputs, options.force.contains(stage.name()))
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
fn release(plan: &Plan, at: usize, done: &mut BTreeMap<NodeId, Done>) {
    let later = || plan.nodes()[at + 1..].iter().filter(|node| node.needed);
    done.retain(|id, _| {
        later().any(|n| n.beside.contains(id) || n.inputs.iter().any(|(_, from)| from == id))
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
