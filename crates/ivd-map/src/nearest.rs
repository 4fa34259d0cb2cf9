//! Maps by nearest lattice points, whatever finds them.

use ivd_core::op::Op as _;
use ivd_core::{Error as CoreError, Exec, FieldBricks, Frame, Lattice, Mask, Motion};
use nalgebra::Vector3;

use crate::Error;
use crate::frame::{check_size, frame_of, moving_bricks};
use crate::nearest_weight::{Kept, Nearest, Part, carry, seek};
use crate::outcome::MapResult;
use crate::params::{Band, OctreeParams, Outside};
use crate::region::Region;
use crate::settle::Settle;

/// Maps frame `frame` of a motion with nearest points from any source.
///
/// - `inside`: the voxels inside the lattice, on its grid.
/// - `nearest`: finds the nearest lattice point.
///
/// # Errors
/// Inputs that don't belong together; parameters out of their domain; [`Error::Folded`] or [`ivd_core::Error::Untrusted`] where no
/// map free of folds follows the motion; the memory limit; cancellation.
pub fn nearest<N: Nearest>(
    lattice: &Lattice,
    inside: &Mask,
    nearest: &N,
    motion: &Motion,
    frame: usize,
    params: &OctreeParams,
    exec: &Exec,
) -> Result<MapResult, Error> {
    params.check()?;
    let frame = frame_of(lattice, motion, frame)?;
    inside.grid().require(lattice.grid(), "inside", "lattice")?;
    exec.run(|| {
        let positions = lattice.local_positions();
        let part = Part { lattice, positions: &positions, inside, nearest };
        let region = region_of(motion, frame, &positions, params);
        let field = carried(&part, frame, &region, params, None, exec)?;
        settle_of(&part, motion, frame, &region, &params.band).settle(field, exec)
    })
}

/// Ω of a frame, with the widths of each handle.
pub(super) fn region_of(
    motion: &Motion,
    frame: &Frame,
    positions: &[Vector3<f64>],
    OctreeParams { band, depth, .. }: &OctreeParams,
) -> Region {
    let region = Region::new(motion, frame, positions, band, *depth);
    region.of_each(motion.grid(), frame, positions, band, *depth)
}

/// The field of one frame before any repair, with the nearest points that `part` finds or that are kept.
pub(super) fn carried<N: Nearest>(
    part: &Part<'_, N>,
    frame: &Frame,
    region: &Region,
    params: &OctreeParams,
    mut kept: Option<&mut Kept>,
    exec: &Exec,
) -> Result<FieldBricks, CoreError> {
    let grid = part.lattice.grid();
    check_size(frame)?;
    let bricks = moving_bricks(grid, region, frame, exec)?;
    // Where there is no room nothing is kept: what was mapped before decides over no refusal.
    if let Some(kept) = &mut kept
        && !room(kept.with(&bricks), exec)
    {
        kept.clear();
    }
    let kept = kept.filter(|_| room(bricks.len(), exec));
    let carried = carry(part, &frame.displacement, region, params, &bricks, kept, exec)?;
    FieldBricks::of_bricks(grid.dims(), &bricks, carried.into())
}

/// Whether nearest points of so many bricks may be kept.
fn room(bricks: usize, exec: &Exec) -> bool {
    exec.check_memory("the nearest points of the map", Kept::BRICK * bricks as u64).is_ok()
}

/// Finds the nearest points of a region before they are asked for, where there is room.
pub(super) fn look_ahead<N: Nearest>(
    part: &Part<'_, N>,
    region: &Region,
    params: &OctreeParams,
    kept: &mut Kept,
    exec: &Exec,
) -> Result<(), CoreError> {
    let bricks = region.bricks(part.lattice.grid());
    if room(kept.with(&bricks), exec) { seek(part, region, params, &bricks, kept, exec) } else { Ok(()) }
}

pub(super) fn settle_of<'a, N>(
    part: &Part<'a, N>,
    motion: &'a Motion,
    frame: &'a Frame,
    region: &'a Region,
    band: &'a Band,
) -> Settle<'a> {
    let alone = (band.outside == Outside::Free).then_some(part.inside);
    Settle { lattice: part.lattice, alone, region, motion, frame, band }
}
