use std::path::PathBuf;

use ivd_core::{Classified, ErrorClass};

/// Why a mesh can't be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet: memory limit, values that don't fit.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A mesh file's format that isn't known.
    #[error("mesh format of {}: {problem}; use .ply, .obj, .stl, .glb or .vtp", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A lattice that a format can't hold.
    #[error("{format} can't hold this lattice: {problem}")]
    Unwritable {
        /// The format.
        format: &'static str,
        /// What it can't hold, with the number that shows it.
        problem: String,
    },
    /// A mesh file that isn't what its format asks for, or holds what can't be used.
    #[error("{}: {place}: {problem}; {remedy}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The line, byte or part that is wrong.
        place: String,
        /// What is wrong with it.
        problem: String,
        /// What to do instead.
        remedy: String,
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
            Self::Format { .. } => ErrorClass::Usage,
            Self::Unwritable { .. } => ErrorClass::Limit,
            Self::Unreadable { .. } => ErrorClass::Input,
            Self::Io { .. } => ErrorClass::Io,
        }
    }
}
