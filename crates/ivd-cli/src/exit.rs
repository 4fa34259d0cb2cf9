//! From an error to what the user reads and the exit code that a script reads.

use std::io::Write as _;
use std::process::ExitCode;

use ivd_core::{Classified, ErrorClass};

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

/// Tells a failure on stderr (and as one JSON object on stdout where that was asked for) and gives its exit code.
pub(crate) fn failure(error: &anyhow::Error, json: bool) -> ExitCode {
    if is_broken_pipe(error) {
        return ExitCode::SUCCESS;
    }
    let code = code(error_class(error));
    if json {
        let object = serde_json::json!({ "error": { "message": error.to_string(), "exit_code": code } });
        let _ = writeln!(std::io::stdout(), "{object}");
    }
    talk::say(&format!("ivd: {error}"));
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

/// The exit code of a kind of failure.
pub(crate) fn code(class: ErrorClass) -> u8 {
    match class {
        ErrorClass::Usage => 2,
        ErrorClass::Input => 3,
        ErrorClass::Limit => 4,
        ErrorClass::Untrusted => 5,
        ErrorClass::NoGpu => 6,
        ErrorClass::Io => 7,
        ErrorClass::Cancelled => 130,
    }
}
