//! From the formats' world space, LPS millimetres, to ours, RAS, and back: x and y change sign.

use std::path::Path;

use ivd_core::Grid;
use nalgebra::{Matrix3, Vector3};

use crate::Space;
use crate::volume::Error;

/// A vector or position in LPS as RAS, or the other way round.
pub(crate) fn flip(v: [f64; 3]) -> [f64; 3] {
    Space::Lps.turn(v)
}

/// The grid whose voxel axes step by the columns `axes` (mm) from `origin` (mm), both LPS.
pub(crate) fn grid_from_lps(
    path: &Path,
    dims: [usize; 3],
    axes: [[f64; 3]; 3],
    origin: [f64; 3],
) -> Result<Grid, Error> {
    grid_from_ras(path, dims, axes.map(flip), flip(origin))
}

/// As [`grid_from_lps`], with axes and origin in RAS.
pub(crate) fn grid_from_ras(
    path: &Path,
    dims: [usize; 3],
    axes: [[f64; 3]; 3],
    origin: [f64; 3],
) -> Result<Grid, Error> {
    Grid::from_affine(dims, Matrix3::from_columns(&axes.map(Vector3::from)), Vector3::from(origin))
        .map_err(|e| Error::field(path, "grid", e.to_string()))
}

/// The grid of a format that gives spacing and direction apart, so that the spacing stays exact. LPS.
pub(crate) fn grid_from_lps_parts(
    path: &Path,
    dims: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    direction: [[f64; 3]; 3],
) -> Result<Grid, Error> {
    Grid::new(dims, spacing, flip(origin), direction.map(flip))
        .map_err(|e| Error::field(path, "grid", e.to_string()))
}

/// The identity in LPS: where ITK puts a file without a space.
pub(crate) const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A grid in a format without directions: axes along LPS, first voxel at 0.
pub(crate) fn plain_grid(path: &Path, dims: [usize; 3], spacing: [f64; 3]) -> Result<Grid, Error> {
    grid_from_lps_parts(path, dims, spacing, [0.0; 3], IDENTITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_grid_lies_along_lps() {
        let grid = plain_grid(Path::new("x"), [2, 3, 4], [0.5, 1.0, 2.0]).unwrap();
        assert_eq!(grid.direction(), [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(grid.spacing(), [0.5, 1.0, 2.0]);
        assert!(grid.origin()[0].is_sign_positive());
    }

    #[test]
    fn spacing_survives_a_direction_with_rounding() {
        let third = 1.0 / 3.0_f64.sqrt();
        let direction = [[third; 3], [-third, third, third], [third, -third, third]];
        let grid = grid_from_lps_parts(Path::new("x"), [2; 3], [0.1; 3], [1.0; 3], direction).unwrap();
        assert_eq!(grid.spacing(), [0.1; 3]);
    }
}
