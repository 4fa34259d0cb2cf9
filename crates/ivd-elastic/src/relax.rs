//! Nodes whose forces stand out, moved by themselves before all nodes are: nonlinear elimination.
//!
//! Where matter is pressed to nearly nothing its law bends so sharply that most of what is left of the forces lies in a few nodes. Newton's step
//! for all of them would be one for these, and each costs as much as thousands of steps of single nodes.
//!
//! Source: Lanzkron, Rose & Wilkes 1996 (An analysis of approximate nonlinear elimination).

use std::collections::HashSet;

use ivd_core::{Error, Exec};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::newton::is_less;
use crate::slopes::Corners;
use crate::system::{Body, Forces};
use crate::tangent::Blocks;
use crate::vectors::Triple;

/// A node stands out by this share of what is left of the forces; those that do, fewer than 400, are moved if they have half of it (of the squares).
const STANDS_OUT: f64 = 0.05;
const SHARE: f64 = 0.5;
/// What may be left after a round at most, of what was, for another one to be worth its while.
const GAIN: f64 = 0.9;
/// Times that they are chosen anew, times that all of them are gone through, and Newton's steps of each.
const ROUNDS: u32 = 4;
const SWEEPS: u32 = 4;
const STEPS: u32 = 2;
/// A node rests when its force is this share of what would stand out.
const RESTS: f64 = 0.1;
/// Halvings of a step before it is given up.
const HALVINGS: i32 = 20;

impl Body {
    /// Moves single nodes, one after the other, while forces stand out, more than `tolerance` of those that cancel is left, and that gets less by a
    /// tenth or more with each round; a few rounds at most. The energy doesn't rise, but for rounding, and J stays above 0; what is left of the
    /// forces may. Says whether any was moved.
    ///
    /// - `forces`: those at `u`, before and after.
    ///
    /// # Errors
    /// Cancelled.
    pub(crate) fn relax_worst(
        &self,
        u: &mut [Triple],
        forces: &mut Forces,
        tolerance: f64,
        exec: &Exec,
    ) -> Result<bool, Error> {
        for round in 0..ROUNDS {
            let left_mm = forces.left_mm();
            let stands_out = |node: &usize| forces.left_by_node[*node] > STANDS_OUT * left_mm;
            let worst: Vec<usize> = (0..u.len()).filter(stands_out).collect();
            let theirs: f64 = worst.iter().map(|&node| forces.left_by_node[node].powi(2)).sum();
            let spread = theirs < SHARE * left_mm * left_mm;
            if left_mm <= tolerance * forces.cancelled_mm || spread {
                return Ok(round > 0);
            }
            let blocks = Blocks::new(self);
            let still = |node: usize| {
                // As a force: against what resists there.
                let stiffness = Vector3::from(forces.left[node]).norm() / forces.left_by_node[node];
                RESTS * STANDS_OUT * left_mm * stiffness
            };
            let apart = self.apart(&worst);
            for _ in 0..SWEEPS {
                exec.check_cancelled()?;
                for nodes in &apart {
                    let moved = |&node: &usize| (node, self.relaxed(node, u, still(node), &blocks));
                    let moved: Vec<(usize, Triple)> = nodes.par_iter().map(moved).collect();
                    for (node, to) in moved {
                        u[node] = to;
                    }
                }
            }
            *forces = self.forces(u);
            if forces.left_mm() > GAIN * left_mm {
                break;
            }
        }
        Ok(true)
    }

    /// Nodes in groups, in each of which no two are of one cell.
    pub(crate) fn apart(&self, nodes: &[usize]) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut taken: HashSet<(usize, u32)> = HashSet::new();
        for &node in nodes {
            let cells = || self.touched(node).iter().map(|touched| touched.0);
            let is_free = |group: &usize| cells().all(|cell| !taken.contains(&(*group, cell)));
            let group = (0..=groups.len()).find(is_free).expect("one of its own is");
            groups.resize_with(groups.len().max(group + 1), Vec::new);
            groups[group].push(node);
            taken.extend(cells().map(|cell| (group, cell)));
        }
        groups
    }

    /// Where Newton's steps take a node, all others at rest; none while its force is less than `still`.
    fn relaxed(&self, node: usize, u: &[Triple], still: f64, blocks: &Blocks<'_>) -> Triple {
        let mut own = Vector3::from(u[node]);
        for _ in 0..STEPS {
            let touched = self.touched(node).iter().map(|&(cell, corner, weight)| {
                let (cell, corner) = (cell as usize, usize::from(corner));
                (cell, corner, weight, self.gather_with(cell, u, node, &own))
            });
            let touched: Vec<(usize, usize, f64, Corners)> = touched.collect();
            let load = Vector3::from(self.loads[node]);
            let force = touched.iter().fold(-load, |sum, (cell, corner, weight, corners)| {
                sum + Vector3::from(self.cell_force(*cell, corners).0[*corner]) * *weight
            });
            if force.norm() < still {
                break;
            }
            let block: Matrix3<f64> = touched
                .iter()
                .map(|(cell, corner, weight, corners)| blocks.of(*cell, *corner, corners) * (weight * weight))
                .sum();
            let Some(factor) = block.cholesky() else { break };
            let way = -factor.solve(&force);
            let Some(now) = self.energy_round(node, u, &own) else { break };
            let slope = force.dot(&way);
            let mut steps = (0..HALVINGS).map(|halving| 0.5_f64.powi(halving));
            let goes = |step: &f64| {
                let next = self.energy_round(node, u, &(own + way * *step));
                next.is_some_and(|next| is_less(next.0, now, step * slope))
            };
            let Some(step) = steps.find(goes) else { break };
            own += way * step;
        }
        own.into()
    }

    /// The values at a cell's corners, with a node's own.
    fn gather_with(&self, cell: usize, u: &[Triple], node: usize, own: &Vector3<f64>) -> Corners {
        self.mesh
            .gather_of(cell, |other| if other as usize == node { own.as_ref() } else { &u[other as usize] })
    }

    /// The energy that depends on a node, and the size of its terms; `None` where J ≤ 0.
    fn energy_round(&self, node: usize, u: &[Triple], own: &Vector3<f64>) -> Option<(f64, f64)> {
        let load = Vector3::from(self.loads[node]).dot(own);
        let mut total = (-load, load.abs());
        // A cell's corners that hang on the node lie beside each other.
        for run in self.touched(node).chunk_by(|a, b| a.0 == b.0) {
            let cell = run[0].0 as usize;
            let part = self.cell_energy(cell, &self.gather_with(cell, u, node, own))?;
            total = (total.0 + part.0, total.1 + part.1);
        }
        Some(total)
    }
}
