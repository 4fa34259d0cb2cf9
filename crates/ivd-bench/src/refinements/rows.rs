//! What a refinement gave: counts, errors, topology, time, and how it looks.

use std::collections::BTreeMap;
use std::time::Instant;

use ivd_budget::fronts::Spread;
use ivd_core::{Exec, Image, Lattice};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, StopReason, Target, distances, refine};
use nalgebra::Vector3;
use serde::Serialize;

use super::inputs::Input;
use super::pictures::Painter;
use crate::distance::Search;
use crate::experiment::Problem;

/// Edges where the surface turns by more than this (degrees between the normals of both triangles) are creases.
pub(super) const CREASE_DEGREES: f64 = 40.0;

/// A refinement of a lattice.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RefinementRow {
    /// The method.
    pub method: String,
    /// What was asked for, in words.
    pub asked: String,
    /// Vertices left.
    pub vertices: usize,
    /// Triangles left.
    pub triangles: usize,
    /// Share of the input's triangles that is left.
    pub ratio: f64,
    /// Bound on the distance that the result carries (mm).
    pub bound_mm: f64,
    /// Largest distance of either surface from the other (mm), measured: an upper bound, a thirty-second above the truth at most.
    pub max_mm: f64,
    /// Mean distance (mm), the larger of both ways.
    pub mean_mm: f64,
    /// Mean distance of the input's vertices on creases from the result (mm); 0 where there is no crease.
    pub crease_mm: f64,
    /// Vertices that the input hasn't at that place; no method makes any.
    pub new_vertices: usize,
    /// Counts of its topology.
    pub shape: Shape,
    /// What ended it.
    pub stopped_by: StopReason,
    /// Wall time (s), the median of all runs; of a level with those before it.
    pub seconds: f64,
    /// Lit; coloured by the distance from the input; as a wire-frame.
    #[serde(skip)]
    pub pictures: [Image; 3],
}

/// Topology of a lattice.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Shape {
    /// Euler characteristic.
    pub euler: i64,
    /// Handles of all parts together; none where it isn't a closed manifold.
    pub genus: Option<u64>,
    /// Parts.
    pub components: u64,
}

impl Shape {
    pub(super) fn of(lattice: &Lattice) -> Self {
        let figures = measure(lattice);
        Self { euler: figures.euler, genus: figures.genus, components: figures.components }
    }

    /// Whether it is a closed manifold with as many parts and handles as another.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        self.genus.is_some() && self == other
    }
}

/// Makes rows of one lattice.
pub(super) struct Rows<'a> {
    lattice: &'a Lattice,
    repeats: usize,
    exec: &'a Exec,
    painter: Painter,
    pub(super) creases: Vec<Vector3<f64>>,
    pub(super) shape: Shape,
    pub(super) voxel_mm: f64,
}

impl<'a> Rows<'a> {
    pub(super) fn new(input: &'a Input, repeats: usize, exec: &'a Exec) -> Result<Self, Problem> {
        let lattice = &input.lattice;
        let voxel_mm = lattice.grid().longest_edge();
        Ok(Self {
            lattice,
            repeats,
            exec,
            painter: Painter::new(lattice, Search::new(lattice, exec)?, input.view, voxel_mm),
            creases: creases(lattice),
            shape: Shape::of(lattice),
            voxel_mm,
        })
    }

    /// Refines the lattice with the method's defaults.
    pub(super) fn refined(&self, method: Method, target: Target) -> Result<Refined, Problem> {
        let params = RefineParams { method, target: target.into(), ..RefineParams::default() };
        Ok(refine(self.lattice, &params, Locks::NONE, self.exec)?)
    }

    /// A refinement by one method, timed.
    pub(super) fn row(
        &self,
        method: Method,
        target: Target,
        asked: String,
    ) -> Result<RefinementRow, Problem> {
        let mut times = Vec::new();
        loop {
            let start = Instant::now();
            let found = self.refined(method, target)?;
            times.push(start.elapsed().as_secs_f64());
            if times.len() >= self.repeats {
                return self.judged(method, asked, &found, Spread::of(&times).median);
            }
        }
    }

    /// The lattice as it is.
    pub(super) fn whole(&self) -> Result<RefinementRow, Problem> {
        let method = RefineParams::default().method;
        let found = self.refined(method, Target::Level(0))?;
        self.judged(method, "level 0".to_owned(), &found, 0.0)
    }

    /// Measures and draws a refinement.
    pub(super) fn judged(
        &self,
        method: Method,
        asked: String,
        found: &Refined,
        seconds: f64,
    ) -> Result<RefinementRow, Problem> {
        let (input, result) = (self.lattice, &found.lattice);
        let apart = distances(input, result, self.exec)?;
        let is_new = |v: &usize| {
            let at = input.vertex_at(result.keys()[*v]);
            at.is_none_or(|w| input.places()[w as usize] != result.places()[*v])
        };
        let search = Search::new(result, self.exec)?;
        let off: f64 = self.creases.iter().map(|p| search.distance(*p)).sum();
        Ok(RefinementRow {
            method: method.name().to_owned(),
            asked,
            vertices: result.keys().len(),
            triangles: result.triangles().len(),
            ratio: result.triangles().len() as f64 / input.triangles().len() as f64,
            bound_mm: found.max_error_mm,
            max_mm: apart.max_mm,
            mean_mm: apart.mean_mm,
            crease_mm: off / self.creases.len().max(1) as f64,
            new_vertices: (0..result.keys().len()).filter(is_new).count(),
            shape: Shape::of(result),
            stopped_by: found.reached.stopped_by,
            seconds,
            pictures: self.painter.pictures(result, self.exec)?,
        })
    }
}

/// Vertices at the ends of creases (mm).
fn creases(lattice: &Lattice) -> Vec<Vector3<f64>> {
    let positions = lattice.positions();
    let mut sides: BTreeMap<[u32; 2], Vec<Vector3<f64>>> = BTreeMap::new();
    for t in lattice.triangles() {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        for (u, v) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            sides.entry([u.min(v), u.max(v)]).or_default().push(normal);
        }
    }
    let cosine = CREASE_DEGREES.to_radians().cos();
    let sharp = sides.into_iter().filter(|(_, n)| n.len() == 2 && n[0].dot(&n[1]) < cosine);
    let mut ends: Vec<u32> = sharp.flat_map(|(edge, _)| edge).collect();
    ends.sort_unstable();
    ends.dedup();
    ends.into_iter().map(|v| positions[v as usize]).collect()
}

/// What ended a refinement, as the program's JSON says it.
pub(super) fn ended(by: StopReason) -> String {
    by.to_string().replace('_', " ")
}
