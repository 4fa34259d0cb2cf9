//! The frame of a motion that is mapped, and the bricks that it may move.

use ivd_core::{Error, Exec, FieldBricks, Frame, Grid, Lattice, Motion};
use ivd_field::vectors::FARTHEST;

use crate::region::{Region, largest};

/// The bricks in which something may move; all of them where nothing is to be skipped.
pub(super) fn moving_bricks(
    grid: &Grid,
    region: &Region,
    frame: &Frame,
    exec: &Exec,
) -> Result<Vec<usize>, Error> {
    let bricks = match (largest(frame) == 0.0, exec.skip) {
        (_, false) => (0..grid.dims().iter().map(|n| n.div_ceil(8)).product()).collect(),
        (true, true) => Vec::new(),
        (false, true) => region.bricks(grid),
    };
    exec.check_memory("the displacement", 2 * 12 * 512 * bricks.len() as u64)?;
    Ok(bricks)
}

/// The field of no motion, in these bricks.
pub(super) fn still(grid: &Grid, bricks: &[usize]) -> Result<FieldBricks, Error> {
    let zeros = vec![[0.0; 3]; FieldBricks::VOXELS * bricks.len()];
    FieldBricks::of_bricks(grid.dims(), bricks, zeros.into())
}

/// Refuses what a field's vectors can't hold.
pub(super) fn check_size(frame: &Frame) -> Result<(), Error> {
    if largest(frame) <= FARTHEST {
        return Ok(());
    }
    Err(Error::Untrusted {
        what: "the map",
        problem: format!("a motion of {:e} mm is more than its vectors hold", largest(frame)),
        remedy: "move the handle less",
    })
}

/// Frame `frame` of a motion of the lattice.
pub(super) fn frame_of<'a>(lattice: &Lattice, motion: &'a Motion, frame: usize) -> Result<&'a Frame, Error> {
    motion.require_of(lattice)?;
    motion.frames().get(frame).ok_or_else(|| Error::Mismatch {
        what: "frame",
        problem: format!("frame {frame} of {}", motion.frames().len()),
        remedy: "name a frame of the motion, counted from 0",
    })
}
