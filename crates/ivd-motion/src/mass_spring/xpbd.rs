//! Extended position-based dynamics (Macklin, Müller & Chentanez 2016): every spring a compliant constraint, one after the
//! other in their order.
//!
//! It is here to compare. A sweep leaves what it moved along the springs' earlier directions as it is, so that it ends near
//! the objective's minimum, not at it, and nearer for shorter steps; what is left depends on the springs' order.

use ivd_core::Exec;
use nalgebra::Vector3;

use super::body::Body;
use super::drives::Drives;
use super::objective::PutIn;
use super::outcome::Outcome;
use super::params::Params;
use super::projective::step_through;
use super::spring::{LIMITED, Spring, Vectors};
use crate::Error;

/// Sweeps between two looks at the gradient, which costs as much as one.
const SWEEPS: usize = 8;
/// Looks without a gradient less than the least before it, after which nothing more is to be gained.
const PATIENCE: usize = 12;

/// Implicit Euler, each step by sweeps over the springs until its relative gradient is at most the tolerance.
pub(super) fn run(body: &Body, drives: &Drives, params: &Params, exec: &Exec) -> Result<Outcome, Error> {
    step_through(body, drives, params, "xpbd", exec, |objective, moved| {
        let inertia = objective.inertia.expect("implicit steps have inertia");
        let mut sweep = Sweep::new(body, drives, &inertia.stiffness);
        for v in 0..body.loose {
            for a in 0..3 {
                let pulled = drives.force[v][a] * objective.reached * sweep.softness[v];
                moved[v][a] = inertia.anchor[v][a] + pulled;
            }
        }
        drives.place(moved, objective.reached);
        let mut gradient = vec![[0.0; 3]; body.loose];
        let (mut sweeps, mut put_in) = (0, PutIn::default());
        let (mut least, mut idle) = (f64::INFINITY, 0);
        loop {
            exec.check_cancelled()?;
            let relative = objective.gradient(moved, &mut gradient, &mut put_in);
            idle = if relative < 0.99 * least { 0 } else { idle + 1 };
            least = least.min(relative);
            if relative <= params.closeness.tolerance
                || sweeps >= params.closeness.max_iterations
                || idle > PATIENCE
            {
                return Ok((sweeps, relative));
            }
            for _ in 0..SWEEPS.min(params.closeness.max_iterations - sweeps) {
                sweep.once(body, moved);
                sweeps += 1;
            }
        }
    })
}

/// The multipliers of a step, which are the springs' forces (µN, negative where they pull).
struct Sweep {
    /// 1 / inertia of each vertex (s²/g): 0 of a moved or held one.
    softness: Vec<f64>,
    spring: Vec<f64>,
    limit: Vec<f64>,
    ground: Vec<[f64; 3]>,
}

impl Sweep {
    fn new(body: &Body, drives: &Drives, inertia: &[f64]) -> Self {
        let mut softness: Vec<f64> = inertia
            .iter()
            .zip(&drives.is_moved)
            .map(|(a, moved)| if *moved { 0.0 } else { 1.0 / a })
            .collect();
        softness.resize(body.vertices.len(), 0.0);
        let limits = if body.springs.law().limit.is_some() { body.list.len() } else { 0 };
        let ground = vec![[0.0; 3]; body.loose];
        Self { softness, spring: vec![0.0; body.list.len()], limit: vec![0.0; limits], ground }
    }

    fn once(&mut self, body: &Body, moved: &mut Vectors) {
        for (s, spring) in body.list.iter().enumerate() {
            let rest = [spring.length, spring.stiffness];
            correct(spring, rest, !body.springs.law().push, &mut self.spring[s], &self.softness, body, moved);
            if let Some(limit) = body.springs.law().limit {
                let beyond = [spring.length * (1.0 + limit), LIMITED * spring.stiffness];
                correct(spring, beyond, true, &mut self.limit[s], &self.softness, body, moved);
            }
        }
        for v in 0..body.loose {
            let (softness, ground) = (self.softness[v], body.ground[v]);
            if ground > 0.0 && softness > 0.0 {
                for a in 0..3 {
                    let pull = &mut self.ground[v][a];
                    let more = (-moved[v][a] - *pull / ground) / (softness + 1.0 / ground);
                    *pull += more;
                    moved[v][a] += softness * more;
                }
            }
        }
    }
}

/// Solves one constraint `length = rest` of a stiffness by itself; with `pulls`, only while it is longer.
fn correct(
    spring: &Spring,
    [rest, stiffness]: [f64; 2],
    pulls: bool,
    multiplier: &mut f64,
    softness: &[f64],
    body: &Body,
    moved: &mut Vectors,
) {
    let [i, j] = spring.ends.map(|v| v as usize);
    let soft = softness[i] + softness[j];
    let from = |v: usize, moved: &Vectors| Vector3::from(body.rest[v]) + Vector3::from(moved[v]);
    let apart = from(j, moved) - from(i, moved);
    let length = apart.norm();
    if soft == 0.0 || length <= 0.0 {
        return;
    }
    let mut next = *multiplier + (rest - length - *multiplier / stiffness) / (soft + 1.0 / stiffness);
    if pulls {
        next = next.min(0.0);
    }
    let push = apart * ((next - *multiplier) / length);
    *multiplier = next;
    for a in 0..3 {
        moved[i][a] -= softness[i] * push[a];
        moved[j][a] += softness[j] * push[a];
    }
}
