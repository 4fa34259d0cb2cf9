use std::fmt;
use std::ops::Add;

use ivd_core::Lattice;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::half_edge::Refusal;

/// A refined lattice and how far it is from its input.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// A subset of the input's vertices, with their keys and places, and new triangles between them.
    pub lattice: Lattice,
    /// How far the refinement went, and what ended it.
    pub reached: RefineStatus,
    /// Bound on the distance between input and result, both ways (mm): the Hausdorff distance is at most this.
    pub max_error_mm: f64,
    /// Mean distance (mm). Of collapse and decimation that of the input's vertices from the result, weighted by the area round
    /// them; perhaps a little too large, as the search for the nearest triangle is local. Above 2¹⁶ vertices it is that of
    /// every n-th. Of the other methods that of points of either surface from the other, by area, and the larger of both.
    pub mean_error_mm: f64,
    /// Vertices of the input.
    pub vertices_in: usize,
    /// Triangles of the input.
    pub triangles_in: usize,
    /// Passes over the surface.
    pub passes: u32,
}

/// How far a refinement went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RefineStatus {
    /// Share of the triangles that is left; 1 for an empty lattice.
    #[schemars(extend("x-unit" = "1"))]
    pub ratio: f64,
    /// Level that the vertices left amount to: log₄ of how many times fewer they are.
    #[schemars(extend("x-unit" = "1"))]
    pub level: f64,
    /// What ended it.
    pub stopped_by: StopReason,
    /// Vertices that the last pass wanted to remove and why they are still there.
    pub refused: Refused,
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
    /// Coarser by a step, nothing would be left.
    Vanishing,
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
            max_error: self.max_error + other.max_error,
        }
    }
}

/// What a method made of a lattice, in the input's numbers.
pub(super) struct Outcome {
    /// Vertices left, ascending.
    pub(super) kept: Vec<u32>,
    /// Triangles left, between kept vertices.
    pub(super) triangles: Vec<[u32; 3]>,
    /// As in [`Refined`].
    pub(super) max_error_mm: f64,
    /// As in [`Refined`].
    pub(super) mean_error_mm: f64,
    pub(super) stopped_by: StopReason,
    pub(super) refused: Refused,
    pub(super) passes: u32,
}

impl Outcome {
    /// The refined lattice, with its vertices numbered anew, and its figures.
    pub(super) fn report(self, input: &Lattice) -> Refined {
        let Self { kept, triangles, max_error_mm, mean_error_mm, stopped_by, refused, passes } = self;
        let level =
            if kept.is_empty() { 0.0 } else { (input.keys().len() as f64 / kept.len() as f64).log(4.0) };
        let share = triangles.len() as f64 / input.triangles().len() as f64;
        let lattice = input.subset(&kept, triangles).expect("triangles lie between the vertices kept");
        let lattice = lattice.with_level(input.level().saturating_add(level.round() as u8));
        Refined {
            lattice: lattice.with_max_error_mm(input.max_error_mm() + max_error_mm),
            reached: RefineStatus {
                ratio: if input.triangles().is_empty() { 1.0 } else { share },
                level,
                stopped_by,
                refused,
            },
            max_error_mm,
            mean_error_mm,
            vertices_in: input.keys().len(),
            triangles_in: input.triangles().len(),
            passes,
        }
    }
}
