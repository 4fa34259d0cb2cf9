//! Symplectic Euler with sub-steps (thesis, equation 6.1).

use ivd_core::{Exec, Iteration};
use rayon::prelude::*;

use super::blocks::{Padded, padded, unpadded};
use super::body::Body;
use super::drives::Drives;
use super::forces::{After, CHUNK};
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
    /// Force in the end of the handles on each loose vertex (µN); none where no handle pulls.
    pull: Vec<[f64; 4]>,
    drag: f64,
    /// Displacements (mm) of all vertices, now and one step on, padded.
    now: Vec<[f64; 4]>,
    next: Vec<[f64; 4]>,
    /// Velocity of each loose vertex (mm/s), padded.
    pub(super) velocity: Vec<[f64; 4]>,
    force: Vec<[f64; 4]>,
}

/// A step of the vertices of a chunk, from the springs' force on.
struct Step<'a> {
    dt: f64,
    drag: f64,
    pulling: f64,
    /// Of the chunk's vertices, all as many.
    ground: &'a [f64],
    inverse_mass: &'a [f64],
    pull: Option<&'a Padded>,
    next: &'a mut Padded,
    velocity: &'a mut Padded,
    /// Its first vertex.
    first: usize,
}

impl After for Step<'_> {
    #[inline(always)]
    fn go_on(self, moved: &Padded, force: &Padded) {
        let Self { dt, drag, pulling, ground, inverse_mass, pull, next, velocity, first } = self;
        let count = next.len();
        let (now, force, velocity) = (&moved[first..first + count], &force[..count], &mut velocity[..count]);
        let (ground, inverse) = (&ground[..count], &inverse_mass[..count]);
        for v in 0..count {
            for a in 0..4 {
                let pulled = match pull {
                    None => force[v][a],
                    Some(pull) => force[v][a] + pull[v][a] * pulling,
                };
                let total = pulled - ground[v] * now[v][a];
                let speed = velocity[v][a] + dt * (total * inverse[v] - drag * velocity[v][a]);
                velocity[v][a] = speed;
                next[v][a] = now[v][a] + dt * speed;
            }
        }
    }
}

impl<'a> Motion<'a> {
    pub(super) fn at_rest(body: &'a Body, drives: &'a Drives, drag: f64) -> Self {
        let inverse = |(m, moved): (&f64, &bool)| if *moved { 0.0 } else { 1.0 / m };
        Self {
            body,
            drives,
            inverse_mass: body.mass.iter().zip(&drives.is_moved).map(inverse).collect(),
            pull: if drives.force.iter().all(|f| *f == [0.0; 3]) {
                Vec::new()
            } else {
                padded(&drives.force)
            },
            drag,
            now: vec![[0.0; 4]; body.vertices.len()],
            next: vec![[0.0; 4]; body.vertices.len()],
            velocity: vec![[0.0; 4]; body.loose],
            force: vec![[0.0; 4]; body.loose],
        }
    }

    /// Displacements (mm) of all vertices.
    pub(super) fn moved(&self) -> Vec<[f64; 3]> {
        unpadded(&self.now)
    }

    /// One step of `dt` (s). Handles pull with the fraction `pulling` of their force, and have moved by the fraction
    /// `reached` at its end.
    pub(super) fn step(&mut self, dt: f64, pulling: f64, reached: f64) {
        let Self { body, drives, inverse_mass, pull, drag, now, next, velocity, force } = self;
        let of = |(chunk, ((next, velocity), force)): (usize, ((&mut Padded, &mut Padded), &mut Padded))| {
            let first = chunk * CHUNK;
            let within = first..first + next.len();
            let (ground, inverse_mass) = (&body.ground[within.clone()], &inverse_mass[within.clone()]);
            let (drag, pull) = (*drag, pull.get(within));
            let step = Step { dt, drag, pulling, ground, inverse_mass, pull, next, velocity, first };
            body.springs.on_padded(chunk, now, force, step);
        };
        let loose = &mut next[..body.loose];
        if body.springs.worth_sharing() {
            let both = loose.par_chunks_mut(CHUNK).zip(velocity.par_chunks_mut(CHUNK));
            both.zip(force.par_chunks_mut(CHUNK)).enumerate().for_each(of);
        } else {
            let both = loose.chunks_mut(CHUNK).zip(velocity.chunks_mut(CHUNK));
            both.zip(force.chunks_mut(CHUNK)).enumerate().for_each(of);
        }
        drives.place(next, reached);
        std::mem::swap(now, next);
    }

    /// Energy of springs, ground springs and motion (nJ).
    pub(super) fn energy(&self) -> f64 {
        let speeds = self.body.mass.iter().zip(&self.velocity).zip(&self.drives.is_moved);
        let kinetic: f64 = speeds
            .filter(|(_, moved)| !**moved)
            .map(|((m, v), _)| 0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
            .sum();
        self.body.energy(&self.moved()) + kinetic
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
    let stable = match params.springs.dt {
        Some(dt) => dt.min(longest_step(body, drives, params.springs.drag, STABLE)),
        None => longest_step(body, drives, params.springs.drag, CALM).min(params.springs.duration / 32.0),
    };
    let wanted = params.springs.steps(stable);
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
    let dt = params.springs.duration / wanted;
    exec.observer().begin(TASK, steps as u64);
    let (every, frame_every) = (steps.div_ceil(REPORTS), steps / params.springs.frames);
    let mut motion = Motion::at_rest(body, drives, params.springs.drag);
    let mut outcome = Outcome { steps, dt, ..Outcome::default() };
    let mut reached = params.springs.reached(0.0);
    for step in 1..=steps {
        if step % 16 == 0 {
            exec.check_cancelled()?;
        }
        let pulling = reached;
        reached = params.springs.reached(params.springs.duration * (step as f64 / wanted));
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
            outcome.frames.push(motion.moved());
        }
        exec.observer().advance(TASK, 1);
    }
    if steps == 1 {
        outcome.energies[1] = outcome.energies[0];
    }
    exec.observer().end(TASK);
    Ok(outcome)
}
