use ivd_core::{Classified, ErrorClass, ParamError};

/// What can go wrong in this crate.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Inputs that don't fit, cancellation, a limit.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The octree can't be used.
    #[error(transparent)]
    Octree(#[from] ivd_octree::Error),
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
    /// A map that folds space, after everything that may be done against it.
    #[error(
        "the map folds: det ∇φ is only proven above {lower:.3} in the cell at voxel {voxel:?} ({world:.1?} mm), and in \
         {cells} cells in all; move less, or within a larger radius or margin"
    )]
    Folded {
        /// Lowest corner of the worst cell (voxel).
        voxel: [i64; 3],
        /// Its middle (mm, RAS).
        world: [f64; 3],
        /// Proven lower bound of det ∇φ there, ≤ 0.
        lower: f64,
        /// Number of cells that fold.
        cells: usize,
    },
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::Octree(error) => error.error_class(),
            Self::Param(_) | Self::Mismatch { .. } => ErrorClass::Usage,
            Self::Untrusted { .. } | Self::Folded { .. } => ErrorClass::Untrusted,
        }
    }
}
