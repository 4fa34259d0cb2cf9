//! Fields that go hardly further than what is followed. Bent plates do beside a bump; a membrane beside the bending holds them back.

use std::ops::Deref;

use ivd_core::{Exec, Lattice};
use nalgebra::Vector3;

use super::super::outcome::misfit as misfit_of;
use super::matrix::Triple;
use super::nodes::Cells;
use super::step::Step;
use super::system::System;
use super::{Biharmonic, CLOSE, Job, Made, longest};
use crate::Error;

/// Weights of a membrane's energy beside the bending, in units of their diagonals.
const TENSIONS: [f64; 4] = [0.03, 0.3, 3.0, 30.0];

/// Nodes are ruled out that go beyond the bound by this many times what the last iteration has changed of how far they go, ...
const CHANGES: f64 = 4.0;
/// ... and by this many times the residual of their equations, ...
const RESIDUALS: f64 = 20.0;
/// ... from this residual on.
const ROUGH: f64 = 1e-3;

/// How far what is inside may go (mm).
pub(super) struct Bound {
    pub(super) most: f64,
    /// Nodes that go as far as a voxel of the part does.
    pub(super) nodes: Vec<u32>,
}

impl Bound {
    /// Whether nodes with such a residual go further, and would if they were found better, as far as can be told.
    ///
    /// - `last`: how far those of the iteration before went.
    pub(super) fn rules_out(&self, nodes: &[Triple], residual: f64, last: &mut f64) -> bool {
        let reach = self.reach(nodes);
        let changed = (reach - std::mem::replace(last, reach)).abs();
        residual <= ROUGH && reach > self.most + (CHANGES * changed).max(RESIDUALS * residual * self.most)
    }

    /// How far those go (mm), a voxel's digits apart.
    fn reach(&self, nodes: &[Triple]) -> f64 {
        let far = |node: &u32| Vector3::from(nodes[*node as usize]).norm_squared();
        self.nodes.iter().map(far).fold(0.0, f64::max).sqrt() * (1.0 - 1e-6)
    }
}

/// Equations that are kept, or aren't.
enum Equations<'a> {
    Kept(&'a System),
    Once(Box<System>),
}

impl Deref for Equations<'_> {
    type Target = System;

    fn deref(&self) -> &System {
        match self {
            Self::Kept(system) => system,
            Self::Once(system) => system,
        }
    }
}

impl<L: Deref<Target = Lattice> + Send + Sync> Biharmonic<L> {
    /// The field of a step, or where voxels go further in it than `most` (mm), that of the least tension under which they don't.
    ///
    /// - `kept`: equations under the first tensions, for these vertices and this region.
    pub(super) fn bounded(
        &self,
        job: &Job<'_>,
        (system, whole): (&System, &mut Step),
        kept: &mut Vec<System>,
        bound: &Bound,
        exec: &Exec,
    ) -> Result<Made, Error> {
        let goes_on = |step: &Step| step.is_rough || bound.reach(&step.nodes) > bound.most;
        if !goes_on(whole) {
            let made = self.make(job, system, whole, exec)?;
            return self.tighten(job, made, kept, (bound.most, 0), Vec::new(), exec);
        }
        let mut steps: Vec<Step> = Vec::new();
        // What goes too far at a node needn't be made to see that.
        for i in 0..TENSIONS.len() {
            exec.check_cancelled()?;
            let tenser = under(job, i);
            let equations = self.under_tension(&tenser, i, kept);
            let step = Self::solve(&tenser, &equations, None, Some(bound), exec)?;
            if goes_on(&step) {
                steps.push(step);
                continue;
            }
            let made = self.make(&tenser, &equations, &step, exec)?;
            drop(equations);
            let left = self.misfit(job, &made);
            if left <= CLOSE {
                return self.tighten(job, made, kept, (bound.most, i + 1), Vec::new(), exec);
            }
            // What was skipped before it decides whether it leaves the lattice behind.
            let before = if let Some(looser) = steps.last_mut() {
                let job = under(job, i - 1);
                let equations = self.under_tension(&job, i - 1, kept);
                Self::finish(&job, &equations, looser, exec)?;
                self.make(&job, &equations, looser, exec)?
            } else {
                Self::finish(job, system, whole, exec)?;
                self.make(job, system, whole, exec)?
            };
            let was = self.misfit(job, &before);
            steps.push(step);
            if was > CLOSE {
                break;
            }
            if left > 2.0 * was {
                return Ok(before);
            }
            return self.tighten(job, made, kept, (bound.most, i + 1), Vec::new(), exec);
        }
        Self::finish(job, system, whole, exec)?;
        let made = self.make(job, system, whole, exec)?;
        self.tighten(job, made, kept, (bound.most, 0), steps, exec)
    }

    /// Finds the nodes of a step as well as if they hadn't been told to go too far.
    fn finish(job: &Job<'_>, system: &System, step: &mut Step, exec: &Exec) -> Result<(), Error> {
        if step.is_rough {
            let iterations = step.iterations;
            *step = Self::solve(job, system, None, None, exec)?;
            step.iterations += iterations;
        }
        Ok(())
    }

    /// The same from one tension on, each after the one before, until voxels stay within the bound or the lattice is left behind.
    ///
    /// - `steps`: those that are known, from there on.
    fn tighten(
        &self,
        job: &Job<'_>,
        mut made: Made,
        kept: &mut Vec<System>,
        (most, from): (f64, usize),
        steps: Vec<Step>,
        exec: &Exec,
    ) -> Result<Made, Error> {
        let mut known = steps.into_iter();
        for i in from..TENSIONS.len() {
            if longest(&made.field) <= most {
                break;
            }
            exec.check_cancelled()?;
            let tenser = under(job, i);
            let equations = self.under_tension(&tenser, i, kept);
            let step = match known.next() {
                Some(mut step) => {
                    Self::finish(&tenser, &equations, &mut step, exec)?;
                    step
                }
                None => Self::solve(&tenser, &equations, None, None, exec)?,
            };
            let tenser = self.make(&tenser, &equations, &step, exec)?;
            // Not at the price of leaving the lattice behind.
            if self.misfit(job, &tenser) > CLOSE.max(2.0 * self.misfit(job, &made)) {
                break;
            }
            made = tenser;
        }
        Ok(made)
    }

    fn misfit(&self, job: &Job<'_>, made: &Made) -> f64 {
        misfit_of(&self.lattice, job.settle.motion, &made.field, job.frame)
    }

    /// The equations under a tension: kept ones, or new ones that a drag keeps.
    fn under_tension<'k>(&self, job: &Job<'_>, i: usize, kept: &'k mut Vec<System>) -> Equations<'k> {
        if kept.len() <= i {
            let cells = Cells::new(self.lattice.grid(), job.room, job.edge);
            let system = self.system(cells, job.room, &self.voxels, job.tension);
            if !self.keeps || kept.len() < i {
                return Equations::Once(Box::new(system));
            }
            kept.push(system);
        }
        Equations::Kept(&kept[i])
    }
}

/// A job under one of the tensions.
fn under<'a>(job: &Job<'a>, i: usize) -> Job<'a> {
    Job { tension: TENSIONS[i], ..*job }
}
