//! From a set of voxels to one part: the piece that holds what was asked for, cut at narrow bridges, without holes, with a level function
//! between its voxels.

mod distance;
mod smooth;

use ivd_core::{Exec, Grid, Mask, Volume};

use crate::Error;
use crate::component::{draw, fill_holes, ones};
use crate::runs::{Runs, piece_count};
pub(crate) use distance::squared_distances;
use smooth::level;

/// One part.
pub(crate) struct Part {
    pub(crate) inside: Vec<u8>,
    /// Pieces that there were.
    pub(crate) components: usize,
    pub(crate) filled: u64,
}

/// The piece that holds most of the chosen voxels (linear indices), cut where it is narrower than twice `opening` (mm), and filled.
///
/// # Errors
/// [`Error::NoBoundary`] where no piece holds any of them, or the opening leaves nothing.
pub(crate) fn part(
    mut inside: Vec<u8>,
    volume: &Volume,
    chosen: &[usize],
    opening: f64,
    fill: bool,
    exec: &Exec,
) -> Result<Part, Error> {
    let grid = volume.grid();
    let dims = grid.dims();
    let components = keep_piece(&mut inside, dims, chosen)?;
    exec.check_cancelled()?;
    if opening > 0.0 {
        open(&mut inside, grid, opening, chosen)?;
        exec.check_cancelled()?;
    }
    let filled = if fill {
        let runs = ones(&inside, dims);
        let pieces = runs.components()?;
        let kept = pieces.first().copied().unwrap_or(0);
        fill_holes(&mut inside, dims, &runs, &pieces, kept, volume)?
    } else {
        0
    };
    Ok(Part { inside, components, filled })
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
fn keep_piece(inside: &mut [u8], dims: [usize; 3], chosen: &[usize]) -> Result<usize, Error> {
    let runs = ones(inside, dims);
    let pieces = runs.components()?;
    let mut counts = std::collections::BTreeMap::<u32, u64>::new();
    for &voxel in chosen.iter().filter(|&&voxel| inside[voxel] != 0) {
        if let Some(run) = run_at(&runs, dims, voxel) {
            *counts.entry(pieces[run]).or_default() += 1;
        }
    }
    let kept = counts.iter().max_by_key(|(piece, count)| (**count, std::cmp::Reverse(**piece)));
    let Some((&kept, _)) = kept else {
        let problem = "the part has left the start: no voxel of that belongs to it";
        return Err(Error::NoBoundary { problem: problem.into() });
    };
    inside.fill(0);
    draw(&runs, &pieces, kept, dims, inside);
    Ok(piece_count(&pieces))
}

fn run_at(runs: &Runs, [nx, ny, _]: [usize; 3], voxel: usize) -> Option<usize> {
    let (x, y, z) = (voxel % nx, voxel / nx % ny, voxel / nx / ny);
    let row = runs.row(y, z);
    let after = row.start + runs.spans_before(row.clone(), x);
    after.checked_sub(1).filter(|run| row.contains(run) && runs.span(*run).contains(&x))
}

/// Erosion by a ball, the piece of the start, and what of the set lies as near to it again, and a voxel more.
fn open(inside: &mut [u8], grid: &Grid, radius: f64, chosen: &[usize]) -> Result<(), Error> {
    let dims = grid.dims();
    let edges = grid.spacing();
    let [low, high] = bounds(inside, dims);
    // The box of the part and a voxel round it, which is outside.
    let size: [usize; 3] = std::array::from_fn(|a| high[a] - low[a] + 2);
    let inner = |i: usize| -> Option<usize> {
        let at = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
        let mut voxel = [0; 3];
        for a in 0..3 {
            voxel[a] = (low[a] + at[a]).checked_sub(1).filter(|v| *v < dims[a])?;
        }
        Some(voxel[0] + dims[0] * (voxel[1] + dims[1] * voxel[2]))
    };
    let limit = (radius * radius) as f32;
    let depth = squared_distances(size, edges, &|i| inner(i).is_none_or(|voxel| inside[voxel] == 0));
    let mut core: Vec<u8> = depth.iter().map(|&d| u8::from(d > limit)).collect();
    if !core.contains(&1) {
        return Err(Error::NoBoundary {
            problem: format!(
                "the part is nowhere wider than {} mm, which the leak guard opens",
                2.0 * radius
            ),
        });
    }
    let own: std::collections::HashSet<usize> = chosen.iter().copied().collect();
    let near: Vec<usize> =
        (0..core.len()).filter(|&i| core[i] != 0 && inner(i).is_some_and(|v| own.contains(&v))).collect();
    let near = if near.is_empty() { nearest(&core, size, edges, &inner, chosen, dims) } else { near };
    keep_piece(&mut core, size, &near)?;
    let away = squared_distances(size, edges, &|i| core[i] != 0);
    // A voxel further than was taken off: the border's steps come back whole.
    let limit = (radius + grid.voxel_volume().cbrt()).powi(2) as f32;
    for (i, &away) in away.iter().enumerate() {
        if let Some(voxel) = inner(i) {
            inside[voxel] = u8::from(inside[voxel] != 0 && away <= limit);
        }
    }
    // Dilation may reach across a thin wall into what hung on a bridge: the piece of the core alone stays.
    let core: Vec<usize> = (0..core.len()).filter(|&i| core[i] != 0).filter_map(inner).collect();
    keep_piece(inside, dims, &core)?;
    Ok(())
}

/// The voxel of a core that is nearest to the start's middle.
fn nearest(
    core: &[u8],
    size: [usize; 3],
    edges: [f64; 3],
    inner: &dyn Fn(usize) -> Option<usize>,
    chosen: &[usize],
    dims: [usize; 3],
) -> Vec<usize> {
    let place = |v: usize| [v % dims[0], v / dims[0] % dims[1], v / dims[0] / dims[1]];
    let mut middle = [0.0; 3];
    for &voxel in chosen {
        let at = place(voxel);
        (0..3).for_each(|a| middle[a] += at[a] as f64 / chosen.len() as f64);
    }
    let far = |i: usize| -> f64 {
        inner(i).map_or(f64::INFINITY, |voxel| {
            let at = place(voxel);
            (0..3).map(|a| ((at[a] as f64 - middle[a]) * edges[a]).powi(2)).sum()
        })
    };
    debug_assert_eq!(core.len(), size.iter().product::<usize>(), "a box of the core");
    (0..core.len()).filter(|&i| core[i] != 0).min_by(|&a, &b| far(a).total_cmp(&far(b))).into_iter().collect()
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
