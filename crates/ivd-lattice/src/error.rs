use std::path::PathBuf;

use ivd_core::{Fault, Faulty, ParamError};

/// Why a lattice could not be extracted, refined, read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet: cancelled, memory limit, grids that differ.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A parameter is outside its domain.
    #[error(transparent)]
    Param(#[from] ParamError),
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
    /// A mesh that can't become a lattice on its grid.
    #[error("the mesh can't become a lattice: {problem}; {remedy}")]
    Unfit {
        /// What is wrong, with its number and the place (mm) of the first.
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

impl Faulty for Error {
    fn fault(&self) -> Fault {
        match self {
            Self::Core(error) => error.fault(),
            Self::Param(_) | Self::MissingInput { .. } | Self::Format { .. } => Fault::Usage,
            Self::TooManyVertices { .. } | Self::Unwritable { .. } => Fault::Limit,
            Self::Unreachable { .. } => Fault::Usage,
            Self::Unreadable { .. } | Self::Unfit { .. } => Fault::Input,
            Self::Io { .. } => Fault::Io,
        }
    }
}
