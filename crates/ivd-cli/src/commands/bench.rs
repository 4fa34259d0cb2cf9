//! `ivd bench`.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use ivd_artefact::{Artefact, Cache};
use ivd_bench::{Bench, Comparison, Given, Options, Plant, StageBench};
use ivd_core::{ErrorClass, Value as _, Volume};
use serde_json::{Value, json};

use super::volume::volume_or_artefact;
use crate::args::{Bench as Args, Planted};
use crate::context::Context;
use crate::exit::Failure;

/// The name under which whole scenes are asked for.
const SCENES: &str = "scenes";

/// The name under which the page of refinements is asked for.
const REFINEMENTS: &str = "refinements";

/// The name under which drags are asked for.
const INTERACTIVE: &str = "interactive";

/// Sweeps the stages' settings, runs the scenes, and writes what came of it.
pub(super) fn run(args: &Args, context: &Context) -> anyhow::Result<()> {
    let standard = if args.quick { Options::quick() } else { Options::default() };
    let options = Options {
        size: args.size.unwrap_or(standard.size),
        repeats: args.repeats.unwrap_or(standard.repeats),
        stages: args
            .stages
            .iter()
            .filter(|name| ![SCENES, REFINEMENTS, INTERACTIVE].contains(&name.as_str()))
            .cloned()
            .collect(),
        input: args.input.as_deref().map(|path| given(path, context)).transpose()?,
        plant: args.plant.map(|plant| match plant {
            Planted::Slow => Plant::Slow,
            Planted::Inexact => Plant::Inexact,
        }),
    };
    let named = |what: &str| args.stages.iter().any(|name| name == what);
    if args.iso.is_some() && !named(REFINEMENTS) && !named(INTERACTIVE) {
        let problem =
            format!("--iso: only `{REFINEMENTS}` and `{INTERACTIVE}` cut a volume at a value; name one");
        return Err(Failure::usage(problem));
    }
    // Before the work: a file that can't be read is no reason to lose it.
    let old = args.compare.as_deref().map(read).transpose()?;
    let all = args.stages.is_empty();
    let mut object = json!({ "out": args.out });
    let mut text = String::new();
    if all || !options.stages.is_empty() {
        stages(&options, old.as_ref(), args, context, &mut object, &mut text)?;
    }
    if all || named(SCENES) {
        scenes(&options, args, context, &mut object, &mut text)?;
    }
    if named(REFINEMENTS) {
        refinements(&options, args, context, &mut object, &mut text)?;
    }
    if named(INTERACTIVE) {
        interactive(&options, args, context, &mut object, &mut text)?;
    }
    context.print(&object, || text.trim_end().to_owned())
}

/// Sweeps the stages.
fn stages(
    options: &Options,
    old: Option<&Bench>,
    args: &Args,
    context: &Context,
    object: &mut Value,
    text: &mut String,
) -> anyhow::Result<()> {
    let bench = ivd_bench::run(options, &context.exec).map_err(failed)?;
    make(&args.out)?;
    let file = |name: &str| args.out.join(name);
    for (name, text) in [
        ("bench.json", serde_json::to_string_pretty(&bench)? + "\n"),
        ("bench.csv", ivd_bench::table(&bench)),
        ("bench.html", ivd_bench::page(&bench)),
    ] {
        ivd_pipeline::write_text(&file(name), &text)?;
    }
    if let Some(folder) = &args.record {
        record(&bench, args.stages.is_empty(), folder, context)?;
    }
    let comparison = old.map(|old| ivd_bench::compare(old, &bench));
    let points = |s: &StageBench| json!({ "stage": s.stage, "points": s.points.len() });
    object["page"] = json!(file("bench.html"));
    object["stages"] = bench.stages.iter().map(points).collect();
    object["comparison"] = json!(comparison);
    *text += &told(&bench, comparison.as_ref(), &file("bench.html"));
    *text += "\n";
    Ok(())
}

/// Runs whole scenes.
fn scenes(
    options: &Options,
    args: &Args,
    context: &Context,
    object: &mut Value,
    text: &mut String,
) -> anyhow::Result<()> {
    let bench = ivd_bench::scenes(options, &context.exec).map_err(failed)?;
    make(&args.out)?;
    let page = args.out.join("scenes.html");
    ivd_pipeline::write_text(&args.out.join("scenes.json"), &(serde_json::to_string_pretty(&bench)? + "\n"))?;
    ivd_pipeline::write_text(&page, &ivd_bench::scenes_page(&bench))?;
    for row in &bench.skipping {
        let different = if row.same { "" } else { "; NOT the same with every skip off" };
        let _ = writeln!(
            text,
            "{:27} {} of {} stages, {:.3e} looked at, {} bytes read{different}",
            row.scene,
            row.ran.len(),
            row.stages,
            row.visited,
            row.bytes_read
        );
    }
    for point in &bench.scaling {
        let _ = writeln!(
            text,
            "{:>4}³ {:9.3} s of processor time, {:6.0} MiB; handle moved {:8.3} s, {:.0} ns a moved voxel",
            point.size,
            point.whole.cpu_s.median,
            point.whole.peak_rss_mb.unwrap_or(f64::NAN),
            point.moved.cpu_s.median,
            1e9 * point.moved.cpu_s.median / point.voxels_moved
        );
    }
    let _ = writeln!(text, "{}", page.display());
    object["scenes_page"] = json!(page);
    Ok(())
}

/// Refines lattices by every method, with pictures.
fn refinements(
    options: &Options,
    args: &Args,
    context: &Context,
    object: &mut Value,
    text: &mut String,
) -> anyhow::Result<()> {
    let bench = ivd_bench::refinements(options, args.iso, &context.exec).map_err(failed)?;
    make(&args.out)?;
    let file = |ending: &str| args.out.join(format!("{REFINEMENTS}.{ending}"));
    ivd_pipeline::write_text(&file("json"), &(serde_json::to_string_pretty(&bench)? + "\n"))?;
    ivd_pipeline::write_text(&file("html"), &ivd_bench::refinements_page(&bench)?)?;
    ivd_pipeline::export(&Artefact::Image(bench.sheet()), &file("png"), &context.exec)?;
    for lattice in &bench.lattices {
        let _ = writeln!(text, "{}", lattice.input);
        for claim in &lattice.claims {
            let _ = writeln!(text, "  {} {}: {}", claim.section, claim.says, claim.verdict());
        }
    }
    let _ = writeln!(text, "{}", file("html").display());
    object["refinements_page"] = json!(file("html"));
    Ok(())
}

/// Drags a handle.
fn interactive(
    options: &Options,
    args: &Args,
    context: &Context,
    object: &mut Value,
    text: &mut String,
) -> anyhow::Result<()> {
    let bench = ivd_bench::interactive(options, args.iso, &context.exec).map_err(failed)?;
    make(&args.out)?;
    let file = |ending: &str| args.out.join(format!("{INTERACTIVE}.{ending}"));
    ivd_pipeline::write_text(&file("json"), &(serde_json::to_string_pretty(&bench)? + "\n"))?;
    ivd_pipeline::write_text(&file("html"), &ivd_bench::interactive_page(&bench))?;
    let _ = writeln!(text, "{}, {:?} voxels", bench.input, bench.dims);
    for drag in &bench.drags {
        let [median, most, first] = drag.cpu_ms;
        let _ = writeln!(
            text,
            "  {} at level {}: processor time {median:.1} ms, 99 % {most:.1} ms, first {first:.1} ms; wall {:.1}, 99 % {:.1} ms; \
             placing {:.0}; {} voxels; {:.3} voxels from level 0",
            drag.solver,
            drag.level,
            drag.wall_ms[0],
            drag.wall_ms[1],
            drag.placed_ms[0],
            drag.voxels,
            drag.error_voxel[0]
        );
    }
    let _ = writeln!(text, "{}", file("html").display());
    object["interactive_page"] = json!(file("html"));
    Ok(())
}

/// Makes a folder for what was measured.
fn make(folder: &Path) -> anyhow::Result<()> {
    let failed = |e| Failure::of(ErrorClass::Io, format!("{}: can't be made: {e}", folder.display()));
    std::fs::create_dir_all(folder).map_err(failed)
}

/// A volume to bench on, by its file's name.
fn given(path: &Path, context: &Context) -> anyhow::Result<Given> {
    let input = volume_or_artefact(path, &Cache::disabled(), context)?;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let Some(volume) = Volume::of(&input.artefact) else {
        let kind = input.artefact.kind().name();
        return Err(Failure::usage(format!("--input {}: a {kind} artefact; give a volume", path.display())));
    };
    Ok(Given { name, volume: Arc::new(volume.clone()) })
}

/// Keeps the fronts, and the times of a plain scene where that is wanted.
fn record(bench: &Bench, scene: bool, folder: &Path, context: &Context) -> anyhow::Result<()> {
    make(folder)?;
    let keep = |name: &str, text: serde_json::Result<String>| -> anyhow::Result<()> {
        Ok(ivd_pipeline::write_text(&folder.join(format!("{name}.json")), &(text? + "\n")).map(|_| ())?)
    };
    for front in ivd_bench::fronts(bench) {
        keep(&front.stage, serde_json::to_string_pretty(&front))?;
    }
    if scene {
        let rates = ivd_bench::rates(bench.repeats, &context.exec).map_err(failed)?;
        keep("stages", serde_json::to_string_pretty(&rates))?;
    }
    Ok(())
}

/// Reads an older bench.
fn read(path: &Path) -> anyhow::Result<Bench> {
    let bytes = ivd_pipeline::scene::read_text_limited(path)
        .map_err(|e| Failure::of(ErrorClass::Io, format!("--compare {}: {e}", path.display())))?;
    // Where it is longer than any, nothing of it is one.
    serde_json::from_slice(&bytes.unwrap_or_default()).map_err(|e| {
        let message = format!("--compare {}: not a bench.json of this program: {e}", path.display());
        Failure::of(ErrorClass::Input, message)
    })
}

fn failed(error: ivd_bench::Error) -> anyhow::Error {
    let class = match &error {
        ivd_bench::Error::UnknownStage { .. } => ErrorClass::Usage,
        ivd_bench::Error::Failed { .. } | ivd_bench::Error::NoNumber { .. } => ErrorClass::Untrusted,
        ivd_bench::Error::Core(_) => return error.into(),
    };
    Failure::of(class, error.to_string())
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
