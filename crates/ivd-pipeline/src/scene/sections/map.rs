use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Interpolation of a warp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WarpOrder {
    /// The nearest voxel.
    Nearest,
    /// Trilinear.
    #[default]
    Linear,
    /// Tricubic.
    Cubic,
}

/// `[warp]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WarpSection {
    /// Interpolation.
    pub order: WarpOrder,
    /// Real value of what comes from outside the volume.
    pub background: Option<f64>,
}
