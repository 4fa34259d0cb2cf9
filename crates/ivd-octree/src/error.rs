use ivd_core::{Classified, ErrorClass, counted};

/// Why a lattice has no octree, or an octree doesn't serve.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet, such as the octree of another lattice.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A line of voxels enters the lattice more often than it leaves it, or the other way round.
    #[error(
        "the lattice is open: along x at voxel row y = {}, z = {} it is entered {} than left; \
         extract it again, or close its holes", row[0], row[1], counted(*surplus, "more time", "more times")
    )]
    Open {
        /// The row's y and z (voxels).
        row: [usize; 2],
        /// Entries less exits.
        surplus: i64,
    },
    /// Lattice or grid beyond what the octree's 32-bit nodes and 63-bit codes address.
    #[error(
        "the octree would need {needed} {what}, at most {limit} fit; crop the volume or refine the lattice"
    )]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How much.
        needed: u64,
        /// How much fits.
        limit: u64,
    },
}

ivd_core::from_param_error!(Error);

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(e) => e.error_class(),
            Self::Open { .. } => ErrorClass::Input,
            Self::TooLarge { .. } => ErrorClass::Limit,
        }
    }
}
