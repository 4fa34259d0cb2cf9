//! The program `ivd`: arguments, progress, exit codes. Everything else lives in the crates below it.
#![forbid(unsafe_code)]

mod args;
mod commands;
mod context;
mod declared;
mod exit;
mod parse;
mod progress;
mod talk;

use std::process::ExitCode;

use args::{Args, Global};
use clap::FromArgMatches as _;

fn main() -> ExitCode {
    let words = declared::with_truths(std::env::args_os());
    let json = words.iter().any(|word| word == "--json");
    match declared::program().try_get_matches_from(words).map(read) {
        Ok(Ok((global, asked))) => {
            let json = global.json;
            match context::Context::new(&global).and_then(|context| commands::run(asked, &context)) {
                Ok(()) => ExitCode::SUCCESS,
                Err(error) => exit::failure(&error, json),
            }
        }
        Ok(Err(error)) | Err(error) => exit::usage(&error, json),
    }
}

/// What was typed: the flags of every command, and the command.
fn read(matches: clap::ArgMatches) -> Result<(Global, commands::Asked), clap::Error> {
    match matches.subcommand().and_then(|(name, own)| Some((ivd_pipeline::list::stage(name)?, own))) {
        Some((stage, own)) => {
            Ok((Global::from_arg_matches(&matches)?, commands::Asked::Stage(stage, own.clone())))
        }
        None => {
            let args = Args::from_arg_matches(&matches)?;
            Ok((args.global, commands::Asked::Command(args.command)))
        }
    }
}
