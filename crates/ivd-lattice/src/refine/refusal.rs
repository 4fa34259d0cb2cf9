//! What keeps vertices, and what a refinement ends with.

use std::fmt;
use std::ops::Add;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Why a collapse is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Refusal {
    /// It would pinch the surface: the two ends have more neighbours in common than their two triangles.
    Link,
    /// It would turn a triangle too far or leave one without area.
    Flip,
    /// It would double a feature edge.
    Feature,
    /// It would make a component vanish: a tetrahedron is the least.
    Speck,
    /// It would make an edge that is longer than any may be.
    Edge,
    /// The bound (mm), which this would be, would exceed the limit.
    Bound(f32),
}

/// What ended a refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The level or ratio asked for was reached.
    Target,
    /// No vertex can go within the error asked for.
    MaxError,
    /// Most of what is left would pinch the surface: handles and thin necks.
    Links,
    /// Most of what is left would turn triangles over.
    Flips,
    /// Most of what is left are components of four vertices.
    Specks,
    /// Most of what is left is locked by the caller, lies on borders or where the input isn't a manifold.
    Locks,
    /// Most of what is left are corners and the least that feature edges need.
    Features,
    /// Most of what is left would make edges longer than any may be.
    Edges,
    /// Coarser by a step, nothing would be left.
    Vanishing,
}

impl StopReason {
    /// Why a target wasn't reached, for a person; `None` where it was.
    pub fn why(self) -> Option<&'static str> {
        Some(match self {
            Self::Target | Self::MaxError => return None,
            Self::Links => "taking more would pinch the surface shut at handles and thin necks",
            Self::Flips => "taking more would turn triangles over",
            Self::Specks => {
                "most of what is left are specks: closed parts of four vertices, the fewest that there can be, and none is taken away whole"
            }
            Self::Locks => {
                "most of what is left is locked, lies on borders or where the input isn't a manifold"
            }
            Self::Features => "most of what is left are corners and feature edges",
            Self::Edges => "taking more would make edges longer than max_edge",
            Self::Vanishing => "coarser by a step, nothing would be left",
        })
    }

    /// The key that helps, where there is one.
    pub fn remedy(self) -> Option<&'static str> {
        match self {
            Self::Links => Some("allow_topology lets them go"),
            Self::Specks => Some("min_part of lattice leaves small parts out before"),
            Self::Features => Some("a larger feature_degrees keeps fewer"),
            Self::Edges => Some("a larger max_edge keeps fewer"),
            Self::Target | Self::MaxError | Self::Flips | Self::Locks | Self::Vanishing => None,
        }
    }
}

impl fmt::Display for StopReason {
    /// The word that JSON has for it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// Vertices left, counted by what kept them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Refused {
    /// Vertices whose every collapse would pinch the surface.
    #[schemars(extend("x-unit" = "vertices"))]
    pub links: u64,
    /// Vertices whose every collapse would turn a triangle over.
    #[schemars(extend("x-unit" = "vertices"))]
    pub flips: u64,
    /// Vertices of components that are tetrahedra.
    #[schemars(extend("x-unit" = "vertices"))]
    pub specks: u64,
    /// Vertices that the caller locked, and those whose triangles aren't one closed fan.
    #[schemars(extend("x-unit" = "vertices"))]
    pub locks: u64,
    /// Vertices in which one feature edge ends or more than two meet, and those that no feature edge can spare.
    #[schemars(extend("x-unit" = "vertices"))]
    pub features: u64,
    /// Vertices whose every collapse would make an edge longer than any may be.
    #[schemars(extend("x-unit" = "vertices"))]
    #[serde(default)]
    pub edges: u64,
    /// Vertices whose every collapse would exceed the error asked for.
    #[schemars(extend("x-unit" = "vertices"))]
    pub max_error: u64,
}

impl Refused {
    /// Counts a vertex.
    pub(super) fn count(&mut self, refusal: Refusal) {
        *match refusal {
            Refusal::Link => &mut self.links,
            Refusal::Flip => &mut self.flips,
            Refusal::Speck => &mut self.specks,
            Refusal::Feature => &mut self.features,
            Refusal::Edge => &mut self.edges,
            Refusal::Bound(_) => &mut self.max_error,
        } += 1;
    }

    /// The most frequent reason; the first of equals.
    pub(super) fn reason(&self) -> StopReason {
        let counts = [
            (self.max_error, StopReason::MaxError),
            (self.specks, StopReason::Specks),
            (self.links, StopReason::Links),
            (self.flips, StopReason::Flips),
            (self.locks, StopReason::Locks),
            (self.features, StopReason::Features),
            (self.edges, StopReason::Edges),
        ];
        let most = counts.iter().map(|c| c.0).max().unwrap_or(0);
        counts.iter().find(|c| c.0 == most).map_or(StopReason::Locks, |c| c.1)
    }
}

/// What was last said against each vertex.
pub(super) struct Refusals(Vec<Option<Refusal>>);

impl Refusals {
    pub(super) fn new(vertices: usize) -> Self {
        Self(vec![None; vertices])
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.0.fill(None);
    }

    /// Notes what a try came to.
    pub(super) fn note(&mut self, v: u32, refusal: Option<Refusal>) {
        self.0[v as usize] = refusal;
    }

    /// Counts the vertices that something was said against.
    pub(super) fn count(&self) -> Refused {
        let mut refused = Refused::default();
        for refusal in self.0.iter().flatten() {
            refused.count(*refusal);
        }
        refused
    }
}

impl Add for Refused {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            links: self.links + other.links,
            flips: self.flips + other.flips,
            specks: self.specks + other.specks,
            locks: self.locks + other.locks,
            features: self.features + other.features,
            edges: self.edges + other.edges,
            max_error: self.max_error + other.max_error,
        }
    }
}
