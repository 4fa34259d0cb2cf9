use ivd_core::{Grid, TransferFunction};

use crate::figures::Figures;

/// A transfer function and its figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Built {
    /// The table and its entries.
    pub transfer: TransferFunction,
    /// What it comes to.
    pub figures: Figures,
}

/// Number of reference lengths in the side of a cube of the volume's size: the same scan at twice the resolution gives the
/// same picture, and a 256³ volume has a reference of two voxels.
const REFERENCES: f64 = 128.0;

/// Length over which opacities hold on a grid (mm).
pub(crate) fn reference_mm(grid: &Grid) -> f64 {
    (grid.voxel_volume() * grid.len() as f64).cbrt() / REFERENCES
}
