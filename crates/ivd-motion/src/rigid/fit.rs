//! The rigid motion that brings points nearest to where they should go.
//!
//! Least squares over proper rotations, by the largest eigenvalue of Horn's matrix of quaternions (1987): it is the rotation
//! of Kabsch's polar decomposition (1976, 1978), and no data, flat or mirrored, makes it a reflection. Two Newton steps on the
//! rotation bring it to the last digits.

use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// Points whose spread across their line is less than this part of that along it lie on the line: the turn about it that they
/// tell of has lost half of its digits.
const LINE: f64 = 1e-4;
/// The least curvature of the error over rotations, as a fraction of its scale: below it another rotation is as good.
const SURE: f64 = 1e-9;

/// Why no rotation is the best.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unsure {
    /// A line is turned round by half a turn: about which axis isn't said.
    HalfTurn,
    /// Where the points go is a line or a mirror image: several rotations come as near.
    Mirrored,
}

/// The axis times the angle (radians, up to π) of the proper rotation `R` for which `Σ |R xᵢ − yᵢ|²` is least; of arms `x` on
/// one line the least such rotation.
///
/// - `arms`: what is turned and where it should come (mm), from the centre of the turn.
pub(super) fn turn(arms: &[(Vector3<f64>, Vector3<f64>)]) -> Result<Vector3<f64>, Unsure> {
    let size = arms.iter().flat_map(|(x, y)| [x.amax(), y.amax()]).fold(0.0, f64::max);
    let spread: Matrix3<f64> = arms.iter().map(|(x, _)| x / size * (x / size).transpose()).sum();
    if size == 0.0 || spread.amax() == 0.0 {
        return Ok(Vector3::zeros());
    }
    let eigen = spread.symmetric_eigen();
    let main = eigen.eigenvalues.imax();
    let across = (spread.trace() - eigen.eigenvalues[main]).max(0.0);
    if across <= LINE * LINE * eigen.eigenvalues[main] {
        let line = eigen.eigenvectors.column(main).into_owned();
        return along(line, arms.iter().map(|(x, y)| y / size * (x / size).dot(&line)).sum());
    }
    // Σ y xᵀ, of which the rotation is the polar factor.
    let moved: Matrix3<f64> = arms.iter().map(|(x, y)| y / size * (x / size).transpose()).sum();
    let mut rotation = horn(&moved);
    let scale = moved.norm();
    for _ in 0..2 {
        let turned = moved * rotation.matrix().transpose();
        let curvature = Matrix3::identity() * turned.trace() - (turned + turned.transpose()) / 2.0;
        let least = curvature.symmetric_eigenvalues().min();
        if least <= SURE * scale || scale == 0.0 {
            return Err(Unsure::Mirrored);
        }
        let skew = turned - turned.transpose();
        let slope = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
        let Some(step) = curvature.try_inverse().map(|inverse| inverse * slope) else {
            return Err(Unsure::Mirrored);
        };
        rotation = Rotation3::new(step) * rotation;
    }
    Ok(scaled_axis(&rotation))
}

/// The least rotation that brings a line's direction to another (of any length).
fn along(from: Vector3<f64>, to: Vector3<f64>) -> Result<Vector3<f64>, Unsure> {
    if to.norm() <= SURE {
        return Ok(Vector3::zeros());
    }
    let to = to.normalize();
    let across = from.cross(&to);
    let (sine, cosine) = (across.norm(), from.dot(&to));
    if sine <= SURE && cosine < 0.0 {
        return Err(Unsure::HalfTurn);
    }
    Ok(if sine == 0.0 { Vector3::zeros() } else { across * (sine.atan2(cosine) / sine) })
}

/// Horn's closed form, to some digits.
fn horn(m: &Matrix3<f64>) -> Rotation3<f64> {
    // m = Σ y xᵀ; Horn's S is its transpose.
    let s = m.transpose();
    let n = Matrix4::new(
        s[(0, 0)] + s[(1, 1)] + s[(2, 2)],
        s[(1, 2)] - s[(2, 1)],
        s[(2, 0)] - s[(0, 2)],
        s[(0, 1)] - s[(1, 0)],
        s[(1, 2)] - s[(2, 1)],
        s[(0, 0)] - s[(1, 1)] - s[(2, 2)],
        s[(0, 1)] + s[(1, 0)],
        s[(2, 0)] + s[(0, 2)],
        s[(2, 0)] - s[(0, 2)],
        s[(0, 1)] + s[(1, 0)],
        s[(1, 1)] - s[(0, 0)] - s[(2, 2)],
        s[(1, 2)] + s[(2, 1)],
        s[(0, 1)] - s[(1, 0)],
        s[(2, 0)] + s[(0, 2)],
        s[(1, 2)] + s[(2, 1)],
        s[(2, 2)] - s[(0, 0)] - s[(1, 1)],
    );
    let eigen = n.symmetric_eigen();
    let q = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])).to_rotation_matrix()
}

fn scaled_axis(rotation: &Rotation3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(rotation).scaled_axis()
}
