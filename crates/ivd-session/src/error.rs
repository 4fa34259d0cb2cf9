use ivd_core::{Classified, ErrorClass};

/// Why an event wasn't followed. The session is then as it was.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Inputs that don't fit, a motion that isn't to be trusted, cancellation, a limit.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// The lattice can't be refined to a level.
    #[error(transparent)]
    Lattice(#[from] ivd_lattice::Error),
    /// The octree of a level can't be built.
    #[error(transparent)]
    Octree(#[from] ivd_octree::Error),
    /// There is no map to the voxels, or none to be trusted.
    #[error(transparent)]
    Map(#[from] ivd_map::Error),
    /// An event that names what isn't there, or doesn't go with the settings.
    #[error("{event}: {problem}; {remedy}")]
    Event {
        /// The event.
        event: &'static str,
        /// What doesn't fit, with the numbers.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
}

ivd_core::from_param_error!(Error);

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::Lattice(error) => error.error_class(),
            Self::Octree(error) => error.error_class(),
            Self::Map(error) => error.error_class(),
            Self::Event { .. } => ErrorClass::Usage,
        }
    }
}
