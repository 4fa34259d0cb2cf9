//! What clap says of words that it refuses, with the words as they are shown.

use std::ffi::OsString;
use std::io::Write as _;
use std::process::ExitCode;

use clap::builder::Styles;
use ivd_core::{ErrorClass, shown};

use crate::stages::{program, read, with_truths};

/// clap's own message about what was typed, on the stream it belongs to.
pub(crate) fn usage(error: &clap::Error, json: bool) -> ExitCode {
    let _ = refused(error).print();
    if json && error.use_stderr() {
        let message = lossless(error);
        let object = serde_json::json!({ "error": { "message": message.trim(), "exit_code": ErrorClass::Usage.exit_code() } });
        let _ = writeln!(std::io::stdout(), "{object}");
    }
    if error.use_stderr() { ExitCode::from(ErrorClass::Usage.exit_code()) } else { ExitCode::SUCCESS }
}

/// clap's error about the words that were typed, which it repeats: the error that it has about the same words as they are shown. Its
/// message is styled with control characters of its own, and can't be shown afterwards.
fn refused(error: &clap::Error) -> clap::Error {
    let words: Vec<OsString> =
        std::env::args_os().map(|word| shown(&word.to_string_lossy()).into_owned().into()).collect();
    again(program(), words, error)
}

/// The message of clap's error with every character of what was typed, and no style.
fn lossless(error: &clap::Error) -> String {
    let plain = program().styles(Styles::plain());
    again(plain, std::env::args_os().collect(), error).render().ansi().to_string()
}

/// The error of a command about words, of the same kind as one that was found before.
fn again(mut command: clap::Command, words: Vec<OsString>, before: &clap::Error) -> clap::Error {
    let parsed = command.try_get_matches_from_mut(with_truths(words, None)).and_then(|found| read(&found));
    match parsed {
        Err(error) => error.format(&mut command),
        // Escaped, the words would be taken: then what is wrong with them is that they aren't escaped.
        Ok(_) => clap::Error::new(before.kind()).with_cmd(&command),
    }
}
