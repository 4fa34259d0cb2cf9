//! A lattice that is dragged: what its motion doesn't change is found once.

use std::ops::Deref;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Lattice, Mask, Motion, Octree};
use nalgebra::Vector3;

use super::frame::frame_of;
use super::nearest::{carried, look_ahead, region_of, settle_of};
use super::nearest_weight::{Kept, Part};
use super::octree::{Sides, State, states};
use super::region::largest;
use super::{MapUpdate, OctreeParams};
use crate::Error;

/// A lattice, ready to be mapped by [`octree`](super::octree()) again and again while its handles move: keeps the inside, and
/// for every voxel that was in reach the nearest lattice point, for as long as the same vertices may move and the same are carried. A motion of nothing, with
/// which a drag begins, makes it look them up in what the handles will reach.
///
/// What it gives is, to the bit, what [`octree`](super::octree()) gives of the same motion, whatever was mapped before.
#[derive(Debug)]
pub struct IncrementalMap<L> {
    lattice: L,
    octree: Octree,
    /// Vertices relative to the grid's origin (mm).
    positions: Vec<Vector3<f64>>,
    inside: Mask,
    searched: Option<Searched>,
}

/// The search for what vertices do, and what it found.
#[derive(Debug)]
struct Searched {
    states: Vec<State>,
    sides: Sides,
    kept: Kept,
}

impl<L: Deref<Target = Lattice> + Send + Sync> IncrementalMap<L> {
    /// Prepares a lattice with its octree.
    ///
    /// # Errors
    /// An octree of another lattice, a lattice that isn't closed; the memory limit; cancellation.
    pub fn new(lattice: L, octree: Octree, exec: &Exec) -> Result<Self, Error> {
        let inside = ivd_octree::inside(&lattice, exec)?;
        let positions = lattice.local_positions();
        let live = Self { lattice, octree, positions, inside, searched: None };
        // An octree of another lattice is refused now.
        Sides::new(&live.lattice, &live.octree, &vec![State::Still; live.positions.len()], exec)?;
        Ok(live)
    }

    /// The voxels inside the lattice.
    pub fn inside(&self) -> &Mask {
        &self.inside
    }

    /// Maps frame `frame` of a motion of the lattice.
    ///
    /// # Errors
    /// As [`octree`](super::octree()).
    pub fn map(
        &mut self,
        motion: &Motion,
        frame: usize,
        params: &OctreeParams,
        exec: &Exec,
    ) -> Result<MapUpdate, Error> {
        params.check()?;
        let frame = frame_of(&self.lattice, motion, frame)?;
        exec.run(|| {
            let states = states(motion, &self.positions);
            if self.searched.as_ref().is_none_or(|searched| searched.states != states) {
                let sides = Sides::new(&self.lattice, &self.octree, &states, exec)?;
                self.searched = Some(Searched { states, sides, kept: Kept::default() });
            }
            let Searched { sides, kept, .. } = self.searched.as_mut().expect("made above");
            let (lattice, positions) = (&*self.lattice, &self.positions);
            let part = Part { lattice, positions, inside: &self.inside, nearest: sides };
            let region = region_of(motion, frame, positions, params);
            if largest(frame) == 0.0 && exec.skip && !kept.sought() {
                look_ahead(&part, &region.ahead(&params.band), params, kept, exec)?;
            }
            let field = carried(&part, frame, &region, params, Some(kept), exec)?;
            settle_of(&part, motion, frame, &region, &params.band).moved(field, exec)
        })
    }

    /// Forgets the nearest points that it keeps.
    pub fn forget(&mut self) {
        self.searched = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DepthWeight;
    use crate::tests::{Scene, both_ends_pushed, mapped_apart, near_pushed};

    #[test]
    fn what_one_handle_moves_another_far_from_it_does_not_change_by_a_bit() {
        let exec = Exec::default();
        for weight in [DepthWeight::Smooth, DepthWeight::Linear] {
            let params = OctreeParams { weight, ..OctreeParams::default() };
            mapped_apart(|lengths| both_ends_pushed(lengths).map(&params, &exec).unwrap());
        }
    }

    /// Each motion of a drag is mapped as it is alone; `scene` by the lengths of two pushes.
    fn assert_as_alone(scene: impl Fn([f64; 2]) -> Scene, drag: &[[f64; 2]]) {
        let exec = Exec::default();
        let params = OctreeParams::default();
        let still = scene([0.0; 2]);
        let tree = ivd_octree::build(&still.lattice, &ivd_octree::Params::default(), &exec).unwrap();
        let mut dragged = IncrementalMap::new(&still.lattice, tree, &exec).unwrap();
        dragged.map(&still.motion, 0, &params, &exec).unwrap();
        for lengths in drag {
            let alone = scene(*lengths);
            let moved = dragged.map(&alone.motion, 0, &params, &exec).unwrap();
            assert!(moved.displacement == alone.map(&params, &exec).unwrap().displacement, "{lengths:?}");
        }
    }

    #[test]
    fn a_drag_of_several_handles_gives_what_each_motion_gives_alone() {
        assert_as_alone(
            both_ends_pushed,
            &[[0.7, 0.0], [0.7, 0.4], [0.7, 2.5], [0.9, 2.5], [0.7, -1.0], [2.0, 0.4]],
        );
        // Into the other's reach, and out of it.
        assert_as_alone(
            near_pushed,
            &[[0.4, 0.0], [0.4, 0.6], [0.4, 1.0], [0.4, 1.4], [0.9, 1.4], [0.9, -0.5], [0.4, 0.6]],
        );
    }
}
