use ivd_core::{Classified, ErrorClass};

/// Why a transfer function could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
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
    /// A table by value and gradient where a label has to tell classes apart.
    #[error(
        "values don't tell all classes apart, so that a table by value and gradient can't show them; give axes value, whose rows go by label"
    )]
    RowsDiffer,
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

ivd_core::from_param_error!(Error);

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::RowsDiffer => ErrorClass::Usage,
            Self::TooManyClasses { .. } | Self::TooWide { .. } => ErrorClass::Limit,
        }
    }
}
