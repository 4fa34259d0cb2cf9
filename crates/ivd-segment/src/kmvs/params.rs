use ivd_core::ParamError;
use ivd_core::op::check_fields;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Within;

/// k-means: on intensity alone globally optimal, with a spatial weight on place and intensity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct KmvsParams {
    /// Number of classes. A volume with fewer distinct values gets as many classes as values.
    #[schemars(range(min = 1, max = 1024), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub k: usize,
    /// How much of the value a distance counts for; 0 for intensity alone, and then the result is the global optimum. The axes of
    /// a sheared grid are measured as perpendicular.
    #[schemars(range(min = 0.0, max = 1e100), extend("x-unit" = "real units/mm"))]
    pub spatial_weight: f64,
    /// Seed of the start centroids with a spatial weight.
    #[schemars(extend("x-unit" = "1"))]
    pub seed: u64,
    /// Most iterations with a spatial weight (Lloyd's algorithm).
    #[schemars(range(min = 1), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub max_iterations: u64,
    /// Relative fall of the inertia in one iteration at which to stop with a spatial weight; 0 until no label changes.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub tolerance: f64,
    /// Which values count.
    #[serde(flatten)]
    pub within: Within,
    /// Start centroids, `[x, y, z, value]` (mm from the first voxel along the grid's axes; real units), shape `[k]`, instead of
    /// drawn ones. For comparisons; no key of a scene.
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub start: Option<Vec<[f64; 4]>>,
}

impl Default for KmvsParams {
    fn default() -> Self {
        Self {
            k: 4,
            spatial_weight: 0.0,
            seed: 1,
            max_iterations: 300,
            tolerance: 0.0,
            within: Within::default(),
            start: None,
        }
    }
}

impl KmvsParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        check_start(self.start.as_deref(), self.k)?;
        self.within.check()
    }

    /// k-means on intensity alone reads nothing that ends iterations.
    pub(crate) fn check_read(&self) -> Result<(), ParamError> {
        let plain = Self::default();
        let unread = [
            ("max_iterations", self.max_iterations.to_string(), self.max_iterations != plain.max_iterations),
            ("tolerance", self.tolerance.to_string(), self.tolerance != plain.tolerance),
        ];
        match unread.into_iter().find(|(_, _, is_given)| *is_given && self.spatial_weight == 0.0) {
            Some((field, value, _)) => Err(ParamError::new(
                field,
                format!("{value}, but kmvs on intensity alone doesn't iterate"),
                "give spatial_weight too, or leave it out",
            )),
            None => Ok(()),
        }
    }
}

/// Whether a start is `k` finite centroids of a size whose square is a number.
fn check_start(start: Option<&[[f64; 4]]>, k: usize) -> Result<(), ParamError> {
    let Some(start) = start else { return Ok(()) };
    if start.len() != k {
        return Err(ParamError::new("start", format!("{} centroids", start.len()), format!("give k = {k}")));
    }
    match start.iter().flatten().find(|v| v.is_nan() || v.abs() > LARGEST) {
        Some(v) => Err(ParamError::new("start", format!("{v}"), format!("use -{LARGEST}…{LARGEST}"))),
        None => Ok(()),
    }
}

/// Largest coordinate of a start, as of the spatial weight.
const LARGEST: f64 = 1e100;
