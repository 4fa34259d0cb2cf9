use ivd_core::{Classified, ErrorClass};

/// Why a lattice could not be extracted or refined.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet: cancelled, memory limit, grids that differ.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// An input that the parameters ask for was not given.
    #[error("{asked} needs {needed}; {remedy}")]
    MissingInput {
        /// What was asked for.
        asked: &'static str,
        /// The input that it needs.
        needed: &'static str,
        /// What to do instead.
        remedy: &'static str,
    },
    /// More vertices than a triangle's 32-bit indices can name.
    #[error(
        "the surface has at least {vertices} vertices, more than a lattice's 2³² − 1 or a row of voxels' 2²⁹; crop the volume or choose another \
         isovalue"
    )]
    TooManyVertices {
        /// Vertices counted.
        vertices: u64,
    },
    /// A lattice that can't be refined as asked.
    #[error("refinement to {asked} can't be reached: {problem}; {remedy}")]
    Unreachable {
        /// What was asked for, such as `level 4`.
        asked: String,
        /// What stops it, with the number that shows it.
        problem: String,
        /// What to do instead.
        remedy: String,
    },
    /// A mesh that can't become a lattice on its grid.
    #[error("the mesh can't become a lattice: {problem}; {remedy}")]
    Unfit {
        /// What is wrong, with its number and the place (mm) of the first.
        problem: String,
        /// What to do instead.
        remedy: String,
    },
}

ivd_core::from_param_error!(Error);

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::MissingInput { .. } => ErrorClass::Usage,
            Self::TooManyVertices { .. } => ErrorClass::Limit,
            Self::Unreachable { .. } => ErrorClass::Usage,
            Self::Unfit { .. } => ErrorClass::Input,
        }
    }
}
