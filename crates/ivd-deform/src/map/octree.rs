use ivd_core::{Exec, Lattice, Mask, Motion, Octree};
use ivd_octree::NearestIndex;
use nalgebra::Vector3;

use super::{Hit, MapParams, Mapped, Nearest, nearest};
use crate::Error;

impl Nearest for NearestIndex {
    fn nearest(&self, point: Vector3<f64>, bound: f64) -> Option<Hit> {
        NearestIndex::nearest(self, point, bound).map(|n| Hit {
            triangle: n.triangle,
            barycentric: n.barycentric,
            distance: n.distance_mm,
        })
    }
}

/// A lattice ready to be mapped many times: its inside and its search tree are made once.
#[derive(Debug)]
pub struct Prepared<'a> {
    lattice: &'a Lattice,
    inside: Mask,
    index: NearestIndex,
}

impl<'a> Prepared<'a> {
    /// Prepares a lattice with its octree.
    ///
    /// # Errors
    /// An octree of another lattice, a lattice that isn't closed, the memory limit, cancellation.
    pub fn new(lattice: &'a Lattice, octree: &Octree, exec: &Exec) -> Result<Self, Error> {
        let inside = ivd_octree::inside(lattice, exec)?;
        let index = exec.run(|| ivd_octree::prepare(lattice, octree))?;
        Ok(Self { lattice, inside, index })
    }

    /// The voxels inside the lattice.
    pub fn inside(&self) -> &Mask {
        &self.inside
    }

    /// Maps frame `frame` of a motion of the lattice.
    ///
    /// # Errors
    /// As [`octree`].
    pub fn map(
        &self,
        motion: &Motion,
        frame: usize,
        params: &MapParams,
        exec: &Exec,
    ) -> Result<Mapped, Error> {
        nearest(self.lattice, &self.inside, &self.index, motion, frame, params, exec)
    }
}

/// Maps frame `frame` of a motion to the voxels, with nearest lattice points found through the octree.
///
/// # Errors
/// Inputs that don't belong together; parameters out of their domain; a lattice that isn't closed; [`Error::Folded`] or
/// [`Error::Untrusted`] where no map free of folds follows the motion; the memory limit; cancellation.
pub fn octree(
    lattice: &Lattice,
    octree: &Octree,
    motion: &Motion,
    frame: usize,
    params: &MapParams,
    exec: &Exec,
) -> Result<Mapped, Error> {
    params.check()?;
    Prepared::new(lattice, octree, exec)?.map(motion, frame, params, exec)
}

/// Maps every frame of a motion; as [`octree`], with the lattice prepared once.
///
/// # Errors
/// As [`octree`], for the first frame that fails.
pub fn frames(
    lattice: &Lattice,
    octree: &Octree,
    motion: &Motion,
    params: &MapParams,
    exec: &Exec,
) -> Result<Vec<Mapped>, Error> {
    params.check()?;
    let prepared = Prepared::new(lattice, octree, exec)?;
    (0..motion.frames.len()).map(|frame| prepared.map(motion, frame, params, exec)).collect()
}
