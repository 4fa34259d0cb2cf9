use ivd_core::{Classified, ErrorClass, ParamError};

/// Why a transfer function could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A parameter outside its domain.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// More classes than a table of rows can hold.
    #[error(
        "the labels hold {classes} classes, a transfer function takes at most {most}; segment with fewer classes"
    )]
    TooManyClasses {
        /// Different labels met.
        classes: usize,
        /// Most that are taken.
        most: usize,
    },
    /// Values whose squares can't be summed, so that no class has a spread.
    #[error(
        "the volume's values reach from {low:e} to {high:e}, beyond ±{most:e}; rescale the volume to smaller numbers"
    )]
    TooWide {
        /// Smallest real value.
        low: f64,
        /// Largest real value.
        high: f64,
        /// Largest magnitude that is taken.
        most: f64,
    },
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::Param(_) => ErrorClass::Usage,
            Self::TooManyClasses { .. } | Self::TooWide { .. } => ErrorClass::Limit,
        }
    }
}
