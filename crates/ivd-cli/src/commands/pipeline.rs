//! Scenes: `ivd pipeline` and `ivd demo`.

use std::path::{Path, PathBuf};

use ivd_budget::{Budget, BudgetedReport};
use ivd_core::Classified as _;
use ivd_pipeline::scene::{self, Loaded};
use ivd_pipeline::{Before, PipelineOptions, default_out};

use crate::args::Pipeline;
use crate::context::Context;
use crate::exit::{Failure, Unfinished};

/// `ivd demo`.
pub(super) fn demo(out: &Path, context: &Context) -> anyhow::Result<()> {
    let loaded = ivd_frames::demo_scene(&[]);
    let loaded = loaded.map_err(|error| Failure::of(error.error_class(), error.to_string()))?;
    let options = PipelineOptions { out: out.to_owned(), ..PipelineOptions::default() };
    let before = Before::look(Some(&loaded), out);
    let report = ivd_pipeline::run(&loaded, &options, &context.pipeline_cache()?, &context.exec)
        .map_err(|error| Unfinished::of(error.into(), before.left()))?;
    let page = report.outputs.iter().find(|o| o.name == "report").map(|o| o.path.display().to_string());
    context.print(&report, || page.unwrap_or_default())
}

/// `ivd pipeline`.
pub(super) fn run(args: &Pipeline, context: &Context) -> anyhow::Result<()> {
    let out = args.out.clone().unwrap_or_else(|| default_out(&args.scene));
    // Who asks for no outputs doesn't look for them.
    let writes = !args.dry_run && args.until.is_none();
    let mut before = if writes { Before::look(None, &out) } else { Before::default() };
    let done = scene::load(&args.scene, &args.overrides).map_err(anyhow::Error::from).and_then(|loaded| {
        if writes {
            before = Before::look(Some(&loaded), &out);
        }
        run_loaded(&loaded, out, args, context)
    });
    done.map_err(|error| Unfinished::of(error, before.left()))
}

/// The same for a scene that was read.
fn run_loaded(loaded: &Loaded, out: PathBuf, args: &Pipeline, context: &Context) -> anyhow::Result<()> {
    let options = PipelineOptions {
        out,
        input: args.input.clone(),
        until: args.until.clone(),
        force: args.force.iter().cloned().collect(),
        dry_run: args.dry_run,
    };
    let budget = Budget {
        max_time_s: args.max_time,
        max_error_mm: args.max_error,
        pinned: args.overrides.iter().map(|o| o.path.join(".")).collect(),
        ..Budget::default()
    };
    let report = ivd_budget::run(loaded, &options, &budget, &context.pipeline_cache()?, &context.exec)?;
    context.print(&report, || text(&report, args.explain || args.dry_run))
}

/// What a person reads: the outputs, and every stage with its reason where that was asked for.
fn text(BudgetedReport { run, budget }: &BudgetedReport, explain: bool) -> String {
    let mut lines = Vec::new();
    if let Some(budget) = budget.as_ref().filter(|_| explain) {
        lines.extend(budget.summary());
    }
    for record in run.stages.iter().filter(|_| explain) {
        let state = record.state.words();
        let name = format!("{} {}", record.stage, record.variant);
        lines.push(format!("{:18} {state:10} {:8.3} s  {}", name.trim(), record.wall_s, record.why));
    }
    for output in &run.outputs {
        let state = if output.written { "" } else { "  (unchanged)" };
        lines.push(format!("{}{state}", output.path.display()));
    }
    lines.join("\n")
}
