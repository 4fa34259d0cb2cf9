use nalgebra::Vector3;

use crate::Error;

/// A mesh that can't be a lattice.
pub(super) fn unfit(problem: String, remedy: &str) -> Error {
    Error::Unfit { problem, remedy: remedy.to_owned() }
}

/// A place in a message (mm).
pub(super) fn place(p: &Vector3<f64>) -> String {
    format!("({:.3}, {:.3}, {:.3}) mm", p.x, p.y, p.z)
}
