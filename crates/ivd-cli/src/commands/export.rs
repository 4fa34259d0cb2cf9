//! `ivd export`.

use std::path::{Path, PathBuf};

use ivd_artefact::Artefact;
use ivd_core::Image;
use ivd_io::Space;
use ivd_io::volume::FieldDirection;
use ivd_pipeline::resource::MemoryWatch;
use ivd_pipeline::{
    Depth, ExportOptions, FIELD_ENDINGS, Input, Metrics, Runner, ending, export_with, frame_file, map_frame,
};
use serde_json::{Map, Value, json};

use crate::args::{Direction, MeshSpace};
use crate::context::Context;
use crate::exit::Failure;
use crate::files::volume_or_artefact;
use crate::parse::Frames;

/// What is chosen of an artefact and its file.
pub(super) struct Choice<'a> {
    pub(super) level: Option<usize>,
    pub(super) lattice: Option<&'a Path>,
    pub(super) frame: Option<Frames>,
    pub(super) direction: Option<Direction>,
    pub(super) space: Option<MeshSpace>,
    pub(super) depth: Option<Depth>,
}

/// `ivd export`.
pub(super) fn export(
    artefact: &Path,
    output: &Path,
    choice: &Choice,
    context: &Context,
) -> anyhow::Result<()> {
    let Choice { level, lattice, frame, direction, space, depth } = *choice;
    let memory = MemoryWatch::start();
    let mut input = volume_or_artefact(artefact, &context.stage_cache()?, context)?;
    if let Some(level) = level {
        let Artefact::Lattice(lattice) = &*input.artefact else {
            let kind = input.artefact.kind().name();
            return Err(Failure::usage(format!("{}: a {kind} artefact has no levels", artefact.display())));
        };
        let Some(chosen) = lattice.at_level(level) else {
            let last = lattice.levels() - 1;
            return Err(Failure::usage(format!(
                "--level {level}: {} has levels 0 to {last}; `ivd refine --chain` makes them",
                artefact.display()
            )));
        };
        input.artefact = std::sync::Arc::new(Artefact::Lattice(chosen));
    }
    let is_field = FIELD_ENDINGS.contains(&&*ending(output));
    if frame.is_none() && is_field && matches!(*input.artefact, Artefact::Motion(_)) {
        let problem = format!(
            "{}: a displacement field is of one frame: add --frame N, or --frame all for a file of each{}",
            output.display(),
            if lattice.is_none() { ", and --lattice with the lattice that moves" } else { "" }
        );
        return Err(Failure::usage(problem));
    }
    let is_mapped = frame.is_some() && is_field;
    if direction.is_some() && !is_mapped && !matches!(*input.artefact, Artefact::Displacement(_)) {
        let kind = input.artefact.kind().name();
        return Err(Failure::usage(format!("--direction: a {kind} artefact has none; displacements have")));
    }
    if space.is_some() && !matches!(*input.artefact, Artefact::Lattice(_) | Artefact::Motion(_)) {
        let kind = input.artefact.kind().name();
        let problem =
            format!("--space: a {kind} artefact's file has its own; lattices and motions have a choice");
        return Err(Failure::usage(problem));
    }
    let is_picture =
        matches!(*input.artefact, Artefact::Image(_)) && matches!(&*ending(output), "png" | "apng");
    if depth.is_some() && !is_picture {
        let kind = input.artefact.kind().name();
        let problem = format!(
            "--depth: it is of an image written as .png, not of the kind {kind} as .{}; leave it out, or name a .png",
            ending(output)
        );
        return Err(Failure::usage(problem));
    }
    let depth = depth.unwrap_or_default();
    let space = space.map(|space| match space {
        MeshSpace::Ras => Space::Ras,
        MeshSpace::Lps => Space::Lps,
    });
    let direction = direction.map(FieldDirection::from).unwrap_or_default();
    let moved_input = lattice.map(|path| context.artefact(path)).transpose()?;
    let moved = match (moved_input.as_ref().map(|input| &*input.artefact), &*input.artefact) {
        (None, _) => None,
        (Some(Artefact::Lattice(lattice)), Artefact::Motion(_)) => Some(lattice),
        (Some(Artefact::Lattice(_)), other) => {
            let kind = other.kind().name();
            return Err(Failure::usage(format!("--lattice: a {kind} artefact needs none; motions do")));
        }
        (Some(other), _) => {
            let kind = other.kind().name();
            return Err(Failure::usage(format!("--lattice: a {kind} artefact isn't a lattice")));
        }
    };
    let options = ExportOptions { lattice: moved, direction, space, frame: None, depth };
    if let Some(frame) = frame {
        let written = if let (Artefact::Image(image), None) = (&*input.artefact, lattice) {
            pictures(image, &input, (frame, depth), output, context)?
        } else {
            frames(&input, moved_input.as_ref(), frame, output, &options, context)?
        };
        return print(&input, ("outputs", written.into()), memory, context);
    }
    let written = export_with(&input.artefact, output, &options, &context.exec)?;
    context.say(&format!("{}{}", output.display(), if written { "" } else { ": unchanged" }));
    print(&input, ("output", json!({ "path": output, "written": written })), memory, context)
}

/// Prints what was written, and what memory that took.
fn print(
    input: &Input,
    (name, written): (&str, Value),
    memory: MemoryWatch,
    context: &Context,
) -> anyhow::Result<()> {
    let peak = memory.stop();
    let object = json!({
        "command": "export", "input": input.hash.to_string(), "kind": input.artefact.kind().name(), name: written,
        "peak_rss_mb": peak.map(|peak| peak.resident), "peak_own_mb": peak.map(|peak| peak.own),
    });
    context.print(&object, String::new)
}

/// Writes pictures of a turntable.
fn pictures(
    image: &Image,
    input: &Input,
    (asked, depth): (Frames, Depth),
    output: &Path,
    context: &Context,
) -> anyhow::Result<Vec<Value>> {
    let mut written = Vec::new();
    for (frame, path) in files(asked, image.frames(), output) {
        let options = ExportOptions { frame: Some(frame), depth, ..ExportOptions::default() };
        let touched = export_with(&input.artefact, &path, &options, &context.exec)?;
        context.say(&format!("{}{}", path.display(), if touched { "" } else { ": unchanged" }));
        written.push(told(frame, &path, touched, None));
    }
    Ok(written)
}

/// The frames that are asked for of so many, each with its file.
fn files(asked: Frames, count: usize, output: &Path) -> Vec<(usize, PathBuf)> {
    match asked {
        Frames::All => (0..count).map(|frame| (frame, frame_file(output, frame))).collect(),
        Frames::One(frame) => vec![(frame, output.to_owned())],
    }
}

/// Writes frames of a motion: of its lattice, or of the voxels that it moves.
fn frames(
    input: &Input,
    lattice: Option<&Input>,
    asked: Frames,
    output: &Path,
    options: &ExportOptions<'_>,
    context: &Context,
) -> anyhow::Result<Vec<Value>> {
    let Artefact::Motion(motion) = &*input.artefact else {
        let kind = input.artefact.kind().name();
        let problem = format!(
            "--frame: a {kind} artefact has no frames; motions and turntables have, and `ivd map --frame N` makes the displacement of one"
        );
        return Err(Failure::usage(problem));
    };
    let Some(lattice) = lattice else {
        return Err(Failure::usage("--frame: it takes the lattice that the motion moves; add --lattice"));
    };
    let chosen = files(asked, motion.frames().len(), output);
    if chosen.is_empty() {
        return Err(Failure::usage("--frame all: the motion has no frames"));
    }
    let (mut written, cache) = (Vec::new(), context.stage_cache()?);
    let is_mapped = FIELD_ENDINGS.contains(&&*ending(output));
    for (frame, path) in chosen {
        let (touched, figures) = if is_mapped {
            let runner = Runner { exec: &context.exec, cache: &cache, lazy: false };
            let field = map_frame(lattice, input, frame, runner)?;
            (export_with(&field.artefact, &path, options, &context.exec)?, Some(field.record.metrics))
        } else {
            let options = ExportOptions { frame: Some(frame), ..*options };
            (export_with(&input.artefact, &path, &options, &context.exec)?, None)
        };
        context.say(&format!("{}{}", path.display(), if touched { "" } else { ": unchanged" }));
        written.push(told(frame, &path, touched, figures));
    }
    Ok(written)
}

/// What is told of a frame's file.
fn told(frame: usize, path: &Path, written: bool, figures: Option<Metrics>) -> Value {
    let mut told = json!({ "frame": frame, "path": path, "written": written });
    if let Some(figures) = figures {
        told["metrics"] = Map::from(figures).into();
    }
    told
}
