use std::path::PathBuf;

use ivd_core::{Classified, ErrorClass};

/// Why a transfer function can't be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A file that isn't what its format asks for, or holds what can't be used.
    #[error("{}: {place}: {problem}; {remedy}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The part that is wrong.
        place: String,
        /// What is wrong with it.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
    /// Reading or writing failed.
    #[error("{}: can't {action}: {source}", path.display())]
    Io {
        /// What was tried, such as `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::Unreadable { .. } => ErrorClass::Input,
            Self::Io { .. } => ErrorClass::Io,
        }
    }
}
