use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How values between voxels are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// The nearest voxel; halfway between two, the one with the higher index.
    Nearest,
    /// Trilinear over 8 voxels.
    #[default]
    Linear,
    /// Tricubic convolution over 64 voxels (Keys 1981, a = −1/2): interpolating, third order, may overshoot.
    Cubic,
}

/// What a warp makes of a volume.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct WarpParams {
    /// How values between voxels are found; labels and masks always take the nearest.
    #[schemars(extend("x-knob" = "accuracy"))]
    pub order: Order,
    /// Real value (for labels an id) of voxels that come from outside the volume or from missing data, or that a part has moved away from. Without it
    /// the smallest real value of the volume; for labels 0 where at least a hundredth of them is 0, else the class with the lowest mean.
    #[schemars(extend("x-unit" = "real units"))]
    pub background: Option<f64>,
}
