use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What two parts make.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SetOperation {
    /// What is in either.
    Union,
    /// What is in both.
    Intersection,
    /// What is in the first and not in the other.
    Difference,
}

/// A part edited: combined with another, closed, opened, freed of islands and of holes, in this order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EditParams {
    /// How the part and the other one are combined.
    pub operation: Option<SetOperation>,
    /// Gaps narrower than twice this are closed (a ball's closing).
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub close: f64,
    /// What is narrower than twice this is removed (a ball's opening).
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub open: f64,
    /// Pieces smaller than this are dropped.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm³"))]
    pub islands: f64,
    /// Whether holes inside the part become part of it. Voxels without data stay out.
    #[schemars(extend("x-alias" = ["fill"]))]
    pub fill_holes: bool,
}

impl Default for EditParams {
    fn default() -> Self {
        Self { operation: None, close: 0.0, open: 0.0, islands: 0.0, fill_holes: false }
    }
}
