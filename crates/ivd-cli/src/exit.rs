//! From an error to what the user reads and the exit code that a script reads.

use std::io::Write as _;
use std::process::ExitCode;

use ivd_core::{Classified, ErrorClass};
use ivd_pipeline::LeftOver;

use crate::talk;

/// A failure with its kind, for errors that no crate below has a type for.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub(crate) struct Failure {
    /// What was wrong, where, and what to do.
    pub(crate) message: String,
    /// What kind of failure it is.
    pub(crate) class: ErrorClass,
}

impl Failure {
    /// A failure of a kind.
    pub(crate) fn of(class: ErrorClass, message: impl Into<String>) -> anyhow::Error {
        Self { message: message.into(), class }.into()
    }

    /// Wrong usage.
    pub(crate) fn usage(message: impl Into<String>) -> anyhow::Error {
        Self::of(ErrorClass::Usage, message)
    }
}

/// A run that failed where outputs of an earlier one lie: who opens them takes them for its own.
#[derive(Debug)]
pub(crate) struct Unfinished {
    /// What was wrong.
    message: String,
    /// What is still there.
    left: Vec<LeftOver>,
}

impl Unfinished {
    /// The error of such a run; the error itself where nothing is left.
    pub(crate) fn of(error: anyhow::Error, left: Vec<LeftOver>) -> anyhow::Error {
        if left.is_empty() {
            return error;
        }
        let message = error.to_string();
        error.context(Self { message, left })
    }

    /// The error that is told in an error's place, with what that one says is left.
    pub(crate) fn carried(from: &anyhow::Error, to: anyhow::Error) -> anyhow::Error {
        Self::of(
            to,
            from.downcast_ref::<Self>().map(|unfinished| unfinished.left.clone()).unwrap_or_default(),
        )
    }

    /// What is left, in a line; of many the first.
    fn told(&self) -> String {
        let named = self.left.iter().take(MOST_NAMED);
        let mut files: Vec<String> =
            named.map(|file| format!("{} (of {})", file.path.display(), file.written)).collect();
        match self.left.len().saturating_sub(MOST_NAMED) {
            0 => {}
            1 => files.push("and one more".to_owned()),
            more => files.push(format!("and {more} more")),
        }
        format!("this run wrote none of what is still there from an earlier one: {}", files.join(", "))
    }
}

impl std::fmt::Display for Unfinished {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

/// Most files that are named in a line.
const MOST_NAMED: usize = 8;

/// Tells a failure on stderr (and as one JSON object on stdout where that was asked for) and gives its exit code.
pub(crate) fn failure(error: &anyhow::Error, json: bool) -> ExitCode {
    if is_broken_pipe(error) {
        return ExitCode::SUCCESS;
    }
    let code = error_class(error).exit_code();
    let unfinished = error.downcast_ref::<Unfinished>();
    if json {
        let mut object = serde_json::json!({ "error": { "message": error.to_string(), "exit_code": code } });
        if let Some(Unfinished { left, .. }) = unfinished {
            object["error"]["left_over"] = serde_json::json!(left);
        }
        let _ = writeln!(std::io::stdout(), "{object}");
    }
    talk::say(&format!("ivd: {error}"));
    if let Some(unfinished) = unfinished {
        talk::say(&format!("ivd: note: {}", unfinished.told()));
    }
    ExitCode::from(code)
}

/// The kind of a failure, by the first of its causes that has one.
pub(crate) fn error_class(error: &anyhow::Error) -> ErrorClass {
    for cause in error.chain() {
        if let Some(e) = cause.downcast_ref::<ivd_pipeline::Error>() {
            return e.error_class();
        }
        if let Some(e) = cause.downcast_ref::<Failure>() {
            return e.class;
        }
        if let Some(e) = cause.downcast_ref::<ivd_artefact::Error>() {
            return e.error_class();
        }
        if let Some(e) = cause.downcast_ref::<ivd_core::Error>() {
            return e.error_class();
        }
    }
    ErrorClass::Io
}

/// Whoever read our output has seen enough (`ivd info … | head`).
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
    })
}
