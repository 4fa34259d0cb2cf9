//! The matrix of projective dynamics, with handles as an update of low rank.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::body::Body;
use super::drives::Drives;
use super::factor::Factor;
use super::forces::Vectors;

/// Added to the diagonal, as a fraction of it, where nothing holds a part of the body but a handle: the handles' update takes
/// it out again, to some digits.
const HOLD: f64 = 1e-6;
/// Columns kept of vertices that aren't moved any more, about.
const KEPT: usize = 64;

/// The factored matrix: every spring's stiffness in every direction, ground springs, and masses over the step squared.
#[derive(Debug, Clone)]
pub(super) struct Metric {
    factor: Factor,
    /// The inverse's columns of the vertices that were moved so far.
    columns: BTreeMap<usize, Vec<f64>>,
    /// The vertices that are moved now, and the factored inverse between them.
    moved: Vec<usize>,
    between: Option<Cholesky<f64, Dyn>>,
}

impl Metric {
    /// - `inertia`: mass over the step squared of each loose vertex (g/s²); empty in statics.
    pub(super) fn new(body: &Body, inertia: &[f64]) -> Self {
        let held = body.held();
        let own = body.stiffness_bound();
        let extra = (0..body.loose).map(|v| {
            let inertia = inertia.get(v).copied().unwrap_or(0.0);
            let hold = if inertia > 0.0 || held[v] { 0.0 } else { HOLD * own[v].max(f64::MIN_POSITIVE) };
            body.ground[v] + inertia + hold
        });
        let factor = Factor::new(&body.rest, &body.list, &extra.collect::<Vec<f64>>());
        Self { factor, columns: BTreeMap::new(), moved: Vec::new(), between: None }
    }

    /// Takes the vertices that handles move out of the matrix (Woodbury).
    pub(super) fn hold(&mut self, body: &Body, drives: &Drives) {
        let moved: Vec<usize> = drives.moved.iter().map(|(v, ..)| *v).collect();
        if moved == self.moved {
            return;
        }
        // What a long drag no longer moves is given up, but not what comes and goes.
        if self.columns.len() > KEPT + 2 * moved.len() {
            self.columns.retain(|v, _| moved.contains(v));
        }
        let new: Vec<usize> = moved.iter().copied().filter(|v| !self.columns.contains_key(v)).collect();
        for three in new.chunks(3) {
            let mut unit = vec![[0.0; 3]; body.loose];
            for (a, &v) in three.iter().enumerate() {
                unit[v][a] = 1.0;
            }
            let solved = self.factor.solve(&unit);
            for (a, &v) in three.iter().enumerate() {
                self.columns.insert(v, solved.iter().map(|x| x[a]).collect());
            }
        }
        let entry = |i: usize, j: usize| self.columns[&moved[i.max(j)]][moved[i.min(j)]];
        self.between = DMatrix::from_fn(moved.len(), moved.len(), entry).cholesky();
        self.moved = moved;
    }

    /// The inverse times `b`, with moved vertices held at 0.
    pub(super) fn apply(&self, b: &Vectors) -> Vec<[f64; 3]> {
        let mut x = self.factor.solve(b);
        let at: Vec<[f64; 3]> = self.moved.iter().map(|&v| x[v]).collect();
        self.add(&mut x, &at, -1.0);
        for &v in &self.moved {
            x[v] = [0.0; 3];
        }
        x
    }

    /// Where the others go when the moved vertices go by `by`, and every spring pulls as its stiffness in every direction.
    pub(super) fn extend(&self, by: &Vectors, loose: usize) -> Vec<[f64; 3]> {
        let mut x = vec![[0.0; 3]; loose];
        self.add(&mut x, by, 1.0);
        for (&v, by) in self.moved.iter().zip(by) {
            x[v] = *by;
        }
        x
    }

    /// Adds `sign` times the columns, so combined that the moved vertices change by `sign · at`.
    fn add(&self, x: &mut Vectors, at: &Vectors, sign: f64) {
        let Some(between) = self.between.as_ref().filter(|_| !self.moved.is_empty()) else { return };
        for a in 0..3 {
            let weights = between.solve(&DVector::from_iterator(at.len(), at.iter().map(|v| v[a])));
            for (v, w) in self.moved.iter().zip(weights.iter()) {
                for (x, c) in x.iter_mut().zip(&self.columns[v]) {
                    x[a] += sign * w * c;
                }
            }
        }
    }
}
