//! `ivd bench`.

use std::fmt::Write as _;
use std::path::Path;

use ivd_bench::{Bench, Comparison, Options, Plant};
use ivd_core::Fault;
use serde_json::json;

use crate::args::{Bench as Args, Planted};
use crate::context::Context;
use crate::exit::Failure;

/// Sweeps the stages' settings and writes what came of it.
pub(super) fn run(args: &Args, context: &Context) -> anyhow::Result<()> {
    let standard = if args.quick { Options::quick() } else { Options::default() };
    let options = Options {
        size: args.size.unwrap_or(standard.size),
        repeats: args.repeats.unwrap_or(standard.repeats),
        stages: args.stages.clone(),
        plant: args.plant.map(|plant| match plant {
            Planted::Slow => Plant::Slow,
            Planted::Inexact => Plant::Inexact,
        }),
    };
    // Before the work: a file that can't be read is no reason to lose it.
    let old = args.compare.as_deref().map(read).transpose()?;
    let bench = ivd_bench::run(&options, &context.exec).map_err(failed)?;
    let file = |name: &str| args.out.join(name);
    std::fs::create_dir_all(&args.out)
        .map_err(|e| Failure::of(Fault::Io, format!("{}: can't be made: {e}", args.out.display())))?;
    let text = serde_json::to_string_pretty(&bench)? + "\n";
    for (name, text) in [
        ("bench.json", text),
        ("bench.csv", ivd_bench::table(&bench)),
        ("bench.html", ivd_bench::page(&bench)),
    ] {
        ivd_pipeline::write_text(&file(name), &text)?;
    }
    let comparison = old.map(|old| ivd_bench::compare(&old, &bench));
    let object = json!({
        "out": args.out,
        "page": file("bench.html"),
        "stages": bench.stages.iter().map(|s| json!({ "stage": s.stage, "points": s.points.len() })).collect::<Vec<_>>(),
        "comparison": comparison,
    });
    context.print(&object, || told(&bench, comparison.as_ref(), &file("bench.html")))
}

/// Reads an older bench.
fn read(path: &Path) -> anyhow::Result<Bench> {
    let bytes = ivd_pipeline::scene::read_short(path)
        .map_err(|e| Failure::of(Fault::Io, format!("--compare {}: {e}", path.display())))?;
    // Where it is longer than any, nothing of it is one.
    serde_json::from_slice(&bytes.unwrap_or_default()).map_err(|e| {
        let message = format!("--compare {}: not a bench.json of this program: {e}", path.display());
        Failure::of(Fault::Input, message)
    })
}

fn failed(error: ivd_bench::Error) -> anyhow::Error {
    let fault = match &error {
        ivd_bench::Error::UnknownStage { .. } => Fault::Usage,
        ivd_bench::Error::Failed { .. } | ivd_bench::Error::NoNumber { .. } => Fault::Untrusted,
        ivd_bench::Error::Core(_) => return error.into(),
    };
    Failure::of(fault, error.to_string())
}

fn told(bench: &Bench, comparison: Option<&Comparison>, page: &Path) -> String {
    let mut text = String::new();
    for stage in &bench.stages {
        let front = stage.points.iter().filter(|p| p.on_front).count();
        let _ = writeln!(text, "{:8} {} points, {front} on the front", stage.stage, stage.points.len());
        for point in stage.points.iter().filter(|p| p.default) {
            let beaten = stage.beaten_by(point).map(|other| {
                let knobs: Vec<String> = other.knobs.iter().map(|(n, v)| format!("{n} {v}")).collect();
                format!("; beaten in this run by {}", knobs.join(", "))
            });
            let cpu_ms = 1e3 * point.cpu_s.median;
            let beaten = beaten.unwrap_or_default();
            let _ = writeln!(
                text,
                "         default: {cpu_ms:.3} ms of processor time, error {:.3e} {}{beaten}",
                point.error, stage.unit
            );
        }
    }
    if let Some(found) = comparison {
        let worse = found.changes.iter().filter(|c| c.worse()).count();
        let better = found.changes.len() - worse;
        let _ = writeln!(
            text,
            "{} points compared: {worse} worse, {better} better beyond the noise",
            found.compared
        );
        for c in &found.changes {
            let [low, high] = c.bounds;
            let _ = writeln!(
                text,
                "  {} ({}): {} × {:.2} ({low:.2} to {high:.2})",
                c.stage, c.setting, c.what, c.ratio
            );
        }
    }
    text + &page.display().to_string()
}
