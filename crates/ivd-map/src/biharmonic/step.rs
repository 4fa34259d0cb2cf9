//! One motion of the vertices and the field that follows it.

use std::borrow::Cow;

use ivd_core::{Error, Exec, Grid};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::super::outcome::SolveFigures;
use super::super::region::Region;
use super::affine::Affine;
use super::bound::Bound;
use super::field::Field;
use super::matrix::Triple;
use super::system::System;

/// What an affine part leaves unexplained (of the largest motion) that is rounding.
const ROUNDING: f64 = 1e-12;

/// Where vertices are to go: the affine part of their motion, and the rest.
pub(super) struct Aim<'a> {
    /// Vertices (mm).
    places: &'a [Vector3<f64>],
    affine: Option<Affine>,
    /// ω at the vertices; empty without an affine part.
    windows: Vec<f64>,
    /// What the affine part leaves of their motions (mm).
    rest: Cow<'a, [Vector3<f64>]>,
    /// Whether that is more than rounding.
    leaves_any: bool,
}

impl<'a> Aim<'a> {
    /// - `places`, `motions`: of the vertices (mm).
    pub(super) fn new(places: &'a [Vector3<f64>], motions: &'a [Vector3<f64>], region: &Region) -> Self {
        let affine = Affine::fit(places, motions);
        let (windows, rest) = match &affine {
            None => (Vec::new(), Cow::Borrowed(motions)),
            Some(fit) => {
                let windows: Vec<f64> = places.par_iter().map(|p| region.weight(*p)).collect();
                let rest = (0..places.len()).map(|v| motions[v] - fit.at(places[v], windows[v]));
                let rest = Cow::Owned(rest.collect());
                (windows, rest)
            }
        };
        let most = |v: &[Vector3<f64>]| v.iter().map(Vector3::norm).fold(0.0, f64::max);
        let leaves_any = most(&rest) > ROUNDING * most(motions);
        Self { places, affine, windows, rest, leaves_any }
    }

    /// Motion (mm) of a vertex after the part `t` of the way: a part of the affine turn, and straight on for the rest.
    pub(super) fn path(&self, vertex: usize, t: f64) -> Vector3<f64> {
        let affine = |fit: &Affine| fit.at(self.places[vertex], t * self.windows[vertex]);
        self.affine.as_ref().map_or_else(Vector3::zeros, affine) + self.rest[vertex] * t
    }

    /// Whether an affine motion explains most of it, which may move voxels further than it moves vertices.
    pub(super) fn is_affine(&self) -> bool {
        self.affine.is_some()
    }
}

/// The nodes that follow what an affine part leaves of a motion.
#[derive(Default)]
pub(super) struct Step {
    /// Values of the free nodes (mm); empty where nothing is left.
    pub(super) nodes: Vec<Triple>,
    pub(super) iterations: u32,
    residual: f64,
    /// Whether its nodes are no more than what tells that they go too far.
    pub(super) is_rough: bool,
}

impl Step {
    /// Finds the nodes, to a residual relative to the equations' right-hand side; no better than tells that they go beyond the bound, where they do.
    ///
    /// # Errors
    /// Cancellation.
    pub(super) fn solve(
        system: &System,
        aim: &Aim<'_>,
        start: Option<Vec<Triple>>,
        (tolerance, bound): (f64, Option<&Bound>),
        exec: &Exec,
    ) -> Result<Self, Error> {
        if !aim.leaves_any {
            return Ok(Self::default());
        }
        let mut last = f64::INFINITY;
        // All of it is found where nothing is to be skipped.
        let mut enough = |nodes: &[Triple], residual| {
            bound.filter(|_| exec.skip).is_some_and(|bound| bound.rules_out(nodes, residual, &mut last))
        };
        let found = system.solve(&aim.rest, start, tolerance, &mut enough, exec)?;
        Ok(Self {
            nodes: found.values,
            iterations: found.iterations,
            residual: found.residual,
            is_rough: found.is_enough,
        })
    }

    pub(super) fn field<'a>(
        &'a self,
        grid: &'a Grid,
        system: &'a System,
        aim: &'a Aim<'_>,
        region: &'a Region,
    ) -> Field<'a> {
        Field { grid, region, cells: &system.cells, affine: aim.affine.as_ref(), nodes: &self.nodes }
    }

    pub(super) fn count(&self, solved: &mut SolveFigures) {
        solved.iterations += self.iterations;
        solved.residual = solved.residual.max(self.residual);
    }
}
