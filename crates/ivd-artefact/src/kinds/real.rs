use ivd_core::{Grid, Reference};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::Problem;

/// A real number in JSON: a number where it is finite, else `"inf"` or `"-inf"`. NaN can't be written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Real(pub(crate) f64);

impl Serialize for Real {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            v if v.is_finite() => serializer.serialize_f64(v),
            f64::INFINITY => serializer.serialize_str("inf"),
            f64::NEG_INFINITY => serializer.serialize_str("-inf"),
            _ => Err(serde::ser::Error::custom("a number beside its sections is NaN")),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Stored {
    Number(f64),
    Word(String),
}

impl<'de> Deserialize<'de> for Real {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Stored::deserialize(deserializer)? {
            Stored::Number(v) => Ok(Self(v)),
            Stored::Word(word) if word == "inf" => Ok(Self(f64::INFINITY)),
            Stored::Word(word) if word == "-inf" => Ok(Self(f64::NEG_INFINITY)),
            Stored::Word(word) => Err(serde::de::Error::custom(format!("`{word}` is no number"))),
        }
    }
}

/// A grid in JSON, unchecked.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GridContent {
    dims: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    direction: [[f64; 3]; 3],
    /// Written only where world space isn't known to be the patient's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    in_patient: Option<bool>,
    /// Written only where more is known than that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reference: Option<Reference>,
}

impl From<&Grid> for GridContent {
    fn from(grid: &Grid) -> Self {
        let (in_patient, reference) = grid.reference().written();
        Self {
            dims: grid.dims(),
            spacing: grid.spacing(),
            origin: grid.origin(),
            direction: grid.direction(),
            in_patient,
            reference,
        }
    }
}

impl GridContent {
    /// The grid, checked.
    pub(crate) fn grid(&self) -> Result<Grid, Problem> {
        let grid = Grid::new(self.dims, self.spacing, self.origin, self.direction)?;
        Ok(grid.with_reference(Reference::of_written(self.in_patient, self.reference)))
    }
}

/// Shape of one value a voxel, slowest axis first.
pub(crate) fn voxel_shape(dims: [usize; 3]) -> Vec<u64> {
    dims.iter().rev().map(|&n| n as u64).collect()
}
