use ivd_core::op::Op as _;
use ivd_core::{Error as CoreError, Exec, FieldBricks, Lattice, Motion};
use ivd_field::vectors::sampled;
use nalgebra::Vector3;

use crate::frame::{check_size, frame_of, moving_bricks};
use crate::limit::as_far;
use crate::region::Region;
use crate::settle::Settle;
use crate::{BodyParams, Error, MapResult, Outside};

/// The motion of space that came with frame `frame` of a lattice's, certified and inverted: what moved the lattice moved the voxels with it.
///
/// # Errors
/// Inputs that don't belong together; a motion of the lattice alone; parameters out of their domain; [`Error::Folded`] or
/// [`ivd_core::Error::Untrusted`] where it can't be kept free of folds; the memory limit; cancellation.
pub fn body(
    lattice: &Lattice,
    motion: &Motion,
    frame: usize,
    params: &BodyParams,
    exec: &Exec,
) -> Result<MapResult, Error> {
    params.check()?;
    check_size(frame_of(lattice, motion, frame)?)?;
    if motion.space().is_empty() {
        return Err(CoreError::Mismatch {
            what: "motion",
            problem: "it moves the lattice alone, not the space round it".into(),
            remedy: "solve it with solver = \"body\" and without shapes, or map it with octree, biharmonic or fem",
        }
        .into());
    }
    if params.band.outside == Outside::Free {
        return Err(ivd_core::ParamError::new(
            "outside",
            "a body moves what surrounds it too",
            "leave it at band, or map with octree, biharmonic or fem",
        )
        .into());
    }
    exec.run(|| {
        as_far(motion, params.band.limit, |motion| {
            let (frame, space) = (frame_of(lattice, motion, frame)?, &motion.space()[frame]);
            let grid = lattice.grid();
            let region = Region::new(motion, frame, &lattice.local_positions(), &params.band, None);
            let bricks = moving_bricks(grid, &region, frame, exec)?;
            let vectors = sampled("map", grid.dims(), &bricks, exec, |voxel, (): &mut ()| {
                Vector3::from(space.at(voxel)).map(f64::from)
            })?;
            let settle = Settle { lattice, alone: None, region: &region, motion, frame, band: &params.band };
            settle.settle(FieldBricks::of_bricks(grid.dims(), &bricks, vectors.into())?, exec)
        })
    })
}
