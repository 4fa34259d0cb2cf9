use ivd_core::{Fault, ParamError};

/// What can go wrong in this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// Inputs that don't fit, cancellation, a limit.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// Two inputs that don't belong together, such as a motion of another lattice.
    #[error("{what}: {problem}; {remedy}")]
    Mismatch {
        /// The input.
        what: &'static str,
        /// What doesn't fit, with the numbers.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
    /// A result that can't be trusted: diverged, not finite.
    #[error("{what} can't be trusted: {problem}; {remedy}")]
    Untrusted {
        /// The result.
        what: &'static str,
        /// The number that shows it, and where.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
}

impl Error {
    /// Whose fault it is; decides the program's exit code.
    pub fn fault(&self) -> Fault {
        match self {
            Self::Core(error) => error.fault(),
            Self::Param(_) => Fault::Usage,
            Self::Mismatch { .. } => Fault::Usage,
            Self::Untrusted { .. } => Fault::Untrusted,
        }
    }
}
