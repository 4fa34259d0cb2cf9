//! Biharmonic mapping: the smoothest motion of space that follows the lattice.
//!
//! # The field
//!
//! ```text
//! u(x) = A_ω(x) + ω(x) · r(x)
//! r minimises  ∫ ‖∇²r‖² + Σ_v ‖A_ω(x_v) + ω(x_v) r(x_v) − U_v‖² / σ²
//! ```
//!
//! - Ω and its window `ω` are those of [the page above](super): 1 in the handles' balls, 0 with its slope on ∂Ω. Without a margin that is
//!   given, each ball has one of four times the largest motion of its own vertices, and adopts that of a ball that it overlaps, by
//!   degrees. Parts of Ω that don't touch are solved separately: what one handle moves, another far from it changes by no bit, but where space
//!   is repaired between them or the map has to be made as a flow. Where the lattice moves affinely as a whole, to a quarter as below, Ω has one margin and is one part.
//! - `r` is trilinear on cells of 4³ voxels ([`BiharmonicParams::cell`]), fewer along axes of long voxels and in a small Ω,
//!   eight along short ones where slices lie eight of these apart. The
//!   integral is the discrete one of [`energy`], in world space; the sum is over the vertices, at their places between the
//!   nodes. Nodes on ∂Ω and beyond it are held at 0, and the second differences that reach them count, so that `r` falls to 0
//!   with its slope, over the whole way from the surface to ∂Ω. Nothing is asked at the lattice but that the field follows
//!   it: inside and outside take part alike. Beyond the grid the cells end one further, naturally.
//! - Where nothing is affine and the margin follows the motion, nodes reach a little beyond Ω, as far for all motions of about one length: a drag
//!   then has the same equations again and again.
//! - `ω` takes away the last of `r`, in cells that ∂Ω cuts: beyond Ω nothing moves, bit for bit, though cells are coarse.
//! - `A` is the affine motion of the whole lattice (polar for a rigid one), where it explains the motion to a quarter
//!   (root mean square); else 0. In the balls `ω = 1` and `A_ω = A`: an affine motion of a lattice in them is exact there,
//!   at every voxel and not only on the lattice, and `r` is 0. On the way to ∂Ω it fades as `R^ω (I + ω (S − I))`, a part of the turn
//!   and a part of the stretch, which doesn't shrink space as a mean of places would. `Motion::reach` alone decides where:
//!   a lattice that leaves its balls is followed there as far as the window lets it.
//!
//! InteriorPoints points of rigid parts ([`Motion::inner`]) count as vertices do: a bone's voxels go with its surface.
//!
//! # No folds
//!
//! Least second derivatives are no guard against folds: a wide push folds where its height is about twice its width. Where
//! the certificate finds folds, the field is relaxed there, as all methods are. Where that leaves the lattice behind by more
//! than a twentieth of its motion, the motion is made in increments: a part of the way, the vertices where they have come to, a
//! new field for the rest, composed with what there was, resampled at the voxels and certified. A part that folds is halved,
//! down to a 16th; one that still folds is relaxed, and the next one starts from what that has left. Of the two fields the one
//! that follows more closely is taken.
//!
//! # A part that moves alone
//!
//! With [`Outside::Free`] the same field is kept at the part's voxels and in a layer of two voxels round them, for the
//! corners of the cells at its surface; the rest stays.
//!
//! # Cost
//!
//! Everything goes by the nodes and bricks of Ω. The equations are the same for all frames whose balls stay and whose margins are
//! about as wide; [`Biharmonic`] keeps those of several widths for a drag. Frame after frame of a motion it starts from the last one's nodes.
//!
//! Sources: thin-plate splines (Duchon 1977), their discrete energy on grids and its natural border (Stein, Grinspun,
//! Wardetzky & Jacobson 2018); biharmonic deformation (Botsch & Kobbelt 2004).

mod affine;
mod bound;
mod energy;
mod field;
mod matrix;
mod multigrid;
mod nodes;
mod parts;
mod step;
mod system;
mod tension;

use std::ops::Deref;

use ivd_core::Error as CoreError;
use ivd_core::op::Op as _;
use ivd_core::{Exec, FieldBricks, Frame, InteriorPoints, Lattice, Mask, Motion, VoxelCoord};
use ivd_field::certificate::{Certificate, Detail, certify_bricks, touched};
use ivd_field::sampler::Sampler;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::alone::cut;
use super::frame::{check_size, frame_of, moving_bricks, still};
use super::limit::as_far;
use super::outcome::{SolveFigures, misfit as misfit_of};
use super::region::{Region, largest};
use super::relax::relax;
use super::settle::Settle;
use super::{BiharmonicParams, MapResult, MapUpdate, Outside};
use crate::Error;
use affine::Affine;
use bound::Bound;
use matrix::Triple;
use nodes::Cells;
use step::{Aim, Step};
use system::{Places, System};

/// Residual of the equations, relative to their right-hand side: the field is within some 10⁻⁶ of the minimiser.
const TOLERANCE: f64 = 1e-8;
/// The same of an increment: the next one takes up what it leaves.
const LOOSE: f64 = 1e-5;
/// Misfit up to which a repaired field is kept as it is: increments cost a hundred times as much on a scan's lattice, where
/// specks stand still beside a surface that moves and a few cells fold whatever is done.
const CLOSE: f64 = 0.05;
/// Smallest part of the way that is gone at once.
const SMALLEST: f64 = 1.0 / 16.0;
/// How far a voxel may move, relative to the largest motion of what is followed.
const OVERSHOOT: f64 = 1.02;

/// A lattice, ready to be mapped frame by frame; keeps equations and the last frame's nodes.
pub struct Biharmonic<L> {
    lattice: L,
    /// Vertices, then inner points of rigid parts (voxels), and relative to the grid's origin (mm).
    voxels: Vec<Vector3<f64>>,
    positions: Vec<Vector3<f64>>,
    inside: Option<Mask>,
    /// Whether each of them is to be followed.
    constrains: Vec<bool>,
    /// Of the last frames, the last one's first.
    kept: Vec<Last>,
    /// Whether equations under tension and of other regions are kept, too: a drag asks for them again.
    keeps: bool,
}

/// A vertex or inner point, and its motion (mm).
type Moved = (u32, Vector3<f64>);

/// The equations of a region and their last solution.
struct Last {
    region: Region,
    edge: Option<u8>,
    system: System,
    /// Values of its nodes, which the next frame starts from; empty for 0.
    nodes: Vec<Triple>,
    /// The same equations under the first tensions.
    tense: Vec<System>,
    /// The field that was made with them for a drag.
    made: Option<Known>,
}

/// A field, and what it was made of.
struct Known {
    region: Region,
    /// Whether its margin was given: nodes reach further where it follows the motion.
    is_given: bool,
    moved: Vec<Moved>,
    made: Made,
}

/// A frame to be mapped.
struct Job<'a> {
    region: &'a Region,
    /// Where there are nodes: the region, or one that holds it.
    room: &'a Region,
    frame: &'a Frame,
    /// Of vertices and inner points (mm).
    motions: &'a [Vector3<f64>],
    aim: &'a Aim<'a>,
    bricks: &'a [usize],
    settle: &'a Settle<'a>,
    edge: Option<u8>,
    /// Weight of a membrane's energy beside the bending.
    tension: f64,
}

/// A field that was made, the rounds of repair that it took, and how its equations were solved.
#[derive(Clone)]
struct Made {
    field: FieldBricks,
    repairs: u32,
    solved: Option<SolveFigures>,
}

impl<L: Deref<Target = Lattice> + Send + Sync> Biharmonic<L> {
    /// Prepares a lattice.
    ///
    /// # Errors
    /// A lattice that isn't closed, where the part moves alone; cancellation.
    pub fn new(lattice: L, outside: Outside, exec: &Exec) -> Result<Self, Error> {
        let inside = (outside == Outside::Free).then(|| ivd_octree::inside(&lattice, exec)).transpose()?;
        let voxels = (0..lattice.keys().len()).map(|i| lattice.voxel(i).0).collect();
        let positions = lattice.local_positions();
        Ok(Self {
            lattice,
            voxels,
            positions,
            inside,
            constrains: Vec::new(),
            kept: Vec::new(),
            keeps: false,
        })
    }

    /// Maps frame `frame` of a motion of the lattice.
    ///
    /// # Errors
    /// As [`biharmonic`]; parameters that ask for another outside than was prepared.
    pub fn map(
        &mut self,
        motion: &Motion,
        frame: usize,
        params: &BiharmonicParams,
        exec: &Exec,
    ) -> Result<MapResult, Error> {
        self.keeps = false;
        self.with_frame(motion, frame, params, exec, |settle, made, exec| {
            let mut mapped = settle.settle(made.field, exec)?;
            mapped.figures.relaxations += made.repairs;
            mapped.figures.solved = made.solved;
            Ok(mapped)
        })
    }

    /// As [`Biharmonic::map`], without the figures that only a report shows, and from the nodes at rest: what it gives doesn't
    /// depend on what was mapped before.
    ///
    /// # Errors
    /// As [`Biharmonic::map`].
    pub fn drag(
        &mut self,
        motion: &Motion,
        frame: usize,
        params: &BiharmonicParams,
        exec: &Exec,
    ) -> Result<MapUpdate, Error> {
        self.kept.iter_mut().for_each(|last| last.nodes.clear());
        self.keeps = true;
        self.with_frame(motion, frame, params, exec, |settle, made, exec| {
            let mut moved = settle.moved(made.field, exec)?;
            moved.relaxations += made.repairs;
            Ok(moved)
        })
    }

    /// The field of a frame, before it is settled as `settled` does.
    fn with_frame<T: Send>(
        &mut self,
        motion: &Motion,
        frame: usize,
        params: &BiharmonicParams,
        exec: &Exec,
        settled: impl FnOnce(&Settle<'_>, Made, &Exec) -> Result<T, Error> + Send,
    ) -> Result<T, Error> {
        params.check()?;
        let number = frame;
        let frame = frame_of(&self.lattice, motion, frame)?;
        check_size(frame)?;
        if (params.band.outside == Outside::Free) != self.inside.is_some() {
            return Err(CoreError::Mismatch {
                what: "parameters",
                problem: "they ask for another outside than the lattice was prepared for".into(),
                remedy: "prepare the lattice again",
            }
            .into());
        }
        exec.run(|| {
            self.take_inner(motion.inner());
            self.take_roles(motion);
            let (grid, band) = (self.lattice.grid(), &params.band);
            // No depth: what is smoothest needs none.
            let mut region = Region::new(motion, frame, &self.positions, band, Some(0.0));
            if largest(frame) == 0.0 {
                let bricks = moving_bricks(grid, &region, frame, exec)?;
                let still = Made { field: still(grid, &bricks)?, repairs: 0, solved: None };
                let settle =
                    Settle { lattice: &self.lattice, alone: None, region: &region, motion, frame, band };
                return settled(&settle, still, exec);
            }
            let inner = motion.inner().frames.get(number).into_iter().flat_map(|frame| &frame[..]);
            let motions: Vec<Vector3<f64>> =
                frame.displacement.iter().chain(inner).map(|d| Vector3::from(*d)).collect();
            let mut parts = vec![region.clone()];
            if region.balls().count() > 1 && Affine::fit(&self.positions, &motions).is_none() {
                region = region.of_each(grid, frame, &self.positions, band, Some(0.0));
                parts = region.parts();
            }
            let settle = Settle {
                lattice: &self.lattice,
                alone: self.inside.as_ref(),
                region: &region,
                motion,
                frame,
                band,
            };
            let mut kept = std::mem::take(&mut self.kept);
            let outcome = self
                .in_parts(&mut kept, (&settle, &parts), &motions, params, exec)
                .and_then(|made| settled(&settle, made, exec));
            if outcome.is_err() {
                // Another try begins as if there had been none.
                for last in &mut kept {
                    last.nodes.clear();
                }
            }
            self.kept = kept;
            outcome
        })
    }

    /// Takes in the inner points of a motion; where they are others than the last one's, the equations are others, too.
    fn take_inner(&mut self, inner: &InteriorPoints) {
        let known = self.lattice.keys().len();
        let same = inner.places.len() == self.voxels.len() - known
            && inner.places.iter().zip(&self.voxels[known..]).all(|(a, b)| *a == <[f64; 3]>::from(*b));
        if same {
            return;
        }
        let linear = self.lattice.grid().linear_part();
        self.voxels.truncate(known);
        self.positions.truncate(known);
        self.voxels.extend(inner.places.iter().map(|at| Vector3::from(*at)));
        self.positions.extend(inner.places.iter().map(|at| linear * Vector3::from(*at)));
        self.kept.clear();
    }

    /// Takes in which vertices are to be followed; where they are others than the last ones, the equations are others, too.
    fn take_roles(&mut self, motion: &Motion) {
        let constrains: Vec<bool> = (0..self.voxels.len()).map(|v| motion.role(v).constrains()).collect();
        if constrains != self.constrains {
            self.constrains = constrains;
            self.kept.clear();
        }
    }

    /// The field of a frame; the nodes are kept. Where vertices go one way and a voxel goes further than any of them, as bent plates do beside
    /// a bump, a membrane is put beside the bending, tighter until it doesn't.
    fn follow(&self, job: &Job<'_>, last: &mut Last, exec: &Exec) -> Result<Made, Error> {
        let bound = (!job.aim.is_affine() && self.goes_one_way(job.motions)).then(|| {
            let most = OVERSHOOT * self.farthest(job.motions);
            // A part that moves alone leaves nodes beside it behind.
            let nodes =
                if job.settle.alone.is_some() { Vec::new() } else { self.inner_nodes(job, &last.system) };
            Bound { most, nodes }
        });
        let start = Some(std::mem::take(&mut last.nodes)).filter(|nodes| !nodes.is_empty());
        let mut whole = Self::solve(job, &last.system, start, bound.as_ref(), exec)?;
        let made = match bound {
            Some(bound) => self.bounded(job, (&last.system, &mut whole), &mut last.tense, &bound, exec),
            None => self.make(job, &last.system, &whole, exec),
        };
        last.nodes = whole.nodes;
        made
    }

    /// The equations in which what lies at `voxels` is followed; `tension`: a membrane's weight beside the bending.
    fn system(&self, cells: Cells, region: &Region, voxels: &[Vector3<f64>], tension: f64) -> System {
        let grid = self.lattice.grid();
        let places = Places::new(&cells, grid, region, voxels, &self.constrains);
        System::new(cells, grid, places, tension)
    }

    /// Largest motion (mm) of what is to be followed.
    fn farthest(&self, motions: &[Vector3<f64>]) -> f64 {
        let followed = motions.iter().zip(&self.constrains).filter(|(_, constrains)| **constrains);
        followed.map(|(motion, _)| motion.norm()).fold(0.0, f64::max)
    }

    /// Numbers of the nodes at voxels of the part where all of the field counts: a voxel goes as far as any of them, rounding apart.
    fn inner_nodes(&self, job: &Job<'_>, system: &System) -> Vec<u32> {
        let grid = self.lattice.grid();
        let is_inner = |node: &[i32; 3]| {
            let VoxelCoord(voxel) = system.cells.voxel(*node);
            grid.nearest_voxel(voxel).is_some() && job.region.weight(grid.linear_part() * voxel) == 1.0
        };
        let nodes = system.cells.nodes.free.all().par_iter().enumerate();
        nodes.filter(|(_, node)| is_inner(node)).map(|(i, _)| i as u32).collect()
    }

    /// The way of a frame in one step, under the tension of a job.
    ///
    /// - `bound`: where the nodes go beyond it, the step is no better than shows that.
    fn solve(
        job: &Job<'_>,
        system: &System,
        start: Option<Vec<Triple>>,
        bound: Option<&Bound>,
        exec: &Exec,
    ) -> Result<Step, Error> {
        Ok(Step::solve(system, job.aim, start, (TOLERANCE, bound), exec)?)
    }

    /// The field of a step; where that folds, the same way repaired or in increments.
    fn make(&self, job: &Job<'_>, system: &System, whole: &Step, exec: &Exec) -> Result<Made, Error> {
        let grid = self.lattice.grid();
        let bricks = whole.field(grid, system, job.aim, job.region).sample(None, job.bricks, exec)?;
        let field = cut(FieldBricks::of_bricks(grid.dims(), job.bricks, bricks.into())?, job.settle.alone)?;
        let mut solved = SolveFigures {
            nodes: system.cells.nodes.free.len() as u64,
            increments: 1,
            ..SolveFigures::default()
        };
        whole.count(&mut solved);
        let certificate = certified(&field, job, exec)?;
        let path =
            |t: f64| -> Vec<Vector3<f64>> { (0..job.motions.len()).map(|v| job.aim.path(v, t)).collect() };
        let (field, repairs) = if certificate.holds() {
            (field, 0)
        } else {
            self.unfolded(job, field, &path, &mut solved, exec)?
        };
        Ok(Made { field, repairs, solved: Some(solved) })
    }

    /// The way gone in parts, each from where the vertices have come to, and the rounds of repair that it took; `None` where
    /// a part folds for good.
    ///
    /// `path(t)`: motions of the vertices (mm) after the part `t` of the way.
    fn in_increments(
        &self,
        job: &Job<'_>,
        path: &impl Fn(f64) -> Vec<Vector3<f64>>,
        solved: &mut SolveFigures,
        exec: &Exec,
    ) -> Result<Option<(FieldBricks, u32)>, Error> {
        let still = vec![[0.0; 3]; FieldBricks::VOXELS * job.bricks.len()];
        let mut field = FieldBricks::of_bricks(self.lattice.grid().dims(), job.bricks, still.into())?;
        let (mut gone, mut part, mut increments, mut repairs) = (0.0, 0.5, 0, 0);
        let mut system = None;
        while gone < 1.0 {
            exec.check_cancelled()?;
            let (at, equations) = self.come_to(job, &field, &mut system);
            let next = self.onwards(job, (&field, &at, equations), &path(gone + part), solved, exec)?;
            if certified(&next, job, exec)?.holds() {
                field = next;
            } else if part > SMALLEST {
                part /= 2.0;
                continue;
            } else {
                let relaxed = relax(
                    next,
                    self.lattice.grid(),
                    job.region,
                    &job.settle.counts(),
                    Detail::least(exec),
                    exec,
                )?;
                if !relaxed.certificate.holds() {
                    return Ok(None);
                }
                field = relaxed.field;
                repairs += relaxed.rounds;
            }
            (gone, increments, system) = (gone + part, increments + 1, None);
        }
        if repairs > 0 {
            // What repair has left behind is fetched once more, where that can be done.
            let (at, equations) = self.come_to(job, &field, &mut system);
            let next = self.onwards(job, (&field, &at, equations), &path(1.0), solved, exec)?;
            if certified(&next, job, exec)?.holds() {
                (field, increments) = (next, increments + 1);
            }
        }
        solved.increments = increments;
        Ok(Some((field, repairs)))
    }

    /// The field in one step, relaxed, where that follows closely; else the one made in increments, where that follows more
    /// closely. With the rounds of repair.
    fn unfolded(
        &self,
        job: &Job<'_>,
        whole: FieldBricks,
        path: &impl Fn(f64) -> Vec<Vector3<f64>>,
        solved: &mut SolveFigures,
        exec: &Exec,
    ) -> Result<(FieldBricks, u32), Error> {
        let misfit = |field| misfit_of(&self.lattice, job.settle.motion, field, job.frame);
        let relaxed =
            relax(whole, self.lattice.grid(), job.region, &job.settle.counts(), Detail::least(exec), exec)?;
        let left = if relaxed.certificate.holds() { misfit(&relaxed.field) } else { f64::INFINITY };
        if left > CLOSE
            && let Some((made, repairs)) = self.in_increments(job, path, solved, exec)?
            && misfit(&made) < left
        {
            return Ok((made, repairs));
        }
        solved.increments = 1;
        Ok((relaxed.field, relaxed.rounds))
    }

    /// Where a field has taken the vertices (mm), and the equations there.
    fn come_to<'s>(
        &self,
        job: &Job<'_>,
        field: &FieldBricks,
        system: &'s mut Option<System>,
    ) -> (Vec<Vector3<f64>>, &'s System) {
        let grid = self.lattice.grid();
        let sampler = Sampler::new(field, grid);
        let come: Vec<Vector3<f64>> = self.voxels.par_iter().map(|v| v + sampler.at(*v)).collect();
        let linear = grid.linear_part();
        let at = come.iter().map(|v| linear * v).collect();
        let equations = system.get_or_insert_with(|| {
            self.system(Cells::new(grid, job.room, job.edge), job.room, &come, job.tension)
        });
        (at, equations)
    }

    /// A field, and after it the one that takes the vertices from where they have come to, to `wanted` (mm) from where they
    /// began.
    fn onwards(
        &self,
        job: &Job<'_>,
        (field, at, equations): (&FieldBricks, &[Vector3<f64>], &System),
        wanted: &[Vector3<f64>],
        solved: &mut SolveFigures,
        exec: &Exec,
    ) -> Result<FieldBricks, Error> {
        let grid = self.lattice.grid();
        let motions: Vec<Vector3<f64>> =
            wanted.iter().zip(&self.positions).zip(at).map(|((u, p), at)| p + u - at).collect();
        let aim = Aim::new(at, &motions, job.region);
        let step = Step::solve(equations, &aim, None, (LOOSE, None), exec)?;
        step.count(solved);
        let bricks = step.field(grid, equations, &aim, job.region).sample(Some(field), job.bricks, exec)?;
        cut(FieldBricks::of_bricks(grid.dims(), job.bricks, bricks.into())?, job.settle.alone)
    }
}

/// The certificate of a field, as far as it decides whether a way can be gone.
fn certified(field: &FieldBricks, job: &Job<'_>, exec: &Exec) -> Result<Certificate, Error> {
    let (grid, counts) = (job.settle.lattice.grid(), job.settle.counts());
    Ok(certify_bricks(field, grid, 0.0, &counts, &touched(field), Detail::least(exec), exec)?)
}

/// Maps frame `frame` of a motion by the smoothest motion that follows the lattice.
///
/// # Errors
/// Inputs that don't belong together; parameters out of their domain; a lattice that isn't closed, where the part moves
/// alone; [`Error::Folded`] or [`ivd_core::Error::Untrusted`] where no map free of folds follows the motion; the memory limit;
/// cancellation.
pub fn biharmonic(
    lattice: &Lattice,
    motion: &Motion,
    frame: usize,
    params: &BiharmonicParams,
    exec: &Exec,
) -> Result<MapResult, Error> {
    params.check()?;
    let mut prepared = Biharmonic::new(lattice, params.band.outside, exec)?;
    as_far(motion, params.band.limit, |motion| prepared.map(motion, frame, params, exec))
}

#[cfg(test)]
mod sweep;
#[cfg(test)]
mod tests;
