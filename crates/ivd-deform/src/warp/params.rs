use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// How values between voxels are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// The nearest voxel; half way the one with the higher index.
    Nearest,
    /// Trilinear over 8 voxels.
    #[default]
    Linear,
    /// Tricubic convolution over 64 voxels (Keys 1981, a = −1/2): interpolating, third order, may overshoot.
    Cubic,
}

/// What a warp makes of a volume.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WarpParams {
    /// How values between voxels are found; labels and masks always take the nearest.
    pub order: Order,
    /// Value [real units; for labels an id] of voxels whose origin lies outside the volume, is no data, or that a part
    /// has left. Without it the smallest real value of the volume; for labels the class with the lowest mean.
    pub background: Option<f64>,
}

impl WarpParams {
    /// # Errors
    /// Names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        match self.background {
            Some(value) if !value.is_finite() => Err(ParamError::new(
                "background",
                format!("{value} is not finite"),
                "give a number, or leave it out",
            )),
            _ => Ok(()),
        }
    }
}
