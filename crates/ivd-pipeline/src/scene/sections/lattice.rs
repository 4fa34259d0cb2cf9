use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the lattice is cut: a value, or the word "boundary".
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum IsoChoice {
    /// A real value; inside is above.
    Value(f64),
    /// The class's crossings with its neighbours in intensity.
    Word(IsoWord),
}

/// The word for [`IsoChoice`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum IsoWord {
    /// The class's crossings.
    Boundary,
}

impl std::str::FromStr for IsoChoice {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "boundary" => Ok(Self::Word(IsoWord::Boundary)),
            _ => text.parse().map(Self::Value).map_err(|_| format!("`{text}`: a value, or `boundary`")),
        }
    }
}

/// `[lattice]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LatticeSection {
    /// Isovalue, or "boundary".
    pub iso: IsoChoice,
}

impl Default for LatticeSection {
    fn default() -> Self {
        Self { iso: IsoChoice::Word(IsoWord::Boundary) }
    }
}

/// How a lattice is simplified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RefineMethod {
    /// Half-edge collapse by quadrics.
    #[default]
    Collapse,
    /// Vertex removal by distance to the average plane.
    Decimate,
    /// Subdivision after Loop, backwards.
    Loop,
    /// Vertex clustering onto a member.
    Merge,
    /// Marching cubes at a coarser rate; only of a lattice as extracted.
    Sample,
}

/// `[refine]`: one of level, ratio, count or max_error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RefineSection {
    /// Method.
    pub method: RefineMethod,
    /// Keep about 4⁻ᴸ of the vertices; 2 where nothing is said.
    pub level: Option<u8>,
    /// Keep this share of the triangles.
    pub ratio: Option<f64>,
    /// Keep this many triangles.
    pub count: Option<usize>,
    /// Keep the surface within this distance (mm).
    pub max_error: Option<f64>,
    /// Most that one collapse may turn a triangle (degrees), above 0 and below 180.
    pub max_turn_degrees: f64,
    /// Weight of a collapse's length against its distance from the planes that it leaves, ≥ 0.
    pub shape_weight: f64,
    /// Whether handles and tunnels may close where nothing else can go; the result need not be a manifold there.
    pub allow_topology: bool,
    /// Edges where the surface turns by more than this are kept (degrees, above 0, below 180).
    pub feature_degrees: Option<f64>,
    /// Places whose vertices stay.
    pub lock: Vec<FixSection>,
    /// Components of fewer triangles go before anything else; 0 keeps all.
    pub min_component: u64,
    /// Levels to keep beside the lattice itself, ascending, in place of one target: each from the one before.
    pub chain: Vec<u8>,
}

impl Default for RefineSection {
    fn default() -> Self {
        let params = ivd_lattice::refine::RefineParams::default();
        Self {
            method: RefineMethod::Collapse,
            level: None,
            ratio: None,
            count: None,
            max_error: None,
            max_turn_degrees: params.max_turn_degrees,
            shape_weight: params.shape_weight,
            allow_topology: params.allow_topology,
            feature_degrees: params.feature_degrees,
            lock: Vec::new(),
            min_component: 0,
            chain: Vec::new(),
        }
    }
}

/// A place: vertices within a ball.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixSection {
    /// Centre (mm), RAS.
    pub pick: [f64; 3],
    /// Radius (mm).
    pub radius: f64,
}
