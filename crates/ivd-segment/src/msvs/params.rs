use ivd_core::ParamError;
use ivd_core::op::check_fields;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Within;

/// How a datum's weight falls with its distance from the point that moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// `exp(-d² / 2)`, with `d` the distance in bandwidths.
    #[default]
    Gaussian,
    /// 1 up to a distance of one bandwidth, 0 beyond. The density that such a mean climbs is that of its shadow kernel
    /// (Cheng 1995), `1 - d²` up to one bandwidth.
    Flat,
}

/// Mean shift: the modes of the density.
// The distance of two voxels in bandwidths is `d² = |x - x'|² / spatial_bandwidth² + (v - v')² / range_bandwidth²`, with `x` the
// voxel's index times the spacing (mm): the axes of a sheared grid are measured as perpendicular.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MsvsParams {
    /// Window in value; 0 to find it from the data.
    #[schemars(range(min = 0.0), extend("x-unit" = "real units"))]
    pub range_bandwidth: f64,
    /// Window in space. 0 looks at values alone: a class is then a material, wherever it lies. With a window in space a class is a
    /// blob of a material: two blobs of one value are two classes, and a large homogeneous part falls into several. Less than a
    /// thousandth of a voxel's shortest edge is refused. The axes of a sheared grid are measured as perpendicular.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub spatial_bandwidth: f64,
    /// Shape of the window.
    pub kernel: Kernel,
    /// A mode is given up to its neighbour where its density exceeds that of the saddle between them by no more than this
    /// fraction, or by no more than chance would (three standard deviations of a count). 0 keeps every mode
    /// that stands out by more than the density's own error, 0.5 % of it where places count.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub persistence: f64,
    /// Most modes kept: those that stand highest above their saddles.
    #[schemars(range(min = 1, max = 1024), extend("x-unit" = "1"))]
    pub k_max: usize,
    /// Cells across one window: more are more accurate; with a window in space the cost grows with the fourth power
    /// of this. Values alone get four times as many, at little cost.
    #[schemars(range(min = 1.0, max = 32.0), extend("x-unit" = "1"))]
    pub cells_per_bandwidth: f64,
    /// Which values count.
    #[serde(flatten)]
    pub within: Within,
}

impl Default for MsvsParams {
    fn default() -> Self {
        Self {
            range_bandwidth: 0.0,
            spatial_bandwidth: 0.0,
            kernel: Kernel::default(),
            persistence: 0.05,
            k_max: 64,
            cells_per_bandwidth: 4.0,
            within: Within::default(),
        }
    }
}

impl MsvsParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.within.check()
    }
}
