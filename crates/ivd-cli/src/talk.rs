//! What is said to a person: text of files and paths in it is shown, so that it can't act on the terminal.

use std::ffi::OsString;
use std::io::Write;

use clap::builder::Styles;
use ivd_core::shown;

use crate::declared::{program, read, with_truths};

/// Says a line on stderr.
pub(crate) fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", shown(text));
}

/// Stderr for whoever writes to it: what passes is shown.
pub(crate) struct Shown;

impl Write for Shown {
    /// Takes whole events, as the log writes them.
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        std::io::stderr().write_all(shown(&String::from_utf8_lossy(bytes)).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}

/// clap's error about the words that were typed, which it repeats: the error that it has about the same words as they are shown. Its
/// message is styled with control characters of its own, and can't be shown afterwards.
pub(crate) fn refused(error: &clap::Error) -> clap::Error {
    let words: Vec<OsString> =
        std::env::args_os().map(|word| shown(&word.to_string_lossy()).into_owned().into()).collect();
    again(program(), words, error)
}

/// The message of clap's error with every character of what was typed, and no style.
pub(crate) fn lossless(error: &clap::Error) -> String {
    let plain = program().styles(Styles::plain());
    again(plain, std::env::args_os().collect(), error).render().ansi().to_string()
}

/// The error of a command about words, of the same kind as one that was found before.
fn again(mut command: clap::Command, words: Vec<OsString>, before: &clap::Error) -> clap::Error {
    let parsed =
        command.try_get_matches_from_mut(with_truths(words.into_iter())).and_then(|found| read(&found));
    match parsed {
        Err(error) => error.format(&mut command),
        // Escaped, the words would be taken: then what is wrong with them is that they aren't escaped.
        Ok(_) => clap::Error::new(before.kind()).with_cmd(&command),
    }
}
