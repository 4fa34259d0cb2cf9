//! From rest to what is prescribed, in as many steps as that takes.

use std::collections::BTreeSet;

use ivd_core::{Error, Exec};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::conjugate;
use crate::newton::Balance;
use crate::system::Body;
use crate::tangent::Tangent;
use crate::vectors::{Triple, add};

/// What is left of the forces on the way, relative to those that cancel.
const LOOSE: f64 = 0.2;
/// The same once a part of the way found no balance: what is carried along too far from one leads astray.
const CLOSE: f64 = 1e-2;
/// Newton's steps for a part of the way, and in the end.
const FEW: u32 = 6;
const STEPS: u32 = 60;
/// What may be left on the way where these steps don't suffice.
const ASTRAY: f64 = 0.5;
/// Tolerance and iterations of the equations of a start.
const START: f64 = 0.1;
const ITERATIONS: u32 = 300;
/// Times that a start is halved, each time it is to be unfolded, and cells beyond which that isn't tried.
const HALVINGS: u32 = 5;
const UNFOLDINGS: u32 = 6;
const FOLDED: usize = 200;
/// The shortest part of the way.
const LEAST: f64 = 1.0 / 64.0;
/// States gone through that a stop may go back to; beyond these every other is forgotten. And Newton's steps from each.
const KEPT: usize = 16;
const SETTLING: u32 = 12;
/// Times that the place of a stop is halved between the last balance and the first without.
const CLOSER: u32 = 4;

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
    /// The nodes' motion (mm), and the share at which that is; `None` where every step along the tangent folds too much.
    found: Option<(Vec<Triple>, f64)>,
    iterations: u32,
}

impl Body {
    /// Takes the nodes where they are told to go, and finds for all others where the forces cancel.
    ///
    /// Each part of the way starts along the tangent: what all nodes would do if matter were linear there, as far as that keeps `J > 0` or can be
    /// unfolded. A part that finds no balance is halved, down to a 64th of the way.
    ///
    /// - `u`: the nodes' motion (mm), at rest at first.
    ///
    /// # Errors
    /// The memory limit, cancelled.
    pub fn go(&mut self, u: &mut Vec<Triple>, course: &Course<'_>, exec: &Exec) -> Result<Arrival, Error> {
        let mut arrival = Arrival::default();
        let (mut step, mut loose) = (1.0, LOOSE);
        let mut passed: Vec<(f64, Vec<Triple>)> = Vec::new();
        let mut beyond = 1.0;
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
                (step, beyond) = (step / 2.0, to);
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
                (step, loose, beyond) = ((share - arrival.share) / 2.0, CLOSE, share);
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
            self.stop(u, course, passed, beyond, &mut arrival, exec)?;
        }
        self.load(course, arrival.share);
        Ok(arrival)
    }

    /// Goes back to the last state from which the forces cancel as closely as they are to at the end, and from there a few times halfway to the first
    /// share at which they don't; to rest where there is none.
    ///
    /// - `beyond`: a share from which no way was found on.
    fn stop(
        &mut self,
        u: &mut Vec<Triple>,
        course: &Course<'_>,
        mut passed: Vec<(f64, Vec<Triple>)>,
        mut beyond: f64,
        arrival: &mut Arrival,
        exec: &Exec,
    ) -> Result<(), Error> {
        // Of the states before `good` the forces cancel, of those from `bad` on they don't: farther and farther back, then by halves.
        let (mut good, mut bad, mut back) = (0, passed.len(), 1);
        arrival.share = 0.0;
        while good < bad {
            let tried = if good == 0 { bad.saturating_sub(back) } else { good + (bad - good) / 2 };
            let (share, mut state) = (passed[tried].0, std::mem::take(&mut passed[tried].1));
            if self.settle(&mut state, course, share, arrival, exec)? {
                (*u, good) = (state, tried + 1);
            } else {
                (beyond, bad, back) = (share, tried, 2 * back);
            }
        }
        if good == 0 {
            u.fill([0.0; 3]);
            arrival.energies[1] = 0.0;
            (arrival.balance.residual, arrival.balance.reached) = (0.0, false);
            return Ok(());
        }
        for _ in 0..CLOSER {
            let middle = 0.5 * (arrival.share + beyond);
            let start = self.start(u, course, arrival.share, middle, exec)?;
            arrival.balance.iterations += start.iterations;
            let Some((mut next, share)) = start.found else {
                beyond = middle;
                continue;
            };
            if self.settle(&mut next, course, share, arrival, exec)? {
                *u = next;
            } else {
                beyond = share;
            }
        }
        Ok(())
    }

    /// Balances a state at a share of the way as closely as at the end. If that is reached the body has arrived there.
    fn settle(
        &mut self,
        state: &mut Vec<Triple>,
        course: &Course<'_>,
        share: f64,
        arrival: &mut Arrival,
        exec: &Exec,
    ) -> Result<bool, Error> {
        self.load(course, share);
        let found = self.balance(state, course.tolerance, SETTLING, exec)?;
        let so_far = arrival.balance;
        let (steps, iterations) = (so_far.steps + found.steps, so_far.iterations + found.iterations);
        let nearest = if found.reached { found } else { so_far };
        arrival.balance = Balance { iterations, steps, ..nearest };
        if !found.reached {
            return Ok(false);
        }
        arrival.share = share;
        arrival.energies[1] = self.energy(state).map_or(0.0, |energy| energy.0);
        Ok(true)
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
            if self.unfold(&mut next) {
                return Ok(Start { found: Some((next, share)), iterations: follow.iterations });
            }
            part /= 2.0;
        }
        Ok(Start { found: None, iterations: follow.iterations })
    }

    /// Moves free nodes of folded cells to the middle of what is round them, a few times, if these cells are few; whether none is left folded.
    pub(crate) fn unfold(&self, u: &mut [Triple]) -> bool {
        let mesh = &self.mesh;
        let is_folded =
            |cell: &usize, u: &[Triple]| self.cell_energy(*cell, &mesh.gather(*cell, u)).is_none();
        let mut folded: Vec<usize> =
            (0..mesh.cells.len()).into_par_iter().filter(|cell| is_folded(cell, u)).collect();
        for _ in 0..UNFOLDINGS {
            if folded.is_empty() || folded.len() > FOLDED {
                break;
            }
            let corners = folded.iter().flat_map(|&cell| (0..8).map(move |corner| (cell, corner)));
            let nodes: BTreeSet<usize> = corners
                .flat_map(|(cell, corner)| mesh.corner(cell, corner))
                .map(|(node, _)| *node as usize)
                .filter(|node| !mesh.held[*node])
                .collect();
            for &node in &nodes {
                let corners =
                    self.touched(node).iter().flat_map(|touched| (0..8).map(|corner| (touched.0, corner)));
                let others = corners
                    .flat_map(|(cell, corner)| mesh.corner(cell as usize, corner))
                    .filter(|(other, _)| *other as usize != node);
                let (sum, weights) =
                    others.fold((Vector3::zeros(), 0.0), |(sum, weights), (other, weight)| {
                        (sum + Vector3::from(u[*other as usize]) * *weight, weights + weight)
                    });
                u[node] = (sum / weights).into();
            }
            let touched = nodes.iter().flat_map(|&node| self.touched(node)).map(|(cell, ..)| *cell as usize);
            let cells: BTreeSet<usize> = touched.chain(folded).collect();
            folded = cells.into_iter().filter(|cell| is_folded(cell, u)).collect();
        }
        folded.is_empty()
    }
}
