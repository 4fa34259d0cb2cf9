//! What a solver gives, and how far from balance it is.

use super::body::Body;
use super::drives::Drives;
use super::forces::norm;
use super::spring::Vectors;

/// What a solver gives.
#[derive(Debug, Clone, Default)]
pub(super) struct Outcome {
    pub(super) steps: usize,
    /// Length of a step (s).
    pub(super) dt: f64,
    pub(super) iterations: usize,
    /// Displacements (mm) of all vertices of the body, in the order of time.
    pub(super) frames: Vec<Vec<[f64; 3]>>,
    /// Energy (nJ) after the first and after the last step.
    pub(super) energies: [f64; 2],
    /// Worst relative gradient of a step or frame, where the solver has one of its own.
    pub(super) residual: Option<f64>,
}

/// Forces (µN) at a displacement.
pub(super) struct Balance {
    /// On vertices that are free to move: handles, springs and ground springs together.
    pub(super) unbalanced: f64,
    /// By each handle, in all.
    pub(super) handles: Vec<[f64; 3]>,
    /// By which each vertex that a bone carries is held against the springs, in the order of the body's.
    pub(super) bones: Vec<[f64; 3]>,
    /// Length of the list of the forces by which handles and bones act on the vertices.
    pub(super) put_in: f64,
}

impl Balance {
    /// - `reached`: fraction of their force with which handles pull.
    /// - `pulls`: force in the end of each handle that pulls (µN), 0 of one that moves.
    pub(super) fn new(body: &Body, drives: &Drives, moved: &Vectors, reached: f64, pulls: &Vectors) -> Self {
        let mut force = vec![[0.0; 3]; body.loose];
        body.springs.forces(moved, &mut force);
        for ((force, ground), at) in force.iter_mut().zip(&body.ground).zip(moved) {
            *force = std::array::from_fn(|a| force[a] - ground * at[a]);
        }
        let mut handles: Vec<[f64; 3]> = pulls.iter().map(|pull| pull.map(|c| c * reached)).collect();
        let mut put_in: Vec<[f64; 3]> = drives.force.iter().map(|f| f.map(|c| c * reached)).collect();
        for &(v, _, h) in &drives.moved {
            // What holds a moved vertex in its place against the springs.
            put_in[v] = force[v].map(|c| -c);
            handles[h] = std::array::from_fn(|a| handles[h][a] - force[v][a]);
        }
        force.iter_mut().zip(&put_in).for_each(|(f, p)| *f = std::array::from_fn(|a| f[a] + p[a]));
        let bones: Vec<[f64; 3]> = body.on_bones(moved).into_iter().map(|f| f.map(|c| -c)).collect();
        put_in.extend_from_slice(&bones);
        Self { unbalanced: norm(&force), handles, bones, put_in: norm(&put_in) }
    }

    /// The unbalanced force over what handles and bones put in; 0 where both are, 1 where only the latter is.
    pub(super) fn relative(&self) -> f64 {
        match (self.unbalanced > 0.0, self.put_in > 0.0) {
            (false, _) => 0.0,
            (true, false) => 1.0,
            (true, true) => (self.unbalanced / self.put_in).min(f64::MAX),
        }
    }
}
