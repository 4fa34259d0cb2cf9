use ivd_core::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point, or a line between two, with what is near.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// A point (RAS).
    #[schemars(extend("x-unit" = "mm"))]
    pub at: [f64; 3],
    /// Where a line from there ends (RAS); without it the point alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub to: Option<[f64; 3]>,
    /// What is as near as this belongs to it too; without it the voxels that it goes through.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub radius: Option<f64>,
}

/// Seeds that compete: each takes what it reaches before the others do, along ways that avoid steep places (a watershed of the gradient).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CompeteParams {
    /// Strokes in the part.
    pub own: Vec<Stroke>,
    /// Strokes in what isn't the part.
    pub other: Vec<Stroke>,
    /// Number of the part in the drawn strokes, of which each number above 0 competes; without it 1.
    #[schemars(range(min = 1), extend("x-unit" = "1"))]
    pub label: Option<u16>,
    /// Whether the volume's border is a seed of what isn't the part.
    pub border: bool,
    /// Least and greatest value that count: steps beyond are none.
    #[schemars(extend("x-unit" = "value"))]
    pub window: Option<[f64; 2]>,
    /// Leak guard: where the part is narrower than twice this it is cut, and what hangs on such a bridge stays out.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub open: f64,
    /// Whether the part's holes stay. Voxels without data stay out.
    pub keep_holes: bool,
}

impl CompeteParams {
    /// Conditions on several fields.
    ///
    /// # Errors
    /// Names the field.
    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        if let Some([low, high]) = self.window
            && low >= high
        {
            let problem = format!("{low} … {high} holds no values");
            return Err(ParamError::new("window", problem, "give the lower value first"));
        }
        Ok(())
    }
}
