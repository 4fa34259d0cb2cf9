//! Masses on springs: three ways to solve one body.
//!
//! A lattice's vertices are masses, and springs tie them:
//! - **structural** along the edges of triangles;
//! - **shear** and **flexion** between the two vertices opposite an edge. Provot (1995) has a grid of quadrilaterals, whose
//!   diagonals are shear springs. Where the triangles beside an edge see it under 150° or more together, it halves a
//!   quadrilateral and the pair opposite is its other diagonal: shear. Any other such pair bends with the edge: flexion.
//!
//! No pair has two springs. Both kinds of the second family stand against shear and bending at once, but a flat sheet gets
//! no stiffness along its normal from any spring: to first order its springs don't lengthen.
//!
//! A stiffness `K` (N/m) is that of every structural spring, whatever its length. From Young's modulus `E` (kPa) and
//! thickness `t` (mm) it is `E t Σ area / L²` over the triangles beside (Van Gelder 1998, for a membrane), with
//! `Σ area / L²` between 0.01 and 100. Between two materials a spring is two halves in a row: `2 K₁ K₂ / (K₁ + K₂)`.
//!
//! Springs pull and, where [`Springs::push`] says so or a force or a bone asks for it, push by Hooke's law. Beyond the strain limit a hundredfold stiffness more pulls, which
//! stands for Provot's correction of positions and has an energy. Drag takes `γ` of every velocity a second; ground springs
//! tie vertices to their places. Momentum is kept where there is neither, and nothing is held.
//!
//! **Reach.** Only vertices that springs connect to a handle's target, or a bone that moves, inside some ball of theirs are loose. The others stay,
//! exactly, and hold them: [`MassSpringResult::truncation`] says with how much force.
//!
//! **Solvers.** [`Solver::Dynamics`] steps through time. What it gives after the duration need not rest; `residual` says how
//! far from balance it is. [`Solver::Projective`] finds the balance of forces at each frame, or with `inertia` steps through
//! time by implicit Euler; [`Solver::Xpbd`] does the latter. Their steps never raise the objective (`Xpbd`'s may) and end at
//! the relative gradient asked for, or after the most iterations: `residual` says where. A balance need not be the only one:
//! springs that push can buckle, and those that don't are slack where they are shorter than at rest: nothing says where within that their ends lie, and
//! they bear no force, so that forces and `truncation` may be 0.
//!
//! **Bones** ([`crate::rigid`]) hold their vertices at places that move rigidly. [`with_bones`] takes them.
//!
//! [`Prepared`] keeps what handles don't change while they move.

mod blocks;
mod body;
mod drives;
mod dynamics;
mod factor;
mod forces;
mod links;
mod metric;
mod objective;
mod outcome;
mod params;
#[cfg(test)]
mod planted;
mod projective;
mod spring;
mod xpbd;

use std::ops::Deref;

use ivd_core::{Ball, Exec, Frame, InteriorPoints, Labels, Lattice, Motion, Role};
use nalgebra::Vector3;

use crate::Error;
use crate::carried::Companions;
use crate::handles::{Action, Handle, Pin, check_pull, find_targets, lies_on_rigid, pinned};
use crate::rigid::{BoneMotion, BoneSpec, Skeleton};
use body::{Body, Region};
use drives::{Drives, MILLINEWTON};
use outcome::{Balance, Outcome};

pub use body::classes_along;
pub use links::{Kind, Link, links};
pub use params::{Closeness, Descent, LoadRamp, Material, Params, Solver, Springs};

/// A pulled target that goes further than this many radii has left what its radius can follow.
const FAR: f64 = 10.0;

/// A solved deformation.
#[derive(Debug, Clone, PartialEq)]
pub struct MassSpringResult {
    /// As many frames as asked for, the last at the end of the duration; one ball of reach for every handle and for every
    /// bone that moves.
    pub motion: Motion,
    /// Vertices whose displacement isn't 0 in the last frame.
    pub vertices_moved: usize,
    /// Vertices that may move.
    pub vertices_loose: usize,
    /// What bones have done, as they were declared.
    pub bones: Vec<BoneMotion>,
    /// Springs with such an end.
    pub springs: usize,
    /// Time steps made; frames, where time doesn't pass.
    pub steps: usize,
    /// Length of a step (s).
    pub dt: f64,
    /// Iterations of an implicit solver, of all steps.
    pub iterations: usize,
    /// Length of the list of unbalanced forces over that of the forces of handles. Of an implicit solver the worst of all
    /// frames or steps, in time with the forces of inertia beside those of handles. 1 where handles put in none and some are left.
    pub residual: f64,
    /// Energy after the first step (nJ): springs, ground springs and motion.
    pub energy_first: f64,
    /// Energy after the last step (nJ).
    pub energy_last: f64,
    /// Largest displacement of any frame (mm).
    pub max_displacement_mm: f64,
    /// Force of each handle at the end (mN): what it pulls with, or what it takes to hold its vertices where they are. 0 of
    /// one on a bone: see there.
    pub handle_forces_mn: Vec<[f64; 3]>,
    /// Sum of the sizes of the forces by which vertices outside the reach hold the others (mN).
    pub truncation_mn: f64,
    /// The same over the sum of the sizes of the handles' and the bones' forces; 0 where those are 0. Far less than 1 says that the radius
    /// is large enough; without ground springs or fixed vertices nothing else can hold against a pull, and it is at least 1.
    pub truncation: f64,
}

/// Deforms a lattice by handles; see the module's page for the model.
///
/// - `labels`: on the lattice's grid, for material by class: a vertex takes that of the voxel just inside the surface.
/// - `handles`: at least one; two on one vertex must do the same.
/// - `fixed`: vertices that stay, exactly; a target among them stays too.
///
/// # Errors
/// [`Error::Param`]: a parameter, handle or vertex number outside its domain. [`Error::Mismatch`]: a pick with no vertex
/// near, contradicting handles, labels on another grid, a pull against nothing where the balance is asked for. [`Error::Untrusted`]: a force that takes its target further than ten
/// radii, a displacement that isn't finite, more steps than can be made. Cancelled.
pub fn solve(
    lattice: &Lattice,
    labels: Option<&Labels>,
    handles: &[Handle],
    fixed: &[Pin],
    params: &Params,
    exec: &Exec,
) -> Result<MassSpringResult, Error> {
    with_bones(lattice, labels, handles, fixed, &[], params, exec)
}

/// The same with bones: their vertices go where their rigid motions take them, to the bit, and springs to them pull the others
/// after them. Where there are bones, there need be no handle.
///
/// - `bones`: a handle on one of them is where it should go, and nothing else.
///
/// # Errors
/// As [`solve`] and [`Skeleton::new`].
pub fn with_bones(
    lattice: &Lattice,
    labels: Option<&Labels>,
    handles: &[Handle],
    fixed: &[Pin],
    bones: &[BoneSpec],
    params: &Params,
    exec: &Exec,
) -> Result<MassSpringResult, Error> {
    Prepared::with_bones(lattice, labels, handles, fixed, bones, params, exec)?.update(handles, exec)
}

/// A body that is ready to be moved.
#[derive(Debug, Clone)]
pub struct Prepared<L> {
    lattice: L,
    /// Rest positions (mm), relative to the grid's origin.
    rest: Vec<Vector3<f64>>,
    fixed: Vec<bool>,
    /// Vertices beside a class that is rigid, ascending; fixed ones.
    rigid: Vec<usize>,
    skeleton: Skeleton,
    body: Body,
    /// Of the vertices in reach that no spring reaches.
    companions: Companions,
    params: Params,
    kept: projective::Kept,
}

impl<L: Deref<Target = Lattice> + Send + Sync> Prepared<L> {
    /// The body that handles reach. [`Prepared::update`] may move them elsewhere, and take others whose targets lie inside.
    ///
    /// # Errors
    /// As [`solve`].
    pub fn new(
        lattice: L,
        labels: Option<&Labels>,
        handles: &[Handle],
        fixed: &[Pin],
        params: &Params,
        exec: &Exec,
    ) -> Result<Self, Error> {
        Self::with_bones(lattice, labels, handles, fixed, &[], params, exec)
    }

    /// The body that handles and bones reach. [`Prepared::update`] may move handles on a bone elsewhere, too.
    ///
    /// # Errors
    /// As [`with_bones`].
    pub fn with_bones(
        lattice: L,
        labels: Option<&Labels>,
        handles: &[Handle],
        fixed: &[Pin],
        bones: &[BoneSpec],
        params: &Params,
        exec: &Exec,
    ) -> Result<Self, Error> {
        params.check()?;
        check_pull(handles, fixed)?;
        exec.run(|| {
            let rest = lattice.local_positions();
            let targets = find_targets(&lattice, &rest, handles, bones.is_empty())?;
            let mut fixed = pinned(&lattice, &rest, fixed)?;
            let mut skeleton = Skeleton::at_rest(&lattice, labels, &rest, bones)?;
            skeleton.drive(&rest, &aimed(handles, &targets))?;
            skeleton.check_free(&fixed)?;
            let rigid = body::rigid_vertices(&lattice, labels, params, &skeleton)?;
            for &v in &rigid {
                fixed[v] = true;
            }
            let balls: Vec<(Vector3<f64>, f64)> = targets
                .iter()
                .zip(handles)
                .map(|(&t, h)| (rest[t], h.radius))
                .chain(skeleton.balls())
                .collect();
            let within =
                |at: &Vector3<f64>| balls.iter().any(|(centre, radius)| (at - centre).norm() < *radius);
            let mut near: Vec<bool> = rest.iter().map(within).collect();
            for &t in &targets {
                near[t] = true;
            }
            let mut carried = vec![false; rest.len()];
            for (b, bone) in skeleton.bones().iter().enumerate() {
                for v in bone.vertices.iter().map(|&v| v as usize) {
                    (fixed[v], carried[v], near[v]) = (true, skeleton.moves(b), near[v] || skeleton.moves(b));
                }
            }
            exec.check_cancelled()?;
            let region = Region { near, fixed, carried, targets: &targets };
            let body = Body::new(&lattice, labels, &rest, &region, params)?;
            let Region { near, fixed, .. } = region;
            // Kept by the solver, and as the motion of all vertices.
            let vectors = rest.len() + body.loose + skeleton.inner().len();
            let frames = 24 * params.springs.frames as u64 * vectors as u64;
            exec.check_memory("the frames of the motion", frames)?;
            let kept = projective::Kept::default();
            let mut solved = fixed.clone();
            body.vertices.iter().for_each(|&v| solved[v as usize] = true);
            let carried: Vec<u32> =
                (0..rest.len() as u32).filter(|&v| near[v as usize] && !solved[v as usize]).collect();
            let companions = Companions::new(&rest, &carried, &body.vertices[..body.loose]);
            Ok(Self { lattice, rest, fixed, rigid, skeleton, body, companions, params: params.clone(), kept })
        })
    }

    /// Solves for handles: those that the body was made for, moved elsewhere, or others inside its reach.
    ///
    /// # Errors
    /// As [`solve`]; [`Error::Mismatch`] for a target outside the reach.
    pub fn update(&mut self, handles: &[Handle], exec: &Exec) -> Result<MassSpringResult, Error> {
        handles.iter().try_for_each(Handle::check)?;
        self.body.springs.use_simd(exec.simd);
        exec.run(|| {
            let boneless = self.skeleton.bones().is_empty();
            let targets = find_targets(&self.lattice, &self.rest, handles, boneless)?;
            if let Some(handle) = targets.iter().position(|t| self.rigid.binary_search(t).is_ok()) {
                return Err(lies_on_rigid(handle));
            }
            self.skeleton.drive(&self.rest, &aimed(handles, &targets))?;
            let bones_move = (0..self.skeleton.bones().len()).any(|bone| self.skeleton.moves(bone));
            self.body.pushes(self.params.springs.pushes(handles, bones_move));
            let drives =
                Drives::new(&self.body, handles, &targets, &self.fixed, &self.skeleton, &self.params)?;
            let outcome = match self.params.solver {
                Solver::Dynamics => dynamics::run(&self.body, &drives, &self.params, exec)?,
                Solver::Projective => {
                    projective::run(&self.body, &drives, &self.params, &mut self.kept, exec)?
                }
                Solver::Xpbd => xpbd::run(&self.body, &drives, &self.params, exec)?,
            };
            self.solved(handles, &targets, &drives, &outcome)
        })
    }

    /// Forgets where the last solution ended, so that the next one starts at rest and doesn't depend on it.
    pub fn forget(&mut self) {
        self.kept.forget();
    }

    /// What the outcome says of the lattice.
    fn solved(
        &self,
        handles: &[Handle],
        targets: &[usize],
        drives: &Drives,
        outcome: &Outcome,
    ) -> Result<MassSpringResult, Error> {
        let body = &self.body;
        let last = outcome.frames.last().expect("a solver gives at least one frame");
        self.trust(handles, targets, last, outcome)?;
        let pulls: Vec<[f64; 3]> = handles
            .iter()
            .enumerate()
            .map(|(h, handle)| match handle.action {
                // Two handles on a vertex pull once.
                Action::Force(_) if targets[..h].contains(&targets[h]) => [0.0; 3],
                Action::Force(pull) if body.loose_vertex(targets[h]).is_some() => {
                    pull.map(|c| c * MILLINEWTON)
                }
                _ => [0.0; 3],
            })
            .collect();
        let reached = self.params.springs.reached(self.params.springs.duration);
        let balance = Balance::new(body, drives, last, reached, &pulls);
        let truncation = body.held_back(last);
        let motion = self.motion(handles, targets, outcome)?;
        let displacement = &motion.frames().last().expect("as many as the outcome").displacement;
        let bones = self.bones(displacement, reached, &balance);
        let sizes = |forces: &[[f64; 3]]| forces.iter().map(|f| Vector3::from(*f).norm()).sum::<f64>();
        let forces: Vec<[f64; 3]> = bones.iter().map(|bone| bone.force_mn).collect();
        let put_in = sizes(&balance.handles) + MILLINEWTON * sizes(&forces);
        Ok(MassSpringResult {
            vertices_moved: displacement.iter().filter(|u| **u != [0.0; 3]).count(),
            vertices_loose: body.loose,
            bones,
            springs: body.list.len(),
            steps: outcome.steps,
            dt: outcome.dt,
            iterations: outcome.iterations,
            residual: outcome.residual.unwrap_or_else(|| balance.relative()),
            energy_first: outcome.energies[0],
            energy_last: outcome.energies[1],
            max_displacement_mm: motion.max_displacement(),
            handle_forces_mn: balance.handles.iter().map(|f| f.map(|c| c / MILLINEWTON + 0.0)).collect(),
            truncation_mn: truncation / MILLINEWTON,
            truncation: if put_in > 0.0 { truncation / put_in } else { 0.0 },
            motion,
        })
    }

    /// What the bones have done, with the force that holds each.
    fn bones(&self, displacement: &[[f64; 3]], reached: f64, balance: &Balance) -> Vec<BoneMotion> {
        let mut bones = self.skeleton.moved(&self.rest, reached, displacement);
        for (&v, force) in self.body.carried.iter().zip(&balance.bones) {
            let vertex = self.body.vertices[v] as usize;
            let bone = self.skeleton.holder(vertex).expect("a bone carries it");
            for (sum, own) in bones[bone].force_mn.iter_mut().zip(force) {
                *sum += own / MILLINEWTON;
            }
        }
        bones
    }

    /// The frames, for every vertex of the lattice.
    fn motion(&self, handles: &[Handle], targets: &[usize], outcome: &Outcome) -> Result<Motion, Error> {
        let count = outcome.frames.len() as f64;
        let frames = outcome.frames.iter().zip(1..).map(|(frame, k)| {
            let mut displacement = vec![[0.0; 3]; self.rest.len()];
            for (&v, u) in self.body.vertices.iter().zip(frame) {
                // No negative zeros.
                displacement[v as usize] = u.map(|c| c + 0.0);
            }
            let time = self.params.springs.duration * (f64::from(k) / count);
            self.skeleton.place(&self.rest, self.params.springs.reached(time), &mut displacement);
            self.companions.go_along(&mut displacement);
            Frame { time, displacement: displacement.into() }
        });
        let frames: Vec<Frame> = frames.collect();
        let places = self.skeleton.inner();
        let linear = self.lattice.grid().linear_part();
        let reached = |frame: &Frame| self.params.springs.reached(frame.time);
        let told = frames.iter().filter(|_| !places.is_empty());
        let inner = told.map(|frame| self.skeleton.inner_displacement(&linear, reached(frame)).into());
        let inner = InteriorPoints { frames: inner.collect(), places: places.into() };
        let ball =
            |(&t, h): (&usize, &Handle)| Ball { centre: self.lattice.world(t).0.into(), radius: h.radius };
        let reach = targets.iter().zip(handles).map(ball).chain(self.skeleton.reach()).collect();
        let roles = self.roles(&frames);
        let motion = Motion::new(self.lattice.grid().clone(), self.rest.len(), frames)?;
        motion.with_reach(reach)?.with_inner(inner)?.with_roles(roles.into())
    }

    /// What the motion of each vertex says, as a map reads it: what springs and bones move is driven, and so are the next ones beyond the
    /// reach, which hold them; what is fixed, and what a bone holds that doesn't move, is held.
    fn roles(&self, frames: &[Frame]) -> Vec<u8> {
        let mut roles = vec![Role::Carried; self.rest.len()];
        self.body.vertices.iter().for_each(|&v| roles[v as usize] = Role::Driven);
        for (v, role) in roles.iter_mut().enumerate().filter(|(v, _)| self.fixed[*v]) {
            let moves = frames.iter().any(|frame| frame.displacement[v] != [0.0; 3]);
            *role = if moves { Role::Driven } else { Role::Held };
        }
        roles.into_iter().map(|role| role as u8).collect()
    }

    /// Refuses what isn't finite and what a force carried out of its handle's reach.
    fn trust(
        &self,
        handles: &[Handle],
        targets: &[usize],
        last: &[[f64; 3]],
        outcome: &Outcome,
    ) -> Result<(), Error> {
        let bad = |problem: String| {
            let remedy = "use a smaller force, more stiffness, ground springs or a shorter duration";
            Err(Error::Untrusted { what: "the deformed lattice", problem, remedy })
        };
        if let Some(v) = last.iter().position(|u| !u.iter().all(|c| c.is_finite())) {
            return bad(format!("the displacement of vertex {} isn't finite", self.body.vertices[v]));
        }
        let [first, end] = outcome.energies;
        let residual = outcome.residual.unwrap_or(0.0);
        if !(first.is_finite() && end.is_finite() && residual.is_finite()) {
            return bad(format!("its energy ends at {end:e} nJ, its relative gradient at {residual:e}"));
        }
        for (handle, &target) in handles.iter().zip(targets) {
            let Some(v) = self.body.loose_vertex(target) else { continue };
            let (far, radius) = (Vector3::from(last[v]).norm(), handle.radius);
            if matches!(handle.action, Action::Force(_)) && far > FAR * radius {
                return bad(format!(
                    "the force takes vertex {target} {far:.4e} mm far, with a radius of {radius} mm"
                ));
            }
        }
        Ok(())
    }
}

/// Handles with their vertices.
fn aimed(handles: &[Handle], targets: &[usize]) -> Vec<(Handle, usize)> {
    handles.iter().copied().zip(targets.iter().copied()).collect()
}

#[cfg(test)]
mod tests;
