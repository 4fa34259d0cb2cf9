//! Single linkage: the merges are the edges of a minimum spanning forest, in order (Kruskal 1956).

use ivd_core::{Error, Exec, Linkage, SpillVec, parallel, sets};

use super::field::{Apart, Field};
use super::figures::Figures;
use super::forest::Edges;
use super::merges::{Heights, Parts};

/// Edges between two looks at whether to stop.
const CHUNK: usize = 1 << 18;

/// Merges the leaves along the edges (ascending) from `flat` on, then what touches nowhere in the order of the means.
///
/// The edges that join are kept first, 4 bytes each in the place of all, and become pairs of leaves once the sets are gone.
/// `figures` are those of the leaves, asked for only where parts touch nowhere.
pub(super) fn merges<T: Apart>(
    field: &Field<'_, T>,
    mut edges: Edges,
    flat: usize,
    (leaves, count): (&[u32], usize),
    figures: impl FnOnce() -> Result<Figures, Error>,
    exec: &Exec,
) -> Result<Parts, Error> {
    let mut sets: SpillVec<u32> = exec.bulk("the parts of the leaves", count)?;
    sets::reset(&mut sets);
    let mut heights = Heights::default();
    let ids = edges.ids_mut();
    for from in (flat..ids.len()).step_by(CHUNK) {
        exec.check_cancelled()?;
        for at in from..(from + CHUNK).min(ids.len()) {
            let edge = ids[at];
            let [a, b] = field.ends(edge).map(|voxel| leaves[voxel]);
            if sets::join(&mut sets, a - 1, b - 1) {
                ids[heights.len] = edge;
                heights.push(field.height(edge));
            }
        }
        heights.tell(exec);
    }
    let joined = heights.len;
    let missing = count.saturating_sub(1) - joined;
    let bridges = if missing > 0 { bridges(&mut sets, &figures()?) } else { Vec::new() };
    drop(sets);
    let mut pairs: SpillVec<[u32; 2]> = exec.bulk("the merges", joined + missing)?;
    parallel::try_for_each_piece_mut(&mut pairs[..joined], CHUNK, &|i, pairs| {
        exec.check_cancelled()?;
        for (pair, edge) in pairs.iter_mut().zip(&edges.ids()[i * CHUNK..]) {
            *pair = field.ends(*edge).map(|voxel| leaves[voxel]);
        }
        Ok::<_, Error>(())
    })?;
    for (pair, (height, bridge)) in pairs[joined..].iter_mut().zip(&bridges) {
        *pair = *bridge;
        heights.push(*height);
    }
    Ok(heights.with(Linkage::Single, pairs, bridges.len() as u32))
}

/// Merges of parts that touch nowhere, with their heights: those next to one another in the order of their means, the nearest means
/// first.
fn bridges(sets: &mut [u32], figures: &Figures) -> Vec<(f64, [u32; 2])> {
    let mut parts: Vec<(u32, f64, f64)> = Vec::new();
    let mut place = std::collections::HashMap::new();
    for leaf in 0..sets.len() as u32 {
        let part = *place.entry(sets::root(sets, leaf)).or_insert_with(|| {
            parts.push((leaf, 0.0, 0.0));
            parts.len() - 1
        });
        let count = f64::from(figures.counts[leaf as usize]);
        let before = parts[part].1;
        parts[part].1 += count;
        // The mean itself, not a sum: it can't overflow.
        let share = count / (before + count);
        parts[part].2 = parts[part].2 * (1.0 - share) + figures.means.get(leaf as usize) * share;
    }
    parts.sort_by(|a, b| a.2.total_cmp(&b.2).then(a.0.cmp(&b.0)));
    let apart = |w: &[(u32, f64, f64)]| (w[1].2 - w[0].2).abs().min(f64::MAX);
    let mut gaps: Vec<(f64, [u32; 2])> =
        parts.windows(2).map(|w| (apart(w), [w[0].0 + 1, w[1].0 + 1])).collect();
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    gaps
}
