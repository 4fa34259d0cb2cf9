use ivd_core::{Grid, TransferFunction, Volume};

use crate::{Error, Figures};

/// A transfer function and what is worth telling about it.
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

/// Length over which opacities hold on a grid [mm].
pub(crate) fn reference_mm(grid: &Grid) -> f64 {
    (grid.voxel_volume() * grid.len() as f64).cbrt() / REFERENCES
}

/// Largest magnitude of a value: the squares of 2⁵⁰ such values have a sum.
const MOST: f64 = 1e140;

/// Smallest and largest real value; zeros without data.
pub(crate) fn range_of(volume: &Volume) -> Result<[f64; 2], Error> {
    let [low, high] = volume.range().unwrap_or([0.0, 0.0]);
    if low >= -MOST && high <= MOST { Ok([low, high]) } else { Err(Error::TooWide { low, high, most: MOST }) }
}
