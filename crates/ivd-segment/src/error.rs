use ivd_core::{Fault, Faulty, ParamError};

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

impl Faulty for Error {
    fn fault(&self) -> Fault {
        match self {
            Self::Core(error) => error.fault(),
        }
    }
}
