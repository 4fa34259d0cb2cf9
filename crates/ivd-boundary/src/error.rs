use ivd_core::{Classified, ErrorClass};

/// Why no part could be isolated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// No voxel is at or above the value.
    #[error("no voxel is at or above {above}; the volume's values are {range}")]
    NothingAbove {
        /// The value.
        above: f64,
        /// The values there are.
        range: String,
    },
    /// The seed lies outside the volume.
    #[error(
        "seed {seed:?} mm lies outside the volume, at voxel {voxel:.1?} of a grid of {dims:?}; move it inside: {told}"
    )]
    SeedOutside {
        /// The seed (mm).
        seed: [f64; 3],
        /// Its voxel coordinate.
        voxel: [f64; 3],
        /// Voxels of the grid.
        dims: [usize; 3],
        /// Where the volume is, and what may be meant.
        told: String,
    },
    /// The seed lies in something else.
    #[error(
        "seed {seed:?} mm lies in {found}, not in {wanted}, whose nearest voxel is {distance_mm:.2} mm away; move the seed there or choose another class"
    )]
    SeedElsewhere {
        /// The seed (mm).
        seed: [f64; 3],
        /// What is at the seed.
        found: String,
        /// What was wanted.
        wanted: String,
        /// Distance of the nearest wanted voxel's centre (mm).
        distance_mm: f64,
    },
    /// A surface that tells nothing from nothing.
    #[error("no boundary is found: {problem}; {remedy}")]
    NoBoundary {
        /// What it came to.
        problem: String,
        /// What to do about it.
        remedy: String,
    },
}

impl Error {
    pub(crate) fn no_boundary(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::NoBoundary { problem: problem.into(), remedy: remedy.into() }
    }
}

ivd_core::from_param_error!(Error);

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::NothingAbove { .. } | Self::SeedOutside { .. } | Self::SeedElsewhere { .. } => {
                ErrorClass::Usage
            }
            Self::NoBoundary { .. } => ErrorClass::Untrusted,
        }
    }
}
