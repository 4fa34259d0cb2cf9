//! The program `ivd`: arguments, progress, exit codes. Everything else lives in the crates below it.
#![forbid(unsafe_code)]

mod args;
mod commands;
mod context;
mod exit;
mod parse;
mod progress;
mod talk;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = match args::Args::try_parse() {
        Ok(args) => args,
        Err(error) => return exit::usage(&error, std::env::args_os().any(|word| word == "--json")),
    };
    let json = args.global.json;
    match context::Context::new(&args.global).and_then(|context| commands::run(args.command, &context)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => exit::failure(&error, json),
    }
}
