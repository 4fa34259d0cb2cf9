use ivd_core::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An axis of the volume's voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SliceAxis {
    /// Slices of constant first voxel coordinate.
    X,
    /// Slices of constant second voxel coordinate.
    Y,
    /// Slices of constant third voxel coordinate.
    #[default]
    Z,
}

/// What a contour's energy is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ContourEnergy {
    /// Distances from the means inside and outside, and the length: the surface's energy on a slice.
    #[default]
    Region,
    /// Stretch and bend of the curve, and steepness under it (Kass, Witkin & Terzopoulos 1988; thesis, equation 4.11): it finds edges near
    /// which it starts.
    Edge,
    /// The thesis's equations 4.12 to 4.14 as they stand: they have no minimum at a boundary, and the contour collapses. For demonstration.
    Literal,
}

/// A contour on one slice, from a circle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ContourParams {
    /// The axis that the slice is perpendicular to.
    pub axis: SliceAxis,
    /// Number of the slice, from 0; without it that of the seed, else the middle one.
    #[schemars(extend("x-unit" = "voxels"))]
    pub slice: Option<u32>,
    /// A point (RAS): middle of the circle. Without it the middle of the slice.
    #[schemars(extend("x-unit" = "mm"))]
    pub seed: Option<[f64; 3]>,
    /// Radius of the circle; without it a fifth of the slice's shorter side.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: Option<f64>,
    /// What the energy is made of.
    pub energy: ContourEnergy,
    /// Weight φ of smoothness against fit, as of a surface; without it chosen by noise and contrast, and one half for literal.
    #[schemars(range(min = 1e-6, max = 0.999_999), extend("x-unit" = "1"))]
    pub phi: Option<f64>,
    /// Weight of stretching, for the energy `edge`; without it 0.02.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1"))]
    pub stretch: Option<f64>,
    /// Weight of bending, for the energy `edge`; without it 0.05.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1"))]
    pub bend: Option<f64>,
    /// Standard deviation of the Gaussian that smooths the slice, for the energy `edge`; without it 2.
    #[schemars(range(min = 0.5, max = 50.0), extend("x-unit" = "voxels"))]
    pub scale: Option<f64>,
    /// Most iterations.
    #[schemars(range(min = 1, max = 100_000), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub iterations: u32,
}

impl Default for ContourParams {
    fn default() -> Self {
        Self {
            axis: SliceAxis::Z,
            slice: None,
            seed: None,
            radius: None,
            energy: ContourEnergy::Region,
            phi: None,
            stretch: None,
            bend: None,
            scale: None,
            iterations: 500,
        }
    }
}

impl ContourParams {
    /// Conditions on several fields.
    ///
    /// # Errors
    /// Names the field.
    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        if self.phi.is_some() && self.energy == ContourEnergy::Edge {
            let problem = "given for an energy that weighs stretch and bend";
            return Err(ParamError::new("phi", problem, "leave it out, or give stretch and bend"));
        }
        let of_edge = [("stretch", self.stretch), ("bend", self.bend), ("scale", self.scale)];
        if self.energy != ContourEnergy::Edge
            && let Some((field, _)) = of_edge.into_iter().find(|(_, value)| value.is_some())
        {
            let problem = "given for an energy that has no curve";
            return Err(ParamError::new(field, problem, "leave it out, or give energy = edge"));
        }
        Ok(())
    }
}
