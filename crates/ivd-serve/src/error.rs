use std::sync::Arc;

use ivd_core::{Classified, ErrorClass};

/// Why there is no page, or no more.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The subject can't be opened, or drawn.
    #[error(transparent)]
    Frames(Arc<ivd_frames::Error>),
    /// Interrupted.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// What the system refuses.
    #[error("{what}: {problem}; {remedy}")]
    System {
        /// What was tried.
        what: String,
        /// What it says.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Frames(error) => error.error_class(),
            Self::Core(error) => error.error_class(),
            Self::System { .. } => ErrorClass::Io,
        }
    }
}
