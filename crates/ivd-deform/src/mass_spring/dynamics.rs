//! Symplectic Euler with sub-steps (thesis, equation 6.1).

use ivd_core::{Exec, Iteration};
use rayon::prelude::*;

use super::body::Body;
use super::drives::Drives;
use super::forces::{CHUNK, Vectors};
use super::outcome::Outcome;
use super::params::Params;
use crate::Error;

/// `ω²dt² + 2γdt` must be less than 4. A step that is asked for is divided until it is at most this.
const STABLE: f64 = 3.6;
/// A step that isn't asked for makes it at most this: then the energy stays within a third and three times its own.
const CALM: f64 = 1.0;
/// More steps than these take longer than anybody waits.
const MOST_STEPS: f64 = 2e6;
/// Energies reported to the observer, about.
const REPORTS: usize = 16;

/// The vertices in motion.
pub(super) struct Motion<'a> {
    body: &'a Body,
    drives: &'a Drives,
    /// 1 / mass of each loose vertex (1/g), 0 of a moved one.
    inverse_mass: Vec<f64>,
    drag: f64,
    /// Displacements (mm) of all vertices, now and one step on.
    pub(super) now: Vec<[f64; 3]>,
    next: Vec<[f64; 3]>,
    /// Velocity of each loose vertex (mm/s).
    pub(super) velocity: Vec<[f64; 3]>,
    force: Vec<[f64; 3]>,
}

impl<'a> Motion<'a> {
    pub(super) fn at_rest(body: &'a Body, drives: &'a Drives, drag: f64) -> Self {
        let inverse = |(m, moved): (&f64, &bool)| if *moved { 0.0 } else { 1.0 / m };
        Self {
            body,
            drives,
            inverse_mass: body.mass.iter().zip(&drives.is_moved).map(inverse).collect(),
            drag,
            now: vec![[0.0; 3]; body.vertices.len()],
            next: vec![[0.0; 3]; body.vertices.len()],
            velocity: vec![[0.0; 3]; body.loose],
            force: vec![[0.0; 3]; body.loose],
        }
    }

    /// One step of `dt` (s). Handles pull with the fraction `pulling` of their force, and have moved by the fraction
    /// `reached` at its end.
    pub(super) fn step(&mut self, dt: f64, pulling: f64, reached: f64) {
        let (body, now, drag) = (self.body, &self.now[..], self.drag);
        let of =
            |(chunk, ((next, velocity), force)): (usize, ((&mut Vectors, &mut Vectors), &mut Vectors))| {
                body.springs.on_chunk(chunk, now, force);
                let first = chunk * CHUNK;
                let held = self.drives.force[first..].iter().zip(&body.ground[first..]);
                let own = held.zip(&self.inverse_mass[first..]).zip(&now[first..]);
                for ((((next, velocity), force), (((pull, ground), inverse), at)), _) in
                    next.iter_mut().zip(velocity.iter_mut()).zip(force.iter()).zip(own).zip(0..CHUNK)
                {
                    for a in 0..3 {
                        let total = force[a] + pull[a] * pulling - ground * at[a];
                        velocity[a] += dt * (total * inverse - drag * velocity[a]);
                        next[a] = at[a] + dt * velocity[a];
                    }
                }
            };
        let next = &mut self.next[..body.loose];
        if body.springs.worth_sharing() {
            let both = next.par_chunks_mut(CHUNK).zip(self.velocity.par_chunks_mut(CHUNK));
            both.zip(self.force.par_chunks_mut(CHUNK)).enumerate().for_each(of);
        } else {
            let both = next.chunks_mut(CHUNK).zip(self.velocity.chunks_mut(CHUNK));
            both.zip(self.force.chunks_mut(CHUNK)).enumerate().for_each(of);
        }
        self.drives.place(&mut self.next, reached);
        std::mem::swap(&mut self.now, &mut self.next);
    }

    /// Energy of springs, ground springs and motion (nJ).
    pub(super) fn energy(&self) -> f64 {
        let speeds = self.body.mass.iter().zip(&self.velocity).zip(&self.drives.is_moved);
        let kinetic: f64 = speeds
            .filter(|(_, moved)| !**moved)
            .map(|((m, v), _)| 0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
            .sum();
        self.body.energy(&self.now) + kinetic
    }
}

/// The longest step (s) for which `ω²dt² + 2γdt ≤ bound` at every vertex.
pub(super) fn longest_step(body: &Body, drives: &Drives, drag: f64, bound: f64) -> f64 {
    let free = body.stiffness_bound().into_iter().zip(&body.mass).zip(&drives.is_moved);
    let squared = free.filter(|(_, moved)| !**moved).map(|((k, m), _)| k / m).fold(0.0, f64::max);
    // The positive root, in the form that doesn't cancel.
    bound / (drag + (drag * drag + bound * squared).sqrt())
}

/// Steps through the duration.
pub(super) fn run(body: &Body, drives: &Drives, params: &Params, exec: &Exec) -> Result<Outcome, Error> {
    const TASK: &str = "dynamics";
    let stable = match params.dt {
        Some(dt) => dt.min(longest_step(body, drives, params.drag, STABLE)),
        None => longest_step(body, drives, params.drag, CALM).min(params.duration / 32.0),
    };
    let wanted = params.steps(stable);
    if wanted > MOST_STEPS {
        return Err(Error::Untrusted {
            what: "the deformed lattice",
            problem: format!(
                "explicit steps of {stable:.3e} s, as its stiffness and mass ask for, would be {wanted:.3e}, more than \
                 {MOST_STEPS:e}"
            ),
            remedy: "use the projective solver, less stiffness, more mass or a shorter duration",
        });
    }
    let steps = wanted as usize;
    let dt = params.duration / wanted;
    exec.observer().begin(TASK, steps as u64);
    let (every, frame_every) = (steps.div_ceil(REPORTS), steps / params.frames);
    let mut motion = Motion::at_rest(body, drives, params.drag);
    let mut outcome = Outcome { steps, dt, ..Outcome::default() };
    let mut reached = params.reached(0.0);
    for step in 1..=steps {
        if step % 16 == 0 {
            exec.check_cancelled()?;
        }
        let pulling = reached;
        reached = params.reached(params.duration * (step as f64 / wanted));
        motion.step(dt, pulling, reached);
        if step == 1 || step == steps || step % every == 0 {
            let value = motion.energy();
            outcome.energies[usize::from(step > 1)] = value;
            exec.observer().iteration(Iteration { method: TASK, index: step as u64, value });
            if !value.is_finite() {
                return Err(Error::Untrusted {
                    what: "the deformed lattice",
                    problem: format!("its energy isn't finite after step {step} of {steps}"),
                    remedy: "use a smaller force or move, more stiffness or a shorter duration",
                });
            }
        }
        if step % frame_every == 0 {
            outcome.frames.push(motion.now.clone());
        }
        exec.observer().advance(TASK, 1);
    }
    if steps == 1 {
        outcome.energies[1] = outcome.energies[0];
    }
    exec.observer().end(TASK);
    Ok(outcome)
}
