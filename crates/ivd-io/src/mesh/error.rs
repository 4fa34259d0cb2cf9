use std::path::PathBuf;

use ivd_core::{Classified, ErrorClass};

use crate::FileError;

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
    /// A mesh file that can't be read or written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::Format { .. } => ErrorClass::Usage,
            Self::Unwritable { .. } => ErrorClass::Limit,
            Self::File(error) => error.error_class(),
        }
    }
}
