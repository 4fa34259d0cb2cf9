use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// Which surface to cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Iso {
    /// The surface at this real value; inside is at or above it.
    Value(f64),
    /// The surface around the real values in `lower ≤ v < upper`, the zero set of `min(v − lower, upper − v)`; a
    /// missing end is open.
    Interval {
        /// Least real value inside.
        lower: Option<f64>,
        /// Least real value above the inside.
        upper: Option<f64>,
    },
    /// The border of the mask: where its level function is 0, if it has one, else halfway between its voxels.
    Mask,
}

/// What to extract.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExtractParams {
    /// The surface [real values of the volume].
    pub iso: Iso,
}

impl Default for ExtractParams {
    /// The border of the mask, which needs no value.
    fn default() -> Self {
        Self { iso: Iso::Mask }
    }
}

impl ExtractParams {
    /// Checks that the values are finite and ordered.
    ///
    /// # Errors
    /// [`ParamError`] names `iso` and what is wrong with it.
    pub fn check(&self) -> Result<(), ParamError> {
        let bad = |problem: String, remedy: &str| Err(ParamError::new("iso", problem, remedy));
        match self.iso {
            Iso::Value(value) if !value.is_finite() => {
                bad(format!("{value} is not finite"), "give a real value")
            }
            Iso::Interval { lower: None, upper: None } => {
                bad("an interval open at both ends has no surface".into(), "give `lower`, `upper` or both")
            }
            Iso::Interval { lower, upper } => {
                match [lower, upper].into_iter().flatten().find(|v| !v.is_finite()) {
                    Some(value) => bad(format!("{value} is not finite"), "leave out an end that is open"),
                    None => match (lower, upper) {
                        (Some(l), Some(u)) if l >= u => {
                            bad(format!("interval {l} to {u} is empty"), "give `lower` below `upper`")
                        }
                        _ => Ok(()),
                    },
                }
            }
            Iso::Value(_) | Iso::Mask => Ok(()),
        }
    }
}
