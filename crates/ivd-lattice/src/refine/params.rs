use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// How a lattice is refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Half-edge collapse in the order of quadric error.
    #[default]
    Collapse,
    /// Vertex removal in the order of distance to the average plane (Schroeder, Zarge & Lorensen 1992).
    Decimate,
    /// Loop subdivision backwards.
    Loop,
    /// Vertex clustering onto a member vertex.
    Merge,
    /// Marching cubes at a coarser rate.
    Sample,
}

impl Method {
    /// The name in files, lowercase.
    pub fn name(self) -> &'static str {
        match self {
            Self::Collapse => "collapse",
            Self::Decimate => "decimate",
            Self::Loop => "loop",
            Self::Merge => "merge",
            Self::Sample => "sample",
        }
    }
}

/// How far a lattice is refined.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Levels below the input: level `L` keeps 4⁻ᴸ of the vertices; 0 keeps all.
    Level(u8),
    /// Share of the input's triangles to keep, 0…1.
    Ratio(f64),
    /// Number of triangles to keep.
    Count(usize),
    /// As few as keep [`Refined::max_error_mm`](super::Refined::max_error_mm) within this bound (mm), ≥ 0.
    MaxError(f64),
}

impl Target {
    /// Most vertices to remove from a closed surface and the largest bound allowed (mm).
    pub(super) fn removals(self, vertices: usize, triangles: usize) -> (usize, f64) {
        // Each vertex removed takes two triangles with it.
        let down_to = |keep: usize| (triangles.saturating_sub(keep) / 2, f64::INFINITY);
        match self {
            Self::Level(level) => {
                let keep = (vertices as f64 * 0.25_f64.powi(i32::from(level))).round() as usize;
                (vertices - keep, f64::INFINITY)
            }
            Self::Ratio(ratio) => down_to((triangles as f64 * ratio).round() as usize),
            Self::Count(keep) => down_to(keep),
            Self::MaxError(mm) => (usize::MAX, mm),
        }
    }
}

impl Default for Target {
    fn default() -> Self {
        Self::Level(2)
    }
}

/// Parameters of [`refine`](super::refine). What a method has no use for it passes over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefineParams {
    /// How vertices are chosen.
    pub method: Method,
    /// How far to go.
    pub target: Target,
    /// Most that one collapse may turn a triangle (degrees), above 0 and below 180.
    pub max_turn_degrees: f64,
    /// Weight of the squared length of a collapse against its squared distance from the planes it leaves; ≥ 0, no unit.
    /// A little of it keeps triangles from growing thin where the surface is flat; much of it costs accuracy.
    pub shape_weight: f64,
    /// Whether [`Method::Collapse`], where nothing else can go, may pinch the surface: tunnels and handles close, and the
    /// result need not be a manifold where they did. [`Method::Merge`] is then clustering: whatever lies in one cube becomes one
    /// vertex. The others pass over it.
    pub allow_topology: bool,
    /// Edges where the surface turns by more than this (degrees between the normals of the two triangles; above 0, below
    /// 180) are features: a vertex between two of them goes along them alone, and where one or more than two
    /// meet, it stays. `None`: there are no features. Collapse, decimation and legal merges heed it; clustering, sampling and
    /// the exact inverse of a subdivision don't.
    pub feature_degrees: Option<f64>,
}

impl Default for RefineParams {
    fn default() -> Self {
        Self {
            method: Method::Collapse,
            target: Target::default(),
            max_turn_degrees: 75.0,
            shape_weight: 1e-4,
            allow_topology: false,
            feature_degrees: None,
        }
    }
}

impl RefineParams {
    /// Checks every field's domain.
    ///
    /// # Errors
    /// [`ParamError`] names the first field outside its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        match self.target {
            Target::Level(_) | Target::Count(_) => {}
            Target::Ratio(ratio) if (0.0..=1.0).contains(&ratio) => {}
            Target::Ratio(ratio) => {
                return Err(ParamError::new(
                    "ratio",
                    format!("{ratio} of the triangles"),
                    "give a number from 0 to 1",
                ));
            }
            Target::MaxError(mm) if mm.is_finite() && mm >= 0.0 => {}
            Target::MaxError(mm) => {
                return Err(ParamError::new(
                    "max_error",
                    format!("{mm} mm"),
                    "give a length of 0 mm or more",
                ));
            }
        }
        if !(self.max_turn_degrees > 0.0 && self.max_turn_degrees < 180.0) {
            return Err(ParamError::new(
                "max_turn_degrees",
                format!("{} degrees", self.max_turn_degrees),
                "give an angle above 0 and below 180 degrees",
            ));
        }
        if !(self.shape_weight.is_finite() && self.shape_weight >= 0.0) {
            return Err(ParamError::new("shape_weight", format!("{}", self.shape_weight), "give 0 or more"));
        }
        if let Some(degrees) = self.feature_degrees
            && !(degrees > 0.0 && degrees < 180.0)
        {
            return Err(ParamError::new(
                "feature_degrees",
                format!("{degrees} degrees"),
                "give an angle above 0 and below 180 degrees, or none",
            ));
        }
        Ok(())
    }
}
