//! What reading and writing small files comes to, whatever the files hold.

use std::path::{Path, PathBuf};

use ivd_core::{Classified, ErrorClass};

/// Why a file can't be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// A file that isn't what its format asks for, or holds what can't be used.
    #[error("{}: {place}: {problem}; {remedy}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The line, byte or part that is wrong.
        place: String,
        /// What is wrong with it.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
    /// A value that a format can't hold.
    #[error("{}: {format} can't hold {what}; {remedy}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The format.
        format: &'static str,
        /// What it can't hold.
        what: &'static str,
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

impl FileError {
    pub(crate) fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        Self::Io { action, path: path.to_owned(), source }
    }
}

impl Classified for FileError {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Unreadable { .. } => ErrorClass::Input,
            Self::Unwritable { .. } => ErrorClass::Usage,
            Self::Io { .. } => ErrorClass::Io,
        }
    }
}
