use ivd_core::{BrickRange, Labels};
use rayon::prelude::*;

use crate::classify::Classifier;
use crate::warp::Warp;

/// For each brick, the set of rows that its voxels' labels choose (bits of [`Classifier::row_bit`]).
pub(crate) fn rows_of_bricks(labels: &Labels, classifier: &Classifier) -> Vec<u64> {
    let bits: Vec<u64> = (0..=u16::MAX).map(|id| classifier.row_bit(id)).collect();
    let bit = |id: u16| bits[usize::from(id)];
    let of_all = |brick| labels.about_brick(brick).fold(0, |set, id| set | bit(id));
    let only = labels.of_bricks().par_iter().enumerate();
    only.map(|(brick, only)| only.map_or_else(|| of_all(brick), bit)).collect()
}

/// The range of a brick without data.
pub(crate) const NOTHING: BrickRange =
    BrickRange { min: f32::INFINITY, max: f32::NEG_INFINITY, missing: false };

/// The range of two bricks together.
pub(crate) fn join(a: BrickRange, b: BrickRange) -> BrickRange {
    BrickRange { min: a.min.min(b.min), max: a.max.max(b.max), missing: a.missing || b.missing }
}

/// The range of every brick and those about it together.
pub(crate) fn joined_about(bricks: [usize; 3], ranges: &[BrickRange]) -> Vec<BrickRange> {
    let mut joined = ranges.to_vec();
    let mut stride = 1;
    for count in bricks {
        let before = joined.clone();
        for (i, range) in joined.iter_mut().enumerate() {
            let at = i / stride % count;
            if at > 0 {
                *range = join(*range, before[i - stride]);
            }
            if at + 1 < count {
                *range = join(*range, before[i + stride]);
            }
        }
        stride *= count;
    }
    joined
}

/// Reduces a value of the undeformed bricks over the sources of each brick of the deformed volume; `outside` is the value beyond it.
pub(crate) fn through_warp<V: Copy + Send + Sync>(
    warp: Option<&Warp<'_>>,
    bricks: [usize; 3],
    of_brick: Vec<V>,
    outside: V,
    join: impl Fn(V, V) -> V + Sync,
) -> Vec<V> {
    let Some(warp) = warp else { return of_brick };
    let of = |brick: usize| match warp.sources(brick) {
        _ if !warp.moves(brick) => of_brick[brick],
        Some(sources) => over(sources, bricks).fold(outside, |joined, b| join(joined, of_brick[b])),
        None => outside,
    };
    (0..of_brick.len()).into_par_iter().map(of).collect()
}

/// The bricks that something of the given bricks is carried to.
pub(crate) fn carried(warp: &Warp<'_>, bricks: [usize; 3], seen: &[bool]) -> Vec<bool> {
    let of = |brick: usize| {
        if !warp.moves(brick) {
            return seen[brick];
        }
        let sources = warp.nearest_sources(brick);
        sources.is_some_and(|sources| over(sources, bricks).any(|b| seen[b]))
    };
    (0..seen.len()).into_par_iter().map(of).collect()
}

/// The bricks of inclusive ranges along each axis.
fn over([x, y, z]: [[usize; 2]; 3], bricks: [usize; 3]) -> impl Iterator<Item = usize> {
    let rows = (z[0]..=z[1]).flat_map(move |bz| (y[0]..=y[1]).map(move |by| by + bricks[1] * bz));
    rows.flat_map(move |row| (x[0]..=x[1]).map(move |bx| bx + bricks[0] * row))
}
