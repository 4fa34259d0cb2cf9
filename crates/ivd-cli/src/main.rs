//! The program `ivd`: arguments, progress, exit codes. Everything else lives in the crates below it.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]
#![cfg_attr(not(test), deny(clippy::unreachable, clippy::wildcard_enum_match_arm))]

mod args;
mod commands;
mod context;
mod exit;
mod files;
mod gpu;
mod guard;
mod parse;
mod progress;
mod refusal;
mod stages;
mod talk;

use std::process::ExitCode;

fn main() -> ExitCode {
    let json = std::env::args_os().any(|word| word == "--json");
    match stages::parse(std::env::args_os().collect()) {
        Ok((global, asked)) => {
            let json = global.json;
            let run = |context: context::Context| {
                commands::run(asked, &context)
                    .map_err(|error| context.guard.explain(error, global.memory_limit))
            };
            match context::Context::new(&global).and_then(run) {
                Ok(()) => ExitCode::SUCCESS,
                Err(error) => exit::failure(&error, json),
            }
        }
        Err(error) => refusal::usage(&error, json),
    }
}
