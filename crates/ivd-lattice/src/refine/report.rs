use ivd_core::Lattice;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mean::Seen;
use super::refusal::{Refused, StopReason};

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
    /// Largest distance that was found (mm), from the points that the mean is of: what the bound is worth. The search being local, a true distance
    /// may be less.
    pub seen_error_mm: f64,
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

/// What a method made of a lattice, in the input's numbers.
pub(super) struct Outcome {
    /// Vertices left, ascending.
    pub(super) kept: Vec<u32>,
    /// Triangles left, between kept vertices.
    pub(super) triangles: Vec<[u32; 3]>,
    /// As in [`Refined`].
    pub(super) max_error_mm: f64,
    pub(super) seen: Seen,
    pub(super) stopped_by: StopReason,
    pub(super) refused: Refused,
    pub(super) passes: u32,
}

impl Outcome {
    /// The refined lattice, with its vertices numbered anew, and its figures.
    pub(super) fn report(self, input: &Lattice) -> Refined {
        let Self { kept, triangles, max_error_mm, seen, stopped_by, refused, passes } = self;
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
            mean_error_mm: seen.mean,
            seen_error_mm: seen.largest.min(max_error_mm),
            vertices_in: input.keys().len(),
            triangles_in: input.triangles().len(),
            passes,
        }
    }
}
