//! Fields that go hardly further than what is followed. Bent plates do beside a bump; a membrane beside the bending holds them back.

use std::ops::Deref;

use ivd_core::{Exec, Lattice};
use nalgebra::{Matrix3, Vector3};

use super::super::outcome::misfit as misfit_of;
use super::bound::Bound;
use super::nodes::Cells;
use super::step::Step;
use super::system::System;
use super::{Biharmonic, CLOSE, Job, Made};
use crate::Error;

/// Weights of a membrane's energy beside the bending, in units of their diagonals.
const TENSIONS: [f64; 4] = [0.03, 0.3, 3.0, 30.0];

/// Halves that are tried between two of them.
const HALVINGS: usize = 3;

/// The sum of motions over that of their lengths from which on they go one way, ...
const ONE_WAY: f64 = 0.95;
/// ... or do by and large, ...
const MOSTLY_ONE_WAY: f64 = 0.5;
/// ... where a turn of them all makes less than this share.
const TURNED: f64 = 0.1;

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
    /// Whether what is to be followed goes one way, so that nothing has a reason to go further: all of it nearly, or by and large and not as a
    /// whole that is turned, as a dent does with its rim. Beyond a part that turns space turns further.
    pub(super) fn goes_one_way(&self, motions: &[Vector3<f64>]) -> bool {
        let followed = motions.iter().zip(&self.constrains).filter(|(_, constrains)| **constrains);
        let (sum, lengths) = followed.fold((Vector3::zeros(), 0.0), |(sum, lengths), (motion, _)| {
            (sum + motion, lengths + motion.norm())
        });
        let share = sum.norm() / lengths;
        lengths == 0.0 || share >= ONE_WAY || share >= MOSTLY_ONE_WAY && self.turned(motions) < TURNED
    }

    /// The share of the motions, squared and weighed by how far they go, that a turn of all together makes.
    fn turned(&self, motions: &[Vector3<f64>]) -> f64 {
        let all = self.positions.iter().zip(motions).zip(&self.constrains);
        let followed = all.filter(|((_, motion), constrains)| **constrains && **motion != Vector3::zeros());
        let followed = followed.map(|((at, motion), _)| (motion.norm(), at, motion));
        let (weight, at, motion) = followed.clone().fold(
            (0.0, Vector3::zeros(), Vector3::zeros()),
            |(sum, ats, motions), (weight, at, motion)| {
                (sum + weight, ats + at * weight, motions + motion * weight)
            },
        );
        let (centre, mean) = (at / weight, motion / weight);
        let (mut inertia, mut momentum, mut whole) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
        for (weight, at, motion) in followed {
            let arm = at - centre;
            inertia += (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * weight;
            momentum += arm.cross(&(motion - mean)) * weight;
            whole += motion.norm_squared() * weight;
        }
        // Along a line there is nothing to be turned.
        let turn = inertia.cholesky().map(|inertia| inertia.solve(&momentum));
        turn.map_or(0.0, |turn| turn.dot(&momentum) / whole)
    }

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
                return self.halfway(job, i, bound.most, before, exec);
            }
            return self.tighten(job, made, kept, (bound.most, i + 1), Vec::new(), exec);
        }
        Self::finish(job, system, whole, exec)?;
        let made = self.make(job, system, whole, exec)?;
        self.tighten(job, made, kept, (bound.most, 0), steps, exec)
    }

    /// A field between that of a tension, which leaves the lattice behind, and that of the looser one before it, which goes further than it may: the one that goes
    /// least far of those that were tried and follow, by halves in orders of magnitude.
    fn halfway(&self, job: &Job<'_>, i: usize, most: f64, looser: Made, exec: &Exec) -> Result<Made, Error> {
        let before = if i > 0 { TENSIONS[i - 1] } else { TENSIONS[0] * TENSIONS[0] / TENSIONS[1] };
        let (mut best, mut ends) = (looser, [before, TENSIONS[i]]);
        for _ in 0..HALVINGS {
            exec.check_cancelled()?;
            let tension = (ends[0] * ends[1]).sqrt();
            let between = Job { tension, ..*job };
            let system = self.system_of(&between);
            let step = Self::solve(&between, &system, None, None, exec)?;
            let made = self.make(&between, &system, &step, exec)?;
            let (follows, far) = (self.misfit(job, &made) <= CLOSE, made.field.longest());
            ends[usize::from(!follows)] = tension;
            if follows && far < best.field.longest() {
                best = made;
            }
            if follows && far <= most {
                break;
            }
        }
        Ok(best)
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
            if made.field.longest() <= most {
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

    /// The equations of a job.
    fn system_of(&self, job: &Job<'_>) -> System {
        self.system(Cells::new(self.lattice.grid(), job.room, job.edge), job.room, &self.voxels, job.tension)
    }

    /// The equations under a tension: kept ones, or new ones that a drag keeps.
    fn under_tension<'k>(&self, job: &Job<'_>, i: usize, kept: &'k mut Vec<System>) -> Equations<'k> {
        if kept.len() <= i {
            let system = self.system_of(job);
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

#[cfg(test)]
mod tests {
    use ivd_core::{Exec, Grid};
    use ivd_field::fixtures::{middle, voxels};
    use nalgebra::{Rotation3, Vector3};

    use super::super::tests::{bar, bumped, radial, shear, smooth, twist};
    use super::*;
    use crate::Outside;
    use crate::tests::{Scene, ball, scene};

    /// What springs make of a press on a shell: a dent deeper than wide, whose rim gives way to all sides.
    fn dent(top: Vector3<f64>) -> impl Fn(Vector3<f64>) -> Vector3<f64> {
        move |p| {
            let (aside, width) = ((p - top).component_mul(&Vector3::new(1.0, 1.0, 0.0)), 4.5);
            let share = (-0.5 * (p - top).norm_squared() / (width * width)).exp();
            aside * (0.3 * share) - Vector3::new(0.0, 0.0, 2.5 * share)
        }
    }

    #[test]
    fn a_dent_whose_rim_gives_way_is_held_back_by_a_tension() {
        let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
        let centre = middle(&grid);
        let top = centre + Vector3::z() * 11.0;
        let scene = scene(&grid, ball(centre, 11.0), dent(top), &[(top, 14.0)]);
        let motions = scene.motions();
        let longest = motions.iter().map(Vector3::norm).fold(0.0, f64::max);
        let sum: Vector3<f64> = motions.iter().sum();
        let lengths: f64 = motions.iter().map(Vector3::norm).sum();
        assert!(sum.norm() < 0.9 * lengths, "it goes one way");
        let mut map = Biharmonic::new(&scene.lattice, Outside::Band, &Exec::default()).unwrap();
        let mapped = map.drag(&scene.motion, 0, &smooth(), &Exec::default()).unwrap();
        assert!(!map.kept[0].tense.is_empty(), "it goes no further without tension");
        let most = voxels(&grid)
            .map(|v| Vector3::from(mapped.displacement.forward().at(v)).map(f64::from).norm())
            .fold(0.0, f64::max);
        assert!(most <= 1.15 * longest, "{most} mm for {longest}");
    }

    #[test]
    fn presses_of_any_length_go_hardly_further_than_they_are_told() {
        let exec = Exec::default();
        for (ball_radius, radius) in [(6.0, 5.0), (10.0, 6.0), (10.0, 9.0), (13.0, 9.0), (13.0, 12.0)] {
            for length in [0.1, 1.0, 2.0] {
                let scene = bumped(ball_radius, radius, -length);
                let told = scene.motions().iter().map(Vector3::norm).fold(0.0, f64::max);
                let mut map = Biharmonic::new(&scene.lattice, Outside::Band, &exec).unwrap();
                let mapped = map.drag(&scene.motion, 0, &smooth(), &exec).unwrap();
                let far = mapped.displacement.forward().longest();
                // What is steep can't be followed under a tension that holds it to 2 %.
                let most = if radius > 4.0 * length { 1.04 } else { 1.15 };
                assert!(far <= most * told, "{ball_radius}, {radius}, {length}: {}", far / told);
            }
        }
    }

    #[test]
    fn what_turns_is_told_from_what_goes_one_way() {
        let goes_one_way = |scene: &Scene| {
            let mut map = Biharmonic::new(&scene.lattice, Outside::Band, &Exec::default()).unwrap();
            map.take_roles(&scene.motion);
            map.goes_one_way(&scene.motions())
        };
        // About an axis within it.
        let axis = Vector3::z() * 6.0;
        let hinge = |p: Vector3<f64>| Rotation3::new(Vector3::x() * 0.3) * (p - axis) - (p - axis);
        let fades = |p: Vector3<f64>| twist(p) * (-p.norm_squared() / 100.0).exp();
        for scene in [bar(twist), bar(fades), bar(shear), bar(radial), bar(hinge)] {
            assert!(!goes_one_way(&scene));
        }
        let top = Vector3::z() * 16.0;
        for scene in [bar(dent(top)), bar(|_| Vector3::x()), bar(|_| Vector3::zeros())] {
            assert!(goes_one_way(&scene));
        }
    }
}
