//! Runs a scene within a budget.

use std::time::Instant;

use ivd_artefact::Cache;
use ivd_core::Exec;
use ivd_pipeline::scene::Loaded;
use ivd_pipeline::{Error, PipelineOptions, PipelineReport};
use serde::{Deserialize, Serialize};

use crate::controller::Controller;
use crate::{Budget, BudgetReport};

/// What a run of a scene within a budget did: the object that `ivd pipeline --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetedReport {
    /// The run.
    #[serde(flatten)]
    pub run: PipelineReport,
    /// What the budget did, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<BudgetReport>,
}

/// Runs a scene as [`ivd_pipeline::run`] does, within a budget; without one where that sets nothing.
///
/// # Errors
/// Those of the pipeline, a usage error for a budget that is none, and [`Error::Limit`] where it can't be kept.
pub fn run(
    loaded: &Loaded,
    options: &PipelineOptions,
    budget: &Budget,
    cache: &Cache,
    exec: &Exec,
) -> Result<BudgetedReport, Error> {
    let start = Instant::now();
    options.check()?;
    budget.check()?;
    if budget.max_error_mm.is_some()
        && loaded.scene.section(&ivd_map::space::STAGE).is_some_and(|space| space.job().idle().is_none())
    {
        let problem = "--max-error: what it keeps is the map's error, and a [[space.step]] goes on from there; drop one of them";
        return Err(Error::usage("pipeline", problem));
    }
    if !budget.is_set() || options.dry_run {
        let run = ivd_pipeline::run(loaded, options, cache, exec)?;
        return Ok(BudgetedReport { run, budget: None });
    }
    let exec = &budget.bounded(exec, start);
    let control = || Controller::new(loaded, options, budget, start);
    let (run, controller) = ivd_pipeline::run_controlled(loaded, options, cache, exec, control)?;
    let budget = Some(controller.finish(run.wall_s)?);
    Ok(BudgetedReport { run, budget })
}
