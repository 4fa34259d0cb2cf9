//! From a header's fields to the voxel-to-world affine, and from a grid to the quaternion.

use std::path::Path;

use ivd_core::Grid;
use nalgebra::Matrix3;

use super::header::Header;
use crate::volume::Error;
use crate::volume::orientation;

/// The grid of a header, by the rule of the module's head.
pub(super) fn grid(path: &Path, header: &Header, dims: [usize; 3]) -> Result<Grid, Error> {
    let unit = millimetres(header.xyzt_units);
    if header.sform_code > 0 {
        let r = header.srow;
        let axes = std::array::from_fn(|a| std::array::from_fn(|w| unit * r[w][a]));
        let origin = std::array::from_fn(|w| unit * r[w][3]);
        return name(path, "srow_x, srow_y, srow_z", orientation::grid_from_ras(path, dims, axes, origin));
    }
    let mut spacing = [0.0; 3];
    for a in 0..3 {
        // A sign in pixdim means nothing; a size that the rank leaves out may be anything.
        let given = header.pixdim[a + 1].abs();
        let left_out = a as i64 >= header.dim[0] && !(given.is_finite() && given > 0.0);
        spacing[a] = unit * if left_out { 1.0 } else { given };
    }
    if header.qform_code > 0 {
        let rotation = rotation(path, header.quatern, header.pixdim[0])?;
        let origin = header.qoffset.map(|v| unit * v);
        let columns = std::array::from_fn(|a| rotation.column(a).into());
        let grid = Grid::new(dims, spacing, origin, columns);
        return name(path, "pixdim, qoffset_x", grid.map_err(|e| Error::field(path, "", e.to_string())));
    }
    name(path, "pixdim", orientation::plain_grid(path, dims, spacing))
}

/// Replaces the field of an error about a grid by the names of the format.
fn name(path: &Path, field: &str, grid: Result<Grid, Error>) -> Result<Grid, Error> {
    grid.map_err(|error| match error {
        Error::Field { problem, .. } => Error::field(path, field, problem),
        other => other,
    })
}

/// Millimetres in the header's unit of length; an unknown unit is taken as millimetres.
fn millimetres(xyzt_units: i32) -> f64 {
    match xyzt_units & 7 {
        1 => 1e3,
        3 => 1e-3,
        _ => 1.0,
    }
}

/// Rotation of a unit quaternion given by b, c, d (a ≥ 0 follows); a negative `qfac` reverses the third column.
fn rotation(path: &Path, [b, c, d]: [f64; 3], qfac: f64) -> Result<Matrix3<f64>, Error> {
    let square = b * b + c * c + d * d;
    if !square.is_finite() || square > 1.0 + 1e-3 {
        return Err(Error::field(
            path,
            "quatern_b, quatern_c, quatern_d",
            format!("({b}, {c}, {d}) is no part of a unit quaternion"),
        ));
    }
    // Single precision may leave the three a little longer than 1: then it is a half turn.
    let (a, [b, c, d]) = if 1.0 - square < 1e-7 {
        let length = square.sqrt();
        (0.0, [b / length, c / length, d / length])
    } else {
        ((1.0 - square).sqrt(), [b, c, d])
    };
    let hand = if qfac < 0.0 { -1.0 } else { 1.0 };
    Ok(Matrix3::new(
        a * a + b * b - c * c - d * d,
        2.0 * (b * c - a * d),
        hand * 2.0 * (b * d + a * c),
        2.0 * (b * c + a * d),
        a * a + c * c - b * b - d * d,
        hand * 2.0 * (c * d - a * b),
        2.0 * (b * d - a * c),
        2.0 * (c * d + a * b),
        hand * (a * a + d * d - b * b - c * c),
    ))
}

/// The quaternion's b, c, d and `qfac` of a grid with orthonormal directions; `None` where they are sheared.
pub(super) fn quaternion(grid: &Grid) -> Option<([f64; 3], f64)> {
    let mut matrix = Matrix3::from_columns(&grid.direction().map(nalgebra::Vector3::from));
    if (matrix.transpose() * matrix - Matrix3::identity()).amax() > 1e-6 {
        return None;
    }
    let hand = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    let third = matrix.column(2) * hand;
    matrix.set_column(2, &third);
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(matrix);
    let q = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
    // a is not stored: it must be the non-negative one.
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    Some(([q.i * sign, q.j * sign, q.k * sign], hand))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_of_oblique_and_left_handed_grids_come_back() {
        for (angle, hand) in [(0.0, 1.0), (0.3, 1.0), (2.9, -1.0), (std::f64::consts::PI, -1.0)] {
            let axis = nalgebra::Unit::new_normalize(nalgebra::Vector3::new(0.3, -0.9, 0.2));
            let mut m = *nalgebra::Rotation3::from_axis_angle(&axis, angle).matrix();
            let third = m.column(2) * hand;
            m.set_column(2, &third);
            let columns = std::array::from_fn(|a| m.column(a).into());
            let grid = Grid::new([2, 3, 4], [0.5, 0.7, 3.0], [1.0, 2.0, 3.0], columns).unwrap();
            let (q, qfac) = quaternion(&grid).unwrap();
            assert_eq!(qfac, hand);
            let back = rotation(Path::new("x"), q, qfac).unwrap();
            assert!((back - m).amax() < 1e-7, "{angle}: {back} {m}");
        }
    }

    #[test]
    fn a_sheared_grid_has_no_quaternion() {
        let lean = [0.1_f64.sin(), 0.0, 0.1_f64.cos()];
        let grid = Grid::new([2; 3], [1.0; 3], [0.0; 3], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], lean]).unwrap();
        assert!(quaternion(&grid).is_none());
    }

    #[test]
    fn quaternions_that_are_none_are_refused() {
        assert!(rotation(Path::new("x"), [1.0, 1.0, 0.0], 1.0).is_err());
        assert!(rotation(Path::new("x"), [f64::NAN, 0.0, 0.0], 1.0).is_err());
    }
}
