//! `ivd serve`: a session in a browser.

use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

use ivd_core::Classified as _;
use ivd_frames::{Model, Subject, bare_scene};
use ivd_pipeline::scene;
use ivd_serve::{Links, Options, Place, Tell};
use serde_json::json;

use super::pipeline::demo_scene;
use crate::args::ServeArgs;
use crate::context::Context;
use crate::exit::Failure;

/// Pixels of the volume's pane until the page says how large it is.
const SIZE: [usize; 2] = [512; 2];

/// Serves until it is interrupted.
pub(super) fn run(args: ServeArgs, context: &Context) -> anyhow::Result<()> {
    let is_scene = |file: &Path| file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
    let (mut loaded, is_bare) = match &args.file {
        None => (demo_scene(&args.overrides)?, false),
        Some(file) if is_scene(file) => (scene::load(file, &args.overrides)?, false),
        Some(file) => (bare_scene(file, &args.overrides).map_err(|error| failed(&error))?, true),
    };
    if let Some(input) = &args.input {
        // From here on it lies where it lies, not beside the scene.
        loaded.scene.input.file = Some(std::path::absolute(input)?);
        loaded.scene.input.phantom = None;
    }
    let place = args.socket.map_or(Place::Port(args.port), Place::Socket);
    let (cache, exec) = (context.pipeline_cache()?, context.exec.clone());
    let open = move |tell: Arc<Tell>| {
        let subject = Subject::open(&loaded, is_bare, &cache, &exec, &|stage| tell(format!("{stage} …")))?;
        for said in &subject.said {
            exec.observer().note(&format!("chosen: {said}"));
            tell(format!("chosen: {said}"));
        }
        Model::new(subject, SIZE, exec)
    };
    let mut told = Ok(());
    let ready = |links: &Links| {
        let object = json!({ "drive": links.drive, "watch": links.watch });
        told = context.print(&object, || format!("{}\nto watch only: {}", links.drive, links.watch));
        let _ = std::io::stdout().flush();
    };
    let served = ivd_serve::serve(open, &context.exec, &Options { place }, ready);
    told?;
    served.map_err(|error| Failure::of(error.error_class(), error.to_string()))
}

fn failed(error: &ivd_frames::Error) -> anyhow::Error {
    Failure::of(error.error_class(), error.to_string())
}
