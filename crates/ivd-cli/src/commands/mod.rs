//! One function for each command that isn't of a stage of the list.

mod at;
mod bench;
mod cache;
mod combine;
mod compare;
mod doctor;
mod export;
mod info;
mod pipeline;
mod serve;
mod view;
mod volume;

use crate::args::Command;
use crate::context::Context;
use crate::exit::Failure;
use crate::stages::{self, Asked};

/// Does what was asked for.
pub(crate) fn run(asked: Asked, context: &Context) -> anyhow::Result<()> {
    let command = match asked {
        Asked::Stage(offer, matches) => return stages::run(&offer, &matches, context),
        Asked::Command(command) => *command,
    };
    if let Some(file) = context.global.params.as_deref() {
        return Err(Failure::usage(format!(
            "--params {}: this command reads none; {} do, and `ivd pipeline` takes --set stage.key=value",
            file.display(),
            stages::declared().map(|stage| stage.name).collect::<Vec<_>>().join(", ")
        )));
    }
    match command {
        Command::Demo { out } => pipeline::demo(&out, context),
        Command::Pipeline(args) => pipeline::run(&args, context),
        Command::Import { source, labels, mask, displacement, like, grid_of, raw, output } => {
            let taken = match (labels, mask, displacement) {
                (_, _, Some(direction)) => volume::Taken::Displacement(direction),
                (true, _, None) => volume::Taken::Labels,
                (false, true, None) => volume::Taken::Mask,
                (false, false, None) => volume::Taken::Volume,
            };
            let others = volume::Others { like: like.as_deref(), grid_of: grid_of.as_deref() };
            volume::import(&source, taken, others, &raw, &output.path, context)
        }
        Command::Phantom { name, size, truth, noise, voxel_type, seed, contrast, output } => {
            let params = volume::phantom_params(&name, size, noise, &voxel_type, seed, &contrast)?;
            volume::phantom(params, truth.as_deref(), &output.path, context)
        }
        Command::Export { artefact, output, level, lattice, frame, direction, space, depth } => {
            let lattice = lattice.as_deref();
            let choice = export::Choice { level, lattice, frame, direction, space, depth };
            export::export(&artefact, &output, &choice, context)
        }
        Command::Info { file, series: Some(None), at, .. } if at.is_empty() => info::series(&file, context),
        Command::Info { file, series, vertex, voxel, at, labels, mask } => {
            let (series, beside) =
                (series.flatten(), at::Beside { labels: labels.as_deref(), mask: mask.as_deref() });
            let asked = info::Asked { series, vertices: &vertex, voxels: &voxel, places: &at, beside };
            info::run(&file, asked, context)
        }
        Command::Compare { a, b, labels } => compare::run(&a, &b, labels, context),
        Command::Bench(args) => bench::run(&args, context),
        Command::Serve(args) => serve::run(args, context),
        Command::View(args) => view::run(args, context),
        Command::Doctor => doctor::run(context),
        Command::Schema => {
            let schema = ivd_pipeline::scene::Scene::json_schema();
            context.print_verbatim(&schema, || format!("{schema:#}"))
        }
        Command::Cache { action } => cache::run(action, context),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            let mut program = stages::program();
            clap_complete::generate(shell, &mut program, "ivd", &mut script);
            let script = String::from_utf8(script)?;
            context.print_verbatim(&serde_json::json!({ "script": script }), || script.clone())
        }
        Command::Combine(args) => combine::combine(&args, context),
        Command::Clip(args) => combine::clip(&args, context),
    }
}
