//! From rest to what is prescribed, in as many steps as that takes.

use ivd_core::{Error, Exec};

use crate::conjugate::{self, Triple, add};
use crate::newton::Balance;
use crate::system::Body;
use crate::tangent::Tangent;

/// What is left of the forces on the way, relative to those that cancel.
const LOOSE: f64 = 0.3;
/// The same once a part of the way found no balance: what is carried along too far from one leads astray.
const CLOSE: f64 = 1e-2;
/// Newton's steps for a part of the way, and in the end.
const FEW: u32 = 6;
const STEPS: u32 = 60;
/// What may be left on the way where these steps don't suffice.
const ASTRAY: f64 = 0.5;
/// Tolerance and iterations of the equations of a start.
const START: f64 = 0.03;
const ITERATIONS: u32 = 300;
/// Times that a start is halved.
const HALVINGS: u32 = 5;
/// The shortest part of the way.
const LEAST: f64 = 1.0 / 64.0;
/// States gone through that a stop may go back to; beyond these every other is forgotten. And Newton's steps from each.
const KEPT: usize = 16;
const SETTLING: u32 = 20;

/// What nodes are told to do.
pub struct Course<'a> {
    /// Nodes that go where they are told; held ones.
    pub nodes: &'a [u32],
    /// Their motions (mm) after a share of the way (0…1).
    pub goals: &'a (dyn Fn(f64) -> Vec<Triple> + Sync),
    /// Forces at all nodes at the end of the way (modulus · mm²).
    pub loads: &'a [Triple],
    /// What is left of the forces at the end, relative to those that cancel.
    pub tolerance: f64,
    /// Whether it ends in balance as far as it comes, where that isn't the whole way.
    pub stops: bool,
}

/// How far a body came.
#[derive(Debug, Clone, Copy, Default)]
pub struct Arrival {
    /// The share of the way that was gone: 1 where nothing stops it. Less, the forces cancel there as closely as at the end only if the course
    /// stops; else it is what was come near to.
    pub share: f64,
    /// Parts that it was gone in.
    pub parts: u32,
    /// Energy after the first part, and at the end (modulus · mm³).
    pub energies: [f64; 2],
    /// What is left at the end; steps and iterations of all.
    pub balance: Balance,
}

/// Where a part of the way starts from.
struct Start {
    /// The nodes' motion (mm), and the share at which that is; `None` where every step along the tangent folds.
    found: Option<(Vec<Triple>, f64)>,
    iterations: u32,
}

impl Body {
    /// Takes the nodes where they are told to go, and finds for all others where the forces cancel.
    ///
    /// Each part of the way starts along the tangent: what all nodes would do if matter were linear there, as far as that keeps `J > 0`. A part
    /// that finds no balance is halved, down to a 64th of the way.
    ///
    /// - `u`: the nodes' motion (mm), at rest at first.
    ///
    /// # Errors
    /// The memory limit, cancelled.
    pub fn go(&mut self, u: &mut Vec<Triple>, course: &Course<'_>, exec: &Exec) -> Result<Arrival, Error> {
        let mut arrival = Arrival::default();
        let (mut step, mut loose) = (1.0, LOOSE);
        let mut passed: Vec<(f64, Vec<Triple>)> = Vec::new();
        let observer = exec.observer();
        observer.begin("equilibrium", 64);
        let gone = loop {
            if arrival.share >= 1.0 || step < LEAST {
                break Ok(());
            }
            let to = (arrival.share + step).min(1.0);
            let start = match self.start(u, course, arrival.share, to, exec) {
                Ok(start) => start,
                Err(error) => break Err(error),
            };
            arrival.balance.iterations += start.iterations;
            let Some((mut next, share)) = start.found else {
                step /= 2.0;
                continue;
            };
            let (tolerance, limit) = if share < 1.0 { (loose, FEW) } else { (course.tolerance, STEPS) };
            self.load(course, share);
            let balance = match self.balance(&mut next, tolerance, limit, exec) {
                Ok(balance) => balance,
                Err(error) => break Err(error),
            };
            let so_far = arrival.balance;
            let (steps, iterations) = (so_far.steps + balance.steps, so_far.iterations + balance.iterations);
            // On the way it is enough to be near; what is left is made up for by the next part.
            if !balance.reached && (share >= 1.0 || balance.residual > ASTRAY) {
                arrival.balance = Balance { iterations, steps, ..so_far };
                (step, loose) = ((share - arrival.share) / 2.0, CLOSE);
                continue;
            }
            step = (2.0 * (share - arrival.share)).max(LEAST);
            observer.advance("equilibrium", (64.0 * share) as u64 - (64.0 * arrival.share) as u64);
            let energy = self.energy(&next).map_or(0.0, |energy| energy.0);
            arrival.parts += 1;
            arrival.energies = [if arrival.parts == 1 { energy } else { arrival.energies[0] }, energy];
            arrival.share = share;
            arrival.balance = Balance { iterations, steps, ..balance };
            *u = next;
            if course.stops {
                passed.push((share, u.clone()));
                if passed.len() > KEPT {
                    // The first and the last stay.
                    let every_other = passed.into_iter().step_by(2);
                    passed = every_other.collect();
                }
            }
        };
        observer.end("equilibrium");
        gone?;
        if arrival.share < 1.0 && course.stops {
            self.stop(u, course, passed, &mut arrival, exec)?;
        }
        self.load(course, arrival.share);
        Ok(arrival)
    }

    /// Goes back to the last state from which the forces cancel as closely as they are to at the end; to rest where there is none.
    fn stop(
        &mut self,
        u: &mut Vec<Triple>,
        course: &Course<'_>,
        passed: Vec<(f64, Vec<Triple>)>,
        arrival: &mut Arrival,
        exec: &Exec,
    ) -> Result<(), Error> {
        arrival.share = 0.0;
        for (share, mut state) in passed.into_iter().rev() {
            self.load(course, share);
            let found = self.balance(&mut state, course.tolerance, SETTLING, exec)?;
            let Balance { steps, iterations, .. } = arrival.balance;
            arrival.balance =
                Balance { steps: steps + found.steps, iterations: iterations + found.iterations, ..found };
            if found.reached {
                arrival.share = share;
                arrival.energies[1] = self.energy(&state).map_or(0.0, |energy| energy.0);
                *u = state;
                return Ok(());
            }
        }
        u.fill([0.0; 3]);
        Ok(())
    }

    fn load(&mut self, course: &Course<'_>, share: f64) {
        self.loads.clear();
        self.loads.extend(course.loads.iter().map(|force| force.map(|c| c * share)));
    }

    /// Where a part of the way starts from.
    fn start(
        &mut self,
        u: &[Triple],
        course: &Course<'_>,
        from: f64,
        to: f64,
        exec: &Exec,
    ) -> Result<Start, Error> {
        self.load(course, to);
        let mut told = vec![[0.0; 3]; u.len()];
        for (&node, goal) in course.nodes.iter().zip((course.goals)(to)) {
            let now = u[node as usize];
            told[node as usize] = std::array::from_fn(|a| goal[a] - now[a]);
        }
        let mut left = self.forces(u).left;
        add(&mut left, &Tangent::new(self, u, false, exec)?.times(&told), 1.0);
        for force in &mut left {
            *force = force.map(|c| -c);
        }
        let follow = conjugate::solve(&Tangent::new(self, u, true, exec)?, &left, START, ITERATIONS, exec)?;
        let mut part = 1.0;
        for _ in 0..=HALVINGS {
            let share = if part == 1.0 { to } else { from + part * (to - from) };
            let mut next = u.to_vec();
            add(&mut next, &follow.values, part);
            for (&node, goal) in course.nodes.iter().zip((course.goals)(share)) {
                next[node as usize] = goal;
            }
            if self.energy(&next).is_some() {
                return Ok(Start { found: Some((next, share)), iterations: follow.iterations });
            }
            part /= 2.0;
        }
        Ok(Start { found: None, iterations: follow.iterations })
    }
}
