//! One motion of the vertices and the field that follows it.

use ivd_core::{Error, Exec, Grid, VoxelCoord};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::super::outcome::SolveFigures;
use super::super::region::Region;
use super::affine::Affine;
use super::field::Field;
use super::matrix::Triple;
use super::system::System;

/// What an affine part leaves unexplained (of the largest motion) that is rounding.
const ROUNDING: f64 = 1e-12;

/// The affine part of a motion, and the nodes that follow the rest.
pub(super) struct Step {
    affine: Option<Affine>,
    /// Vertices (mm), and ω there.
    places: Vec<Vector3<f64>>,
    windows: Vec<f64>,
    /// What the affine part leaves of the vertices' motions (mm).
    rest: Vec<Vector3<f64>>,
    /// Values of the free nodes (mm); empty where nothing is left.
    pub(super) nodes: Vec<Triple>,
    iterations: u32,
    residual: f64,
}

impl Step {
    /// Finds the field for the motions (mm) of vertices at `places` (mm), to a residual relative to the equations' right-hand
    /// side.
    ///
    /// # Errors
    /// Cancellation.
    pub(super) fn solve(
        system: &System,
        region: &Region,
        places: &[Vector3<f64>],
        motions: &[Vector3<f64>],
        start: Option<Vec<Triple>>,
        tolerance: f64,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let affine = Affine::fit(places, motions);
        let windows: Vec<f64> = places.par_iter().map(|p| region.weight(*p)).collect();
        let rest: Vec<Vector3<f64>> = match &affine {
            None => motions.to_vec(),
            Some(fit) => (0..places.len()).map(|v| motions[v] - fit.at(places[v], windows[v])).collect(),
        };
        let most = |v: &[Vector3<f64>]| v.iter().map(Vector3::norm).fold(0.0, f64::max);
        let mut step = Self {
            affine,
            places: places.to_vec(),
            windows,
            rest,
            nodes: Vec::new(),
            iterations: 0,
            residual: 0.0,
        };
        if most(&step.rest) > ROUNDING * most(motions) {
            let found = system.solve(&step.rest, start, tolerance, exec)?;
            (step.nodes, step.iterations, step.residual) = (found.values, found.iterations, found.residual);
        }
        Ok(step)
    }

    /// Motion (mm) of a vertex after the part `t` of the way: a part of the affine turn, and straight on for the rest.
    pub(super) fn path(&self, vertex: usize, t: f64) -> Vector3<f64> {
        let affine = |fit: &Affine| fit.at(self.places[vertex], t * self.windows[vertex]);
        self.affine.as_ref().map_or_else(Vector3::zeros, affine) + self.rest[vertex] * t
    }

    pub(super) fn field<'a>(&'a self, grid: &'a Grid, system: &'a System, region: &'a Region) -> Field<'a> {
        Field { grid, region, cells: &system.cells, affine: self.affine.as_ref(), nodes: &self.nodes }
    }

    /// How far nodes at voxels of the part where all of the field counts go (mm): a voxel goes at least as far, rounding apart.
    pub(super) fn reach_of_nodes(&self, system: &System, region: &Region, grid: &Grid) -> f64 {
        let free = system.cells.nodes.free.all();
        let far = |(node, motion): (&[i32; 3], &Triple)| {
            let VoxelCoord(voxel) = system.cells.voxel(*node);
            let is_whole =
                grid.nearest_voxel(voxel).is_some() && region.weight(grid.linear_part() * voxel) == 1.0;
            if is_whole { Vector3::from(*motion).norm() } else { 0.0 }
        };
        // As a voxel's has fewer digits.
        free.par_iter().zip(&self.nodes).map(far).reduce(|| 0.0, f64::max) * (1.0 - 1e-6)
    }

    /// Whether an affine motion explains most of it, which may move voxels further than it moves vertices.
    pub(super) fn is_affine(&self) -> bool {
        self.affine.is_some()
    }

    pub(super) fn count(&self, solved: &mut SolveFigures) {
        solved.iterations += self.iterations;
        solved.residual = solved.residual.max(self.residual);
    }
}
