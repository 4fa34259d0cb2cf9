use ivd_core::op::Op as _;
use ivd_core::{Exec, Lattice, Mask, Motion, Octree, Role};
use ivd_octree::NearestIndex;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::limit::as_far;
use super::region::reach_of;
use super::{Found, Hit, MapResult, Nearest, OctreeParams, nearest};
use crate::Error;

/// The searches of the triangles that may move and of those that don't. Most places near a handle lie nearest to a triangle
/// that stays: for them it is enough to know that no moving one is nearer.
#[derive(Debug)]
pub(super) struct Sides {
    moving: NearestIndex,
    still: NearestIndex,
}

impl Sides {
    /// Two searches of a lattice, by what its vertices do. A triangle with a vertex that is carried is in neither.
    pub(super) fn new(
        lattice: &Lattice,
        octree: &Octree,
        states: &[State],
        exec: &Exec,
    ) -> Result<Self, Error> {
        let side = |t: u32| {
            let states = lattice.triangles()[t as usize].map(|v| states[v as usize]);
            let seen = !states.contains(&State::Carried);
            seen.then(|| usize::from(!states.contains(&State::Movable)))
        };
        let [moving, still] = exec.run(|| ivd_octree::prepare_parts(lattice, octree, side))?;
        Ok(Self { moving, still })
    }
}

/// What a vertex does to the space round it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    /// It moves space, or may.
    Movable,
    /// It holds space.
    Still,
    /// Space takes it along.
    Carried,
}

/// What vertices do. Those in the balls of the motion's reach may move, and any that does.
///
/// - `positions`: the vertices relative to the grid's origin (mm).
pub(super) fn states(motion: &Motion, positions: &[Vector3<f64>]) -> Vec<State> {
    let balls = reach_of(motion);
    let reached = |at: &Vector3<f64>| balls.iter().any(|(centre, radius)| (at - centre).norm() < *radius);
    let moves = |v: usize| motion.frames().iter().any(|f| f.displacement[v] != [0.0; 3]);
    let state = |(v, at)| match motion.role(v) {
        Role::Carried => State::Carried,
        _ if reached(at) || moves(v) => State::Movable,
        _ => State::Still,
    };
    positions.par_iter().enumerate().map(state).collect()
}

impl Nearest for Sides {
    fn nearest(&self, point: Vector3<f64>, bound: f64, known_still: bool) -> Found {
        let Some(moving) = self.moving.nearest(point, bound) else {
            return if known_still { Found::Still(None) } else { Found::Nothing };
        };
        match self.still.nearer(point, &moving) {
            Some(still) => Found::Still(Some(still)),
            None => Found::On(Hit {
                triangle: moving.triangle,
                barycentric: moving.barycentric,
                distance: moving.distance_mm,
            }),
        }
    }
}

/// A lattice and its motion, ready to be mapped frame by frame: its inside and its search trees are made once.
pub struct Prepared<'a> {
    lattice: &'a Lattice,
    motion: &'a Motion,
    inside: Mask,
    sides: Sides,
}

impl<'a> Prepared<'a> {
    /// Prepares a lattice with its octree and its motion.
    ///
    /// # Errors
    /// An octree or a motion of another lattice, a lattice that isn't closed, the memory limit, cancellation.
    pub fn new(
        lattice: &'a Lattice,
        octree: &Octree,
        motion: &'a Motion,
        exec: &Exec,
    ) -> Result<Self, Error> {
        motion.require_of(lattice)?;
        let inside = ivd_octree::inside(lattice, exec)?;
        let states = states(motion, &lattice.local_positions());
        let sides = Sides::new(lattice, octree, &states, exec)?;
        Ok(Self { lattice, motion, inside, sides })
    }

    /// The voxels inside the lattice.
    pub fn inside(&self) -> &Mask {
        &self.inside
    }

    /// Maps frame `frame` of the motion.
    ///
    /// # Errors
    /// As [`octree`].
    pub fn map(&self, frame: usize, params: &OctreeParams, exec: &Exec) -> Result<MapResult, Error> {
        // A part of the way moves the same vertices.
        as_far(self.motion, params.band.limit, |motion| {
            nearest(self.lattice, &self.inside, &self.sides, motion, frame, params, exec)
        })
    }
}

/// Maps frame `frame` of a motion to the voxels, with nearest lattice points found through the octree.
///
/// # Errors
/// Inputs that don't belong together; parameters out of their domain; a lattice that isn't closed; [`Error::Folded`] or
/// [`ivd_core::Error::Untrusted`] where no map free of folds follows the motion; the memory limit; cancellation.
pub fn octree(
    lattice: &Lattice,
    octree: &Octree,
    motion: &Motion,
    frame: usize,
    params: &OctreeParams,
    exec: &Exec,
) -> Result<MapResult, Error> {
    params.check()?;
    Prepared::new(lattice, octree, motion, exec)?.map(frame, params, exec)
}

/// Maps every frame of a motion; as [`octree`], with the lattice prepared once.
///
/// # Errors
/// As [`octree`], for the first frame that fails.
pub fn frames(
    lattice: &Lattice,
    octree: &Octree,
    motion: &Motion,
    params: &OctreeParams,
    exec: &Exec,
) -> Result<Vec<MapResult>, Error> {
    params.check()?;
    let prepared = Prepared::new(lattice, octree, motion, exec)?;
    (0..motion.frames().len()).map(|frame| prepared.map(frame, params, exec)).collect()
}
