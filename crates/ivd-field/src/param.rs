//! Places, directions and lengths as parameters: what they are where nothing is said, and what they may be.

use ivd_core::ParamError;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A size that no coordinate may have.
const LARGEST: f64 = 1e100;

/// The axis where none is given.
pub fn along_z() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// The part of a radius within which work is done whole, where nothing is said.
pub fn half() -> f64 {
    0.5
}

/// Whether a place or a vector is one that something may have.
///
/// # Errors
/// Names the field.
pub fn is_finite(field: &'static str, vector: &[f64; 3]) -> Result<(), ParamError> {
    if vector.iter().all(|c| c.abs() <= LARGEST) {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{vector:?}"), "give three finite numbers"))
}

/// Whether a vector points somewhere.
///
/// # Errors
/// Names the field.
pub fn is_direction(field: &'static str, vector: &[f64; 3]) -> Result<(), ParamError> {
    is_finite(field, vector)?;
    if Vector3::from(*vector).norm() >= 1e-100 {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{vector:?}"), "give a direction"))
}

/// Whether a length is one that something may have.
///
/// # Errors
/// Names the field.
pub fn is_near(field: &'static str, length: f64) -> Result<(), ParamError> {
    if length.abs() <= LARGEST {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{length} mm"), "give a length that something may have"))
}

/// Whether an edge of cells (voxels) divides a brick's.
///
/// # Errors
/// Names the field.
pub fn is_cell(field: &'static str, edge: Option<u8>) -> Result<(), ParamError> {
    match edge {
        Some(edge) if !edge.is_power_of_two() => {
            Err(ParamError::new(field, format!("{edge} voxels"), "give 1, 2 or 4, or leave it out"))
        }
        _ => Ok(()),
    }
}

/// What is done where a motion can't go the whole way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Limit {
    /// Refuse the motion, and report what fraction of it is possible.
    #[default]
    Refuse,
    /// Go as far as possible; the figures say how far.
    Stop,
}
