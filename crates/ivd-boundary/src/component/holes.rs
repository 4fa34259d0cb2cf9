//! Background that a piece encloses: what can't reach the outside through faces.
//!
//! A lattice decides every face that is cut in two ways by itself, so that the outside it sees is joined through faces at least and through
//! corners never. Where piece and outside are both one through faces, the surface between them is one: closed surfaces and the regions
//! that they separate make a tree, of which these two regions are all there is.

use ivd_core::{Error, Volume, with_voxels};
use rayon::prelude::*;

use crate::runs::Runs;

/// Fills the holes of a component with voxels that hold data and are `fillable` (by their linear index), and returns how many that were.
/// Only the component's box is looked at: whatever reaches its faces reaches the outside.
pub(crate) fn fill(
    inside: &mut [u8],
    dims: [usize; 3],
    part: &Runs,
    components: &[u32],
    kept: u32,
    volume: &Volume,
    fillable: &(dyn Fn(usize) -> bool + Sync),
) -> Result<u64, Error> {
    let [low, high] = bounds(part, components, kept, dims);
    let size: [usize; 3] = std::array::from_fn(|a| high[a] - low[a]);
    let row_start = |y: usize, z: usize| low[0] + dims[0] * (low[1] + y + dims[1] * (low[2] + z));
    let background = {
        let inside = &*inside;
        Runs::find(size, |y, z, found| gaps(&inside[row_start(y, z)..][..size[0]], found))
    };
    let pieces = background.components()?;
    let mut outer = vec![false; pieces.len()];
    for z in 0..size[2] {
        for y in 0..size[1] {
            let face = y == 0 || y + 1 == size[1] || z == 0 || z + 1 == size[2];
            for run in background.row(y, z) {
                let span = background.span(run);
                if face || span.start == 0 || span.end == size[0] {
                    outer[pieces[run] as usize] = true;
                }
            }
        }
    }
    let filled = inside
        .par_chunks_mut(dims[0] * dims[1])
        .enumerate()
        .skip(low[2])
        .take(size[2])
        .map(|(z, slice)| {
            let mut filled = 0;
            for y in 0..size[1] {
                let start = low[0] + dims[0] * (low[1] + y);
                for run in background.row(y, z - low[2]).filter(|&run| !outer[pieces[run] as usize]) {
                    let span = background.span(run);
                    let range = start + span.start..start + span.end;
                    let first = z * dims[0] * dims[1] + range.start;
                    filled += fill_data(&mut slice[range], volume, first, fillable);
                }
            }
            filled
        })
        .sum();
    Ok(filled)
}

/// Sets the voxels that hold data and are `fillable`; `first` is the linear index of the first.
fn fill_data(
    target: &mut [u8],
    volume: &Volume,
    first: usize,
    fillable: &(dyn Fn(usize) -> bool + Sync),
) -> u64 {
    use ivd_core::Scalar;
    with_voxels!(volume.voxels(), voxels => {
        let found = (first..).zip(target).zip(&voxels[first..]);
        found.filter(|((i, _), v)| v.is_data() && fillable(*i)).map(|((_, t), _)| *t = 1).count() as u64
    })
}

/// Lowest and one past the highest voxel of a component.
fn bounds(runs: &Runs, components: &[u32], kept: u32, dims: [usize; 3]) -> [[usize; 3]; 2] {
    let (mut low, mut high) = (dims, [0; 3]);
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for run in runs.row(y, z).filter(|&run| components[run] == kept) {
                let span = runs.span(run);
                for (a, [from, to]) in
                    [[span.start, span.end], [y, y + 1], [z, z + 1]].into_iter().enumerate()
                {
                    low[a] = low[a].min(from);
                    high[a] = high[a].max(to);
                }
            }
        }
    }
    [low, high]
}

/// Runs of zeros.
fn gaps(row: &[u8], found: &mut Vec<[u32; 2]>) {
    super::choice::runs_where(row, |&v| v == 0, found);
}
