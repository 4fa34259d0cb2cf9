use ivd_core::{Classified, ErrorClass, ParamError};

/// Why a volume could not be segmented.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
}

impl From<ParamError> for Error {
    fn from(error: ParamError) -> Self {
        Self::Core(error.into())
    }
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
        }
    }
}
