//! `ivd view`: a session in a window, where this program was built with one.

use crate::args::ViewArgs;
use crate::context::Context;
use crate::exit::Failure;

/// Shows a window until it is closed.
#[cfg(feature = "view")]
pub(super) fn run(args: ViewArgs, context: &Context) -> anyhow::Result<()> {
    use ivd_core::Classified as _;

    let options = ivd_view::Options::new(context.exec.clone(), context.pipeline_cache()?);
    let source = args.file.map(|file| ivd_frames::Source {
        input: args.input,
        labels: args.labels,
        overrides: args.overrides,
        ..ivd_view::source(&file)
    });
    ivd_view::run(options, source).map_err(|error| Failure::of(error.error_class(), error.to_string()))
}

/// Says how to have a window.
#[cfg(not(feature = "view"))]
pub(super) fn run(_: ViewArgs, _: &Context) -> anyhow::Result<()> {
    Err(Failure::usage(
        "this program was built without a window: `cargo run --release -p ivd-view -- SCAN` shows one, and `ivd serve` shows the same in a browser",
    ))
}
