//! What an implicit solver makes small: the energy of springs, of a constant pull, and of inertia.

use super::body::Body;
use super::drives::Drives;
use super::forces::{dot, norm};
use super::spring::Vectors;

/// Inertia of an implicit Euler step with drag `γ`: `½ a |u − anchor|²`, `a = m (1 + γh) / h²`,
/// `anchor = u₀ + h v₀ / (1 + γh)`.
#[derive(Debug, Clone)]
pub(super) struct Inertia {
    /// Of each loose vertex (g/s²).
    pub(super) stiffness: Vec<f64>,
    /// Displacement of each loose vertex where no force acted (mm).
    pub(super) anchor: Vec<[f64; 3]>,
}

/// The forces put in, of one gradient after the other.
#[derive(Debug, Default)]
pub(super) struct PutIn {
    /// Their largest length so far (µN).
    most: f64,
    /// Those of handles and of inertia on every loose vertex, then those of bones (µN).
    forces: Vec<[f64; 3]>,
}

/// The objective of a step, or of statics.
pub(super) struct Objective<'a> {
    pub(super) body: &'a Body,
    pub(super) drives: &'a Drives,
    /// Fraction of their force with which handles pull.
    pub(super) reached: f64,
    pub(super) inertia: Option<&'a Inertia>,
}

impl Objective<'_> {
    /// Writes the gradient (µN) at `moved`, 0 at moved vertices; gives its length over that of the forces put in, which
    /// are those of handles, of bones and of inertia.
    ///
    /// - `put_in`: what was put in so far; it counts as a millionth of the largest at least, so that a body that
    ///   handles move as it is, against no force, has an end.
    pub(super) fn gradient(&self, moved: &Vectors, gradient: &mut Vectors, put_in: &mut PutIn) -> f64 {
        let body = self.body;
        body.springs.forces(moved, gradient);
        let PutIn { most, forces } = put_in;
        forces.resize(2 * body.loose, [0.0; 3]);
        let (by_handles, by_inertia) = forces.split_at_mut(body.loose);
        for v in 0..body.loose {
            for a in 0..3 {
                let inertia =
                    self.inertia.map_or(0.0, |own| own.stiffness[v] * (moved[v][a] - own.anchor[v][a]));
                let springs = body.ground[v] * moved[v][a] - gradient[v][a];
                if self.drives.is_moved[v] {
                    by_handles[v][a] = springs;
                    by_inertia[v][a] = 0.0;
                    gradient[v][a] = 0.0;
                } else {
                    let pull = self.drives.force[v][a] * self.reached;
                    by_handles[v][a] = pull;
                    by_inertia[v][a] = inertia;
                    gradient[v][a] = springs + inertia - pull;
                }
            }
        }
        forces.extend(body.on_bones(moved));
        let length = norm(forces);
        *most = most.max(length);
        let size = norm(gradient);
        if size == 0.0 { 0.0 } else { size / length.max(1e-6 * *most).max(f64::MIN_POSITIVE) }
    }

    /// How much it grows (nJ) from `moved` along `way`, to all digits however short the way is.
    pub(super) fn growth(&self, moved: &Vectors, way: &Vectors) -> f64 {
        let body = self.body;
        // Ways of the held vertices are 0, and no force but springs' acts on them.
        let mut slope = vec![[0.0; 3]; body.loose];
        for v in (0..body.loose).filter(|v| !self.drives.is_moved[*v]) {
            for a in 0..3 {
                let half = moved[v][a] + 0.5 * way[v][a];
                let inertia = self.inertia.map_or(0.0, |own| own.stiffness[v] * (half - own.anchor[v][a]));
                slope[v][a] = body.ground[v] * half + inertia - self.drives.force[v][a] * self.reached;
            }
        }
        body.springs.energy_growth(moved, way) + dot(&slope, &way[..body.loose])
    }
}
