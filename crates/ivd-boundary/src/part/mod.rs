//! From a set of voxels to one part: the piece that holds what was asked for, cut at narrow bridges, without holes, with a level function
//! between its voxels.

mod distance;
mod frame;
mod open;
mod smooth;

use std::cmp::Reverse;
use std::ops::Range;

use ivd_core::{Exec, Grid, Mask, Volume, parallel};

use crate::Error;
use crate::component::{draw, fill_holes, ones};
use crate::runs::{Runs, piece_count};
pub(crate) use distance::{limit, squared_distances};
pub(crate) use frame::Frame;
use smooth::level;

/// Tells of a voxel, by its linear index, whether it is one of a set.
pub(crate) type Chosen<'a> = dyn Fn(usize) -> bool + Sync + 'a;

/// One part.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) inside: Vec<u8>,
    /// Pieces that there were.
    pub(crate) components: usize,
    pub(crate) filled: u64,
}

/// The piece that holds most of the chosen voxels, cut where it is narrower than twice `opening` (mm), and filled: of its holes with the
/// voxels that `fill` tells, where there are any.
///
/// # Errors
/// [`Error::NoBoundary`] where no piece holds any of them, or the opening leaves nothing near them; memory, cancelled.
pub(crate) fn part(
    mut inside: Vec<u8>,
    volume: &Volume,
    chosen: &Chosen,
    opening: f64,
    fill: Option<&Chosen>,
    exec: &Exec,
) -> Result<Part, Error> {
    let grid = volume.grid();
    let dims = grid.dims();
    let components = keep_piece(&mut inside, dims, chosen)?;
    exec.check_cancelled()?;
    if opening > 0.0 {
        open::open(&mut inside, grid, opening, chosen, exec)?;
        exec.check_cancelled()?;
    }
    let filled = fill.map_or(Ok(0), |fillable| fill_piece(&mut inside, volume, fillable))?;
    Ok(Part { inside, components, filled })
}

/// Fills the holes of a set of one piece, as far as they are `fillable` and touch it; gives how many voxels that were.
fn fill_piece(inside: &mut [u8], volume: &Volume, fillable: &Chosen) -> Result<u64, Error> {
    let dims = volume.grid().dims();
    let runs = ones(inside, dims);
    let pieces = runs.components()?;
    let Some(&kept) = pieces.first() else { return Ok(0) };
    let filled = fill_holes(inside, dims, &runs, &pieces, kept, volume, fillable)?;
    if filled == 0 {
        return Ok(0);
    }
    // What lies within what may not be filled is another piece.
    let before: usize = (0..runs.len()).map(|run| runs.span(run).len()).sum();
    let first = runs.first_voxel();
    keep_piece(inside, dims, &|voxel| Some(voxel) == first)?;
    Ok((inside.iter().filter(|&&v| v != 0).count() - before) as u64)
}

/// A set as a mask with a level function that places its border between voxels.
///
/// # Errors
/// Memory, cancelled.
pub(crate) fn levelled(inside: Vec<u8>, grid: &Grid, exec: &Exec) -> Result<Mask, Error> {
    let level = level(&inside, grid.dims(), exec)?;
    Ok(Mask::new(grid.clone(), inside.into())?.with_level(level.into())?)
}

/// Keeps the piece that holds most of the chosen voxels; gives the number of pieces.
fn keep_piece(inside: &mut [u8], dims: [usize; 3], chosen: &Chosen) -> Result<usize, Error> {
    let runs = ones(inside, dims);
    let pieces = runs.components()?;
    let count = piece_count(&pieces);
    if count == 1 && any_chosen(&runs, dims, chosen) {
        return Ok(1);
    }
    let of_runs = parallel::map(dims[2], &|z| {
        let rows = (0..dims[1]).map(|y| (runs.row(y, z), dims[0] * (y + dims[1] * z)));
        let held = |(of_row, first): (Range<usize>, usize)| {
            let count = |run| runs.span(run).filter(|x| chosen(first + x)).count() as u64;
            of_row.map(count).collect::<Vec<_>>()
        };
        rows.flat_map(held).collect::<Vec<_>>()
    });
    let mut counts = vec![0_u64; pieces.len()];
    for (&piece, count) in pieces.iter().zip(of_runs.into_iter().flatten()) {
        counts[piece as usize] += count;
    }
    let kept = (0..counts.len()).max_by_key(|&piece| (counts[piece], Reverse(piece)));
    let Some(kept) = kept.filter(|&piece| counts[piece] > 0) else {
        let problem = "the part has left the start: no voxel of that belongs to it";
        return Err(Error::no_boundary(problem, "start elsewhere in the part, or with another radius"));
    };
    inside.fill(0);
    draw(&runs, &pieces, kept as u32, dims, inside);
    Ok(count)
}

/// Whether any voxel of the runs is chosen.
fn any_chosen(runs: &Runs, dims: [usize; 3], chosen: &Chosen) -> bool {
    (0..dims[1] * dims[2]).any(|row| {
        let mut spans = runs.row(row % dims[1], row / dims[1]).map(|run| runs.span(run));
        spans.any(|mut span| span.any(|x| chosen(x + dims[0] * row)))
    })
}

/// Lowest and one past the highest voxel of a mask.
pub(crate) fn bounds(inside: &[u8], dims: [usize; 3]) -> [[usize; 3]; 2] {
    let (mut low, mut high) = (dims, [0; 3]);
    for (row, voxels) in inside.chunks(dims[0]).enumerate() {
        let Some(first) = voxels.iter().position(|&v| v != 0) else { continue };
        let last = voxels.iter().rposition(|&v| v != 0).unwrap_or(first);
        let (y, z) = (row % dims[1], row / dims[1]);
        for (a, [from, to]) in [[first, last], [y, y], [z, z]].into_iter().enumerate() {
            low[a] = low[a].min(from);
            high[a] = high[a].max(to + 1);
        }
    }
    [low, high]
}

#[cfg(test)]
mod tests {
    use ivd_core::{Classified, ErrorClass};

    use super::*;

    const DIMS: [usize; 3] = [36, 36, 24];

    fn volume() -> Volume {
        let grid = Grid::with_spacing(DIMS, [1.0; 3]).unwrap();
        let voxels = vec![1_u8; grid.len()];
        Volume::new(grid, voxels.into()).unwrap()
    }

    /// A block with a thin arm, and another block beside the arm that hangs on the first by a thin bridge.
    fn blocks([x, y, z]: [usize; 3]) -> bool {
        let first = (20..32).contains(&x) && (5..22).contains(&y) && (5..17).contains(&z);
        let second = (2..15).contains(&x) && (13..25).contains(&y) && (5..17).contains(&z);
        let arm = (2..20).contains(&x) && [y, z] == [10, 10];
        let bridge = (15..20).contains(&x) && [y, z] == [19, 10];
        first || second || arm || bridge
    }

    fn guarded(opening: f64, chosen: &dyn Fn([usize; 3]) -> bool) -> Result<Part, Error> {
        let volume = volume();
        let grid = volume.grid();
        let inside = (0..grid.len()).map(|i| u8::from(blocks(grid.index(i).0))).collect();
        let held: Vec<bool> = (0..grid.len()).map(|i| chosen(grid.index(i).0)).collect();
        part(inside, &volume, &|i| held[i], opening, None, &Exec::default())
    }

    #[test]
    fn a_leak_guard_goes_on_with_the_core_that_the_start_leads_to() {
        // The second block is nearer to the arm's middle, and further along the part.
        let on_arm = |x: usize| move |at: [usize; 3]| at[0] < x && at[1..] == [10, 10];
        let found = guarded(2.5, &on_arm(19)).unwrap();
        let volume = volume();
        let x = |i: usize| volume.grid().index(i).0[0];
        assert!((0..found.inside.len()).all(|i| found.inside[i] == 0 || x(i) > 16));
        assert!(found.inside.iter().filter(|&&v| v != 0).count() >= 12 * 17 * 12);
        let far = guarded(2.5, &on_arm(10)).unwrap_err();
        assert_eq!(far.error_class(), ErrorClass::Untrusted);
        assert!(far.to_string().contains("leak guard") && far.to_string().contains("smaller open"), "{far}");
    }
}
