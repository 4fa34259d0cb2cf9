//! `ivd bench`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ivd_artefact::{Artefact, Cache};
use ivd_bench::{Bench, Comparison, Given, Options, Plant, StageBench};
use ivd_core::{ErrorClass, Value as _, Volume};
use serde::Serialize;
use serde_json::{Value, json};

use crate::args::{Bench as Args, Planted};
use crate::context::Context;
use crate::exit::Failure;
use crate::files::volume_or_artefact;

/// The name under which whole scenes are asked for.
const SCENES: &str = "scenes";

/// The name under which the page of refinements is asked for.
const REFINEMENTS: &str = "refinements";

/// The name under which drags are asked for.
const INTERACTIVE: &str = "interactive";

/// Sweeps the stages' settings, runs the scenes, and writes what came of it.
pub(super) fn run(args: &Args, context: &Context) -> anyhow::Result<()> {
    if context.exec.device.is_some() {
        let problem =
            "a bench measures the CPU, which its records are of; leave out --backend gpu and --require-gpu";
        return Err(Failure::usage(problem.to_owned()));
    }
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
    let mut output = Output { object: json!({ "out": args.out }), text: String::new() };
    let request = Request { options: &options, args, context };
    if all || !options.stages.is_empty() {
        request.stages(old.as_ref(), &mut output)?;
    }
    if all || named(SCENES) {
        request.scenes(&mut output)?;
    }
    if named(REFINEMENTS) {
        request.refinements(&mut output)?;
    }
    if named(INTERACTIVE) {
        request.interactive(&mut output)?;
    }
    context.print(&output.object, || output.text.trim_end().to_owned())
}

/// What is said of a run, to programs and to people.
struct Output {
    object: Value,
    text: String,
}

/// What is measured, and where it is written.
#[derive(Clone, Copy)]
struct Request<'a> {
    options: &'a Options,
    args: &'a Args,
    context: &'a Context,
}

impl Request<'_> {
    /// Writes what was measured, and its page, under a name; gives the page.
    fn write(self, name: &str, bench: &impl Serialize, page: &str) -> anyhow::Result<PathBuf> {
        make(&self.args.out)?;
        let file = |ending: &str| self.args.out.join(format!("{name}.{ending}"));
        ivd_pipeline::write_text(&file("json"), &(serde_json::to_string_pretty(bench)? + "\n"))?;
        ivd_pipeline::write_text(&file("html"), page)?;
        Ok(file("html"))
    }

    /// Sweeps the stages.
    fn stages(self, old: Option<&Bench>, Output { object, text }: &mut Output) -> anyhow::Result<()> {
        let Self { options, args, context } = self;
        let bench = ivd_bench::run(options, &context.exec).map_err(failed)?;
        let page = self.write("bench", &bench, &ivd_bench::page(&bench))?;
        ivd_pipeline::write_text(&args.out.join("bench.csv"), &ivd_bench::table(&bench))?;
        if let Some(folder) = &args.record {
            record(&bench, args.stages.is_empty(), folder, context)?;
        }
        let comparison = old.map(|old| ivd_bench::compare(old, &bench));
        let points = |s: &StageBench| json!({ "stage": s.stage, "points": s.points.len() });
        object["page"] = json!(page);
        object["stages"] = bench.stages.iter().map(points).collect();
        object["comparison"] = json!(comparison);
        *text += &summary(&bench, comparison.as_ref(), &page);
        *text += "\n";
        Ok(())
    }

    /// Runs whole scenes.
    fn scenes(self, Output { object, text }: &mut Output) -> anyhow::Result<()> {
        let Self { options, context, .. } = self;
        let bench = ivd_bench::scenes(options, &context.exec).map_err(failed)?;
        let page = self.write(SCENES, &bench, &ivd_bench::scenes_page(&bench))?;
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
    fn refinements(self, Output { object, text }: &mut Output) -> anyhow::Result<()> {
        let Self { options, args, context } = self;
        let bench = ivd_bench::refinements(options, args.iso, &context.exec).map_err(failed)?;
        let page = self.write(REFINEMENTS, &bench, &ivd_bench::refinements_page(&bench)?)?;
        ivd_pipeline::export(&Artefact::Image(bench.sheet()), &page.with_extension("png"), &context.exec)?;
        for lattice in &bench.lattices {
            let _ = writeln!(text, "{}", lattice.input);
            for claim in &lattice.claims {
                let _ = writeln!(text, "  {} {}: {}", claim.section, claim.says, claim.verdict());
            }
        }
        let _ = writeln!(text, "{}", page.display());
        object["refinements_page"] = json!(page);
        Ok(())
    }

    /// Drags a handle.
    fn interactive(self, Output { object, text }: &mut Output) -> anyhow::Result<()> {
        let Self { options, args, context } = self;
        let bench =
            ivd_bench::interactive(options, args.iso, &source(args)?, &context.exec).map_err(failed)?;
        let page = self.write(INTERACTIVE, &bench, &ivd_bench::interactive_page(&bench))?;
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
        let frames = &bench.frames;
        let _ = writeln!(
            text,
            "  to the picture: {:.0} ms, 99 % {:.0}; placing {:.0}, whole {:.0} ms after the last; slices after {:.1} s, the volume after {:.1}, to be moved after {:.1}; sides divided by 1, 2, 3, 4 in {:?}",
            frames.picture_ms[0],
            frames.picture_ms[1],
            frames.placed_ms,
            frames.whole_ms,
            frames.opened_s[0],
            frames.opened_s[1],
            frames.opened_s[2],
            frames.divided
        );
        let _ = writeln!(text, "{}", page.display());
        object["interactive_page"] = json!(page);
        Ok(())
    }
}

/// What the frame service opens: the given scan at level 2, or the demo's head.
fn source(args: &Args) -> anyhow::Result<ivd_frames::Source> {
    let iso = args.iso.map(|iso| format!("lattice.iso={iso}"));
    let level = args.input.as_ref().map(|_| "refine.level=2".to_owned());
    let overrides = iso.into_iter().chain(level).map(|key| key.parse().map_err(Failure::usage));
    let overrides = overrides.collect::<Result<_, _>>()?;
    Ok(ivd_frames::Source { file: args.input.clone(), overrides, ..ivd_frames::Source::default() })
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

/// What a person is told of the stages.
fn summary(bench: &Bench, comparison: Option<&Comparison>, page: &Path) -> String {
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
