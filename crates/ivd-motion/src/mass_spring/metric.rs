//! The matrix of projective dynamics, with handles as an update of low rank.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::body::Body;
use super::drives::Drives;
use super::factor::Factor;
use super::spring::Vectors;

/// Added to the diagonal, as a fraction of it, where nothing holds a part of the body but a handle: the handles' update takes
/// it out again, to some digits.
const HOLD: f64 = 1e-6;
/// Columns kept of vertices that aren't moved any more, about.
const KEPT: usize = 64;
/// Most vertices that are taken out by an update: for more of them a factor of their own is cheaper, as every update of `k` vertices
/// costs `k` columns at every use.
const UPDATED: usize = 24;
/// Added to the diagonal of vertices that a factor of their own holds, as a multiple of the largest stiffness there is.
const PIN: f64 = 1e10;

/// The factored matrix: every spring's stiffness in every direction, ground springs, and masses over the step squared.
#[derive(Debug, Clone)]
pub(super) struct Metric {
    factor: Factor,
    /// What was added to the diagonal, beyond the springs' stiffness (g/s²).
    extra: Vec<f64>,
    /// The matrix with the moved vertices pinned, and by what (g/s²), where there are many.
    pinned: Option<(Factor, f64)>,
    /// The inverse's columns of the vertices that were moved so far.
    columns: BTreeMap<usize, Vec<f64>>,
    /// The vertices that are moved now, and the factored inverse between them.
    moved: Vec<usize>,
    /// Whether it is solved with what not every processor of its kind has.
    simd: bool,
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
        let extra: Vec<f64> = extra.collect();
        let factor = Factor::new(&body.rest, &body.list, &extra);
        Self {
            factor,
            extra,
            pinned: None,
            columns: BTreeMap::new(),
            moved: Vec::new(),
            simd: body.springs.is_wide(),
            between: None,
        }
    }

    /// Takes the vertices that handles move out of the matrix (Woodbury), or pins them where they are many.
    pub(super) fn hold(&mut self, body: &Body, drives: &Drives) {
        self.simd = body.springs.is_wide();
        let moved: Vec<usize> = drives.moved.iter().map(|(v, ..)| *v).collect();
        if moved == self.moved {
            return;
        }
        self.pinned = None;
        if moved.len() > UPDATED {
            let stiffest =
                body.stiffness_bound().into_iter().chain(self.extra.iter().copied()).fold(0.0, f64::max);
            let (pin, mut extra) = (PIN * stiffest, self.extra.clone());
            for &v in &moved {
                extra[v] += pin;
            }
            self.pinned = Some((Factor::new(&body.rest, &body.list, &extra), pin));
            (self.between, self.moved) = (None, moved);
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
            let solved = self.factor.solve(&unit, self.simd);
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
        if let Some((factor, _)) = &self.pinned {
            let mut b = b.to_vec();
            for &v in &self.moved {
                b[v] = [0.0; 3];
            }
            let mut x = factor.solve(&b, self.simd);
            for &v in &self.moved {
                x[v] = [0.0; 3];
            }
            return x;
        }
        let mut x = self.factor.solve(b, self.simd);
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
        if let Some((factor, pin)) = &self.pinned {
            for (&v, by) in self.moved.iter().zip(by) {
                x[v] = by.map(|c| c * pin);
            }
            x = factor.solve(&x, self.simd);
        } else {
            self.add(&mut x, by, 1.0);
        }
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
