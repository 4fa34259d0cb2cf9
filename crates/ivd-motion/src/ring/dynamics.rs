//! Masses on springs, stepped through time.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::rings::Edges;

/// A spring shorter than this fraction of its rest length has no direction and exerts nothing.
const NO_DIRECTION: f64 = 1e-6;

/// What drives a vertex.
#[derive(Debug, Clone)]
pub(super) enum Drive {
    /// Never moves.
    Fixed,
    /// Is moved by this vector in the end (mm).
    Moved(Vector3<f64>),
    /// Is pulled with this force (µN) against its ground spring.
    Pulled(Vector3<f64>),
    /// Follows a blend of the targets, weights by target, and takes a component force (µN).
    Follows(Vec<(usize, f64)>, Vector3<f64>),
}

/// The constants of the motion.
pub(super) struct Material {
    /// Of a structural spring (g/s²).
    pub(super) stiffness: f64,
    /// Of a ground spring (g/s²).
    pub(super) ground: f64,
    /// Fraction of critical damping.
    pub(super) damping: f64,
    /// Whether springs push when they are shorter than at rest.
    pub(super) push: bool,
}

/// The moving vertices, their springs, and where they are.
pub(super) struct System<'a> {
    pub(super) edges: &'a Edges,
    /// Rest positions (mm), relative to the grid's origin.
    pub(super) rest: &'a [Vector3<f64>],
    /// Mass of each vertex (g).
    pub(super) mass: &'a [f64],
    pub(super) material: Material,
    /// The vertices that may move, ascending.
    pub(super) active: Vec<usize>,
    /// What drives each of them.
    pub(super) drives: Vec<Drive>,
    /// Displacement of every vertex of the lattice (mm).
    pub(super) displacement: Vec<Vector3<f64>>,
    /// Deviation of each active vertex from what drives it (mm), and its rate (mm/s).
    pub(super) deviation: Vec<[Vector3<f64>; 2]>,
}

impl System<'_> {
    /// One step of length `dt` (s) to the fraction `progress` (0…1) of the duration; symplectic Euler (thesis, equation 6.1).
    ///
    /// The velocity is divided by `1 + dt γ + dt² D / m`, with `D` a bound on the stiffness at the vertex: that is the
    /// implicit step with the diagonal for the matrix. It agrees with the explicit step to first order, is stable for any
    /// stiffness and any `dt`, and rests where the forces balance.
    pub(super) fn step(&mut self, progress: f64, dt: f64) {
        let ramp = progress * progress * (3.0 - 2.0 * progress);
        let deviation: Vec<[Vector3<f64>; 2]> = (0..self.active.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let v = self.active[i];
                let (own, pull) = match &self.drives[i] {
                    Drive::Fixed | Drive::Moved(_) => return [Vector3::zeros(); 2],
                    Drive::Pulled(force) | Drive::Follows(_, force) => (self.deviation[i], *force),
                };
                let m = self.mass[v];
                let force = pull + self.spring_force(v) - own[0] * self.material.ground;
                let drag = 2.0 * self.material.damping * (self.material.ground / m).sqrt();
                let bound =
                    2.0 * self.material.stiffness * self.edges.of(v).len() as f64 + self.material.ground;
                let rate = (own[1] + force * (dt / m)) / (1.0 + dt * drag + dt * dt * bound / m);
                [own[0] + rate * dt, rate]
            })
            .collect();
        self.deviation = deviation;
        // Targets first: the others follow where these are now.
        for i in 0..self.active.len() {
            match &self.drives[i] {
                Drive::Moved(by) => self.displacement[self.active[i]] = by * ramp,
                Drive::Pulled(_) => self.displacement[self.active[i]] = self.deviation[i][0],
                Drive::Fixed | Drive::Follows(..) => {}
            }
        }
        for i in 0..self.active.len() {
            if let Drive::Follows(weights, _) = &self.drives[i] {
                self.displacement[self.active[i]] = self.goal(weights) + self.deviation[i][0];
            }
        }
    }

    /// Where a follower would be without springs: the mean of its targets, each weighing `w / (1 - w)`, times the part
    /// `1 - Π(1 - w)` that they cover together. Next to a target that is the target's own motion; with one target it is `w`
    /// of it; two targets with one motion don't add up to more than that motion.
    fn goal(&self, weights: &[(usize, f64)]) -> Vector3<f64> {
        if let [(target, w)] = weights {
            return self.displacement[*target] * *w;
        }
        let (mut blend, mut total, mut uncovered) = (Vector3::zeros(), 0.0, 1.0);
        for &(target, w) in weights {
            let near = w / (1.0 - w).max(1e-12);
            blend += self.displacement[target] * near;
            total += near;
            uncovered *= 1.0 - w;
        }
        if total > 0.0 { blend * ((1.0 - uncovered) / total) } else { Vector3::zeros() }
    }

    /// Sum of the structural springs' forces on a vertex (µN): `K (|d| - L) d / |d|` towards each neighbour (thesis, equation
    /// 6.5, as a restoring force). Only stretched springs act unless `push`: tissue folds rather than push back, the energy is
    /// convex, and no vertex buckles.
    fn spring_force(&self, v: usize) -> Vector3<f64> {
        let (here, by) = (self.rest[v], self.displacement[v]);
        let mut sum = Vector3::zeros();
        for (u, rest_squared) in self.edges.with_lengths(v) {
            let now = (self.rest[u] - here) + (self.displacement[u] - by);
            let squared = now.norm_squared();
            // Roots keep the order of what they are taken of: most springs are told to be slack without one.
            if squared <= rest_squared && !self.material.push {
                continue;
            }
            let (rest_length, length) = (rest_squared.sqrt(), squared.sqrt());
            let directed = length > NO_DIRECTION * rest_length;
            if directed && (length > rest_length || self.material.push) {
                sum += now * (self.material.stiffness * (length - rest_length) / length);
            }
        }
        sum
    }

    /// Energy of springs and motion [g mm²/s² = nJ]: structural springs, ground springs, deviations' kinetic energy.
    pub(super) fn energy(&self) -> f64 {
        let of = |i: usize| {
            let v = self.active[i];
            let springs: f64 = self.edges.of(v).iter().map(|&u| self.spring_energy(v, u as usize)).sum();
            let [offset, rate] = self.deviation[i];
            // Half: a spring is met from both ends, at least where both are active.
            0.5 * springs
                + 0.5 * self.material.ground * offset.norm_squared()
                + 0.5 * self.mass[v] * rate.norm_squared()
        };
        (0..self.active.len()).map(of).sum()
    }

    fn spring_energy(&self, v: usize, u: usize) -> f64 {
        let at_rest = self.rest[u] - self.rest[v];
        let stretch = (at_rest + (self.displacement[u] - self.displacement[v])).norm() - at_rest.norm();
        let stretch = if self.material.push { stretch } else { stretch.max(0.0) };
        0.5 * self.material.stiffness * stretch * stretch
    }

    /// Largest unbalanced force on a vertex that is free to move, over the largest force on any.
    pub(super) fn residual(&self) -> f64 {
        let (mut unbalanced, mut largest) = (0.0_f64, 0.0_f64);
        for (i, &v) in self.active.iter().enumerate() {
            if let Drive::Pulled(force) | Drive::Follows(_, force) = &self.drives[i] {
                let (springs, tie) = (self.spring_force(v), self.deviation[i][0] * self.material.ground);
                unbalanced = unbalanced.max((force + springs - tie).norm());
                largest = largest.max(force.norm()).max(springs.norm()).max(tie.norm());
            }
        }
        if largest > 0.0 { unbalanced / largest } else { 0.0 }
    }
}
