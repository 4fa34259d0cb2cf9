use ivd_core::{Classified, ErrorClass, Grid, VoxelCoord, counted};
use ivd_field::certificate::Certificate;
use nalgebra::Vector3;

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Inputs that don't fit, a result that can't be trusted, cancellation, a limit.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// The octree can't be used.
    #[error(transparent)]
    Octree(#[from] ivd_octree::Error),
    /// The whole way can't be mapped; a part of it can.
    #[error("{problem}. {:.0} % of the way can be mapped: limit = \"stop\" goes that far", 100.0 * share)]
    Beyond {
        /// Why the whole way can't.
        problem: Box<Error>,
        /// The share that was found to hold, to a 32nd.
        share: f64,
    },
    /// A map that folds space, after everything that may be done against it.
    #[error(
        "the map folds: det ∇φ is only proven above {lower:.3} in the cell at voxel {voxel:?} ({world:.1?} mm), and in \
         {} in all; move less, or within a larger radius or margin",
        counted(*cells, "cell", "cells")
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

impl Error {
    /// The worst cell of a map whose certificate doesn't hold, and how many there are.
    pub(crate) fn folded(certificate: &Certificate, grid: &Grid) -> Self {
        let worst = certificate.worst.expect("a field that folds has a worst cell");
        let middle = Vector3::from(worst.cell).map(|c| c as f64 + 0.5);
        Self::Folded {
            voxel: worst.cell,
            world: grid.world(VoxelCoord(middle)).0.into(),
            lower: worst.lower,
            cells: certificate.folded.len(),
        }
    }
}

ivd_core::from_param_error!(Error);

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::Octree(error) => error.error_class(),
            Self::Folded { .. } | Self::Beyond { .. } => ErrorClass::Untrusted,
        }
    }
}
