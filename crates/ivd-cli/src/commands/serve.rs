//! `ivd serve`: a session in a browser.

use std::io::Write as _;

use ivd_core::Classified as _;
use ivd_frames::{Begun, Model, Opened, Source, Subject, Tell};
use ivd_serve::{Links, Options, Place};
use serde_json::json;

use crate::args::ServeArgs;
use crate::context::Context;
use crate::exit::Failure;

/// Pixels of the volume's pane until the page says how large it is.
const SIZE: [usize; 2] = [512; 2];

/// Serves until it is interrupted.
pub(super) fn run(args: ServeArgs, context: &Context) -> anyhow::Result<()> {
    let source =
        Source { file: args.file, input: args.input, labels: args.labels, overrides: args.overrides };
    let Opened { loaded, is_bare, entries } = source.read().map_err(|error| failed(&error))?;
    let place = args.socket.map_or(Place::Port(args.port), Place::Socket);
    let (cache, exec) = (context.pipeline_cache()?, context.exec.clone());
    let open = move |tell: &Tell| {
        let subject = Subject::open(&loaded, is_bare, &cache, &exec, tell)?;
        for note in subject.notes() {
            exec.observer().note(&note);
            tell.note(note);
        }
        Ok(Begun { entries, ..Model::new(subject, SIZE, exec)?.into() })
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
