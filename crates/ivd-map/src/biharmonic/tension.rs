//! Fields that go hardly further than what is followed. Bent plates do beside a bump; a membrane beside the bending holds them back.

use std::ops::Deref;

use ivd_core::{Exec, Lattice};

use super::super::outcome::misfit as misfit_of;
use super::nodes::Cells;
use super::step::Step;
use super::system::System;
use super::{Biharmonic, CLOSE, Job, Made, longest};
use crate::Error;

/// Weights of a membrane's energy beside the bending, in units of their diagonals.
const TENSIONS: [f64; 4] = [0.03, 0.3, 3.0, 30.0];

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
        (system, whole): (&System, &Step),
        kept: &mut Vec<System>,
        most: f64,
        exec: &Exec,
    ) -> Result<Made, Error> {
        // A part that moves alone leaves nodes beside it behind.
        let is_alone = job.settle.alone.is_some();
        let goes_on = |step: &Step, system: &System| {
            !is_alone && step.reach_of_nodes(system, job.region, self.lattice.grid()) > most
        };
        if !goes_on(whole, system) {
            let made = self.make(job, system, whole, exec)?;
            return self.tighten(job, made, kept, (most, 0), Vec::new(), exec);
        }
        let mut steps = Vec::new();
        // What goes too far at a node needn't be made to see that.
        for i in 0..TENSIONS.len() {
            exec.check_cancelled()?;
            let tenser = under(job, i);
            let equations = self.under_tension(&tenser, i, kept);
            let step = self.solve(&tenser, &equations, None, exec)?;
            if goes_on(&step, &equations) {
                steps.push(step);
                continue;
            }
            let made = self.make(&tenser, &equations, &step, exec)?;
            drop(equations);
            let left = self.misfit(job, &made);
            if left <= CLOSE {
                return self.tighten(job, made, kept, (most, i + 1), Vec::new(), exec);
            }
            // What was skipped before it decides whether it leaves the lattice behind.
            let before = match steps.last() {
                None => self.make(job, system, whole, exec)?,
                Some(step) => {
                    let looser = under(job, i - 1);
                    let equations = self.under_tension(&looser, i - 1, kept);
                    self.make(&looser, &equations, step, exec)?
                }
            };
            let was = self.misfit(job, &before);
            steps.push(step);
            if was > CLOSE {
                break;
            }
            if left > 2.0 * was {
                return Ok(before);
            }
            return self.tighten(job, made, kept, (most, i + 1), Vec::new(), exec);
        }
        let made = self.make(job, system, whole, exec)?;
        self.tighten(job, made, kept, (most, 0), steps, exec)
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
                Some(step) => step,
                None => self.solve(&tenser, &equations, None, exec)?,
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
            let cells = Cells::new(self.lattice.grid(), job.region, job.edge);
            let system = self.system(cells, job.region, &self.voxels, job.tension);
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
    Job { tension: TENSIONS[i], motions: job.motions.clone(), ..*job }
}
