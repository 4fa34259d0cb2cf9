use ivd_core::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point, or a line between two, with what is near.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-short" = ["at", "label"]))]
pub struct Seed {
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
    /// Label of what it competes for; without it 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1), extend("x-unit" = "1"))]
    pub label: Option<u16>,
}

/// Seeds that compete: each takes what it reaches before the others do, along ways that avoid steep places (a watershed of the gradient).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CompeteParams {
    /// Points and lines, each with its label.
    pub seeds: Vec<Seed>,
    /// The label whose part is isolated, as a mask; without it all labels are given.
    #[schemars(range(min = 1), extend("x-unit" = "1"))]
    pub label: Option<u16>,
    /// Whether the volume's border is a seed too, of a label above all others (where 65535 has seeds, of the lowest that has none).
    pub border: bool,
    /// Least and greatest value that count; values beyond are taken for these.
    #[schemars(extend("x-unit" = "value"))]
    pub window: Option<[f64; 2]>,
    /// Leak guard: where the part is narrower than twice this it is cut, and what hangs on such a bridge stays out.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub open: f64,
    /// Whether holes inside the part become part of it. Voxels without data stay out.
    #[schemars(extend("x-alias" = ["!keep_holes"]))]
    pub fill_holes: bool,
}

impl Default for CompeteParams {
    fn default() -> Self {
        Self { seeds: Vec::new(), label: None, border: false, window: None, open: 0.0, fill_holes: true }
    }
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
        if self.label.is_none() && self.open > 0.0 {
            let problem = "a leak guard of a part, where all labels are given";
            return Err(ParamError::new("open", problem, "give the part's label, or leave it out"));
        }
        Ok(())
    }
}
