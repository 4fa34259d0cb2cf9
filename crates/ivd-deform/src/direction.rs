//! Places and directions as parameters.

use ivd_core::ParamError;
use nalgebra::Vector3;

/// A size that no coordinate may have.
const LARGEST: f64 = 1e100;

/// The axis where none is given.
pub(crate) fn along_z() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// The part of a radius within which work is done whole, where nothing is said.
pub(crate) fn half() -> f64 {
    0.5
}

/// # Errors
/// Names the field.
pub(crate) fn is_finite(field: &'static str, vector: &[f64; 3]) -> Result<(), ParamError> {
    if vector.iter().all(|c| c.abs() <= LARGEST) {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{vector:?}"), "give three finite numbers"))
}

/// # Errors
/// Names the field.
pub(crate) fn is_direction(field: &'static str, vector: &[f64; 3]) -> Result<(), ParamError> {
    is_finite(field, vector)?;
    if Vector3::from(*vector).norm() >= 1e-100 {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{vector:?}"), "give a direction"))
}

/// # Errors
/// Names the field.
pub(crate) fn is_near(field: &'static str, length: f64) -> Result<(), ParamError> {
    if length.abs() <= LARGEST {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{length} mm"), "give a length that something may have"))
}
