use ivd_core::ParamError;
use ivd_core::op::check_fields;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a lattice is refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
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
    /// Marching cubes at a coarser rate; only of a lattice as extracted.
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// Levels below the input: level `L` keeps 4⁻ᴸ of the vertices; 0 keeps all. Parts that can't get so small keep a tetrahedron each, and
    /// the others don't make up for them.
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

/// A [`Target`] as it is asked for: at most one of these is given.
///
/// Two that ask for the same are equal, whether they say so or leave it to the default.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct TargetKeys {
    /// Levels below the input, each of which keeps about a quarter of the vertices: level L keeps 4⁻ᴸ of them. Small components
    /// keep four vertices each; collapse and decimation don't remove more elsewhere to make up for it. 2 where no target is given.
    #[schemars(extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub level: Option<u8>,
    /// Keep this share of the triangles.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub ratio: Option<f64>,
    /// Keep this many triangles.
    #[schemars(extend("x-unit" = "triangles", "x-knob" = "accuracy"))]
    pub count: Option<usize>,
    /// Keep as few as stay within this distance of the input, both ways.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm", "x-knob" = "accuracy"))]
    pub max_error: Option<f64>,
}

impl PartialEq for TargetKeys {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl From<Target> for TargetKeys {
    fn from(target: Target) -> Self {
        let none = Self::default();
        match target {
            Target::Level(level) => Self { level: Some(level), ..none },
            Target::Ratio(ratio) => Self { ratio: Some(ratio), ..none },
            Target::Count(count) => Self { count: Some(count), ..none },
            Target::MaxError(mm) => Self { max_error: Some(mm), ..none },
        }
    }
}

impl TargetKeys {
    /// The target: what is given, else the default. Of several the first.
    pub fn get(self) -> Target {
        let level = self.level.map(Target::Level);
        let ratio = || self.ratio.map(Target::Ratio);
        let count = || self.count.map(Target::Count);
        let max_error = || self.max_error.map(Target::MaxError);
        level.or_else(ratio).or_else(count).or_else(max_error).unwrap_or_default()
    }

    /// Whether one is given.
    pub(super) fn is_given(self) -> bool {
        self.level.is_some() || self.ratio.is_some() || self.count.is_some() || self.max_error.is_some()
    }

    /// At most one is given.
    pub(super) fn check(self) -> Result<(), ParamError> {
        let given = [
            ("level", self.level.is_some()),
            ("ratio", self.ratio.is_some()),
            ("count", self.count.is_some()),
            ("max_error", self.max_error.is_some()),
        ];
        let given: Vec<&str> =
            given.into_iter().filter(|(_, is_given)| *is_given).map(|(name, _)| name).collect();
        match given[..] {
            [first, second, ..] => Err(ParamError::new(
                second,
                format!("given together with {first}"),
                "give one of level, ratio, count and max_error, not several",
            )),
            _ => Ok(()),
        }
    }
}

/// Parameters of [`refine`](super::refine). What a method has no use for it passes over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RefineParams {
    /// How vertices are chosen.
    pub method: Method,
    /// How far to go.
    #[serde(flatten)]
    pub target: TargetKeys,
    /// Largest angle by which one collapse may turn a triangle.
    #[schemars(extend("x-unit" = "degrees", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 180.0))]
    pub max_turn_degrees: f64,
    /// Weight of the squared length of a collapse against its squared distance from the planes it leaves.
    /// A little of it keeps triangles from growing thin where the surface is flat; much of it costs accuracy.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub shape_weight: f64,
    /// Whether collapse, where nothing else can go, may pinch the surface: tunnels and handles close, and the
    /// result need not be a manifold where they did. Merge is then clustering: whatever lies in one cube becomes one
    /// vertex. The other methods ignore this.
    pub allow_topology: bool,
    /// Edges where the surface turns by more than this (between the normals of the two triangles) are features: a vertex where two
    /// of them meet moves only along them; where one ends, or more than two meet, it stays. Without it there are no features. Collapse,
    /// decimation and legal merges heed it; clustering, sampling and the exact inverse of a subdivision don't.
    #[schemars(extend("x-unit" = "degrees", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 180.0))]
    pub feature_degrees: Option<f64>,
    /// No edge is made that is longer: without it flat parts are left with few vertices, where a handle may find none near, and between which nothing bends.
    /// Collapse, decimation and legal merges heed it; clustering, sampling and the exact inverse of a subdivision don't.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub max_edge: Option<f64>,
}

impl Default for RefineParams {
    fn default() -> Self {
        Self {
            method: Method::Collapse,
            target: TargetKeys::default(),
            max_turn_degrees: 75.0,
            shape_weight: 1e-4,
            allow_topology: false,
            feature_degrees: None,
            max_edge: None,
        }
    }
}

impl RefineParams {
    /// Checks every field's domain.
    ///
    /// # Errors
    /// [`ParamError`] names the first field outside its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.target.check()
    }
}
