use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// In what space the components live, and which covariances they may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Covariance {
    /// On intensity alone: one variance a component.
    #[default]
    Intensity,
    /// Over x, y, z (mm along the axes of the grid) and intensity, axes independent of each other: four variances. The grid's
    /// axes count as perpendicular, also those of a sheared grid.
    Diagonal,
    /// Over x, y, z (mm along the axes of the grid) and intensity, any covariance: ten numbers. Sheared axes are measured
    /// likewise.
    Full,
}

impl Covariance {
    /// Number of dimensions.
    pub(super) fn dimensions(self) -> usize {
        if self == Self::Intensity { 1 } else { 4 }
    }

    /// Free parameters of a mixture of `k` components.
    pub(super) fn free(self, k: usize) -> usize {
        let each = match self {
            Self::Intensity => 3,
            Self::Diagonal => 9,
            Self::Full => 15,
        };
        each * k - 1
    }

    /// Numbers that a covariance is written with.
    pub(super) fn numbers(self) -> usize {
        match self {
            Self::Intensity => 1,
            Self::Diagonal => 4,
            Self::Full => 16,
        }
    }
}
