//! Single linkage: the merges are the edges of a minimum spanning forest, in order (Kruskal 1956).

use ivd_core::{Error, Exec, SpillVec, sets};

use super::field::{Apart, Field};
use super::figures::Figures;
use super::merges::Merges;

/// Edges between two looks at whether to stop.
const CHUNK: usize = 1 << 18;

/// Merges the leaves along the edges (ascending), then what touches nowhere in the order of the means.
pub(super) fn merges<T: Apart>(
    field: &Field<'_, T>,
    edges: &[u32],
    leaves: &[u32],
    figures: &Figures,
    exec: &Exec,
) -> Result<Merges, Error> {
    let mut merges = Merges::of(figures.counts.len(), exec)?;
    let mut sets: SpillVec<u32> = exec.bulk("the parts of the leaves", figures.counts.len())?;
    sets::reset(&mut sets);
    for part in edges.chunks(CHUNK) {
        exec.check_cancelled()?;
        for &edge in part {
            let pair = field.ends(edge).map(|voxel| leaves[voxel]);
            if sets::join(&mut sets, pair[0] - 1, pair[1] - 1) {
                merges.push(pair, field.height(edge));
            }
        }
        merges.tell(exec);
    }
    if !merges.full() {
        bridge(&mut merges, &mut sets, figures);
    }
    Ok(merges)
}

/// Joins parts that touch nowhere: those next to one another in the order of their means, the nearest means first.
fn bridge(merges: &mut Merges, sets: &mut [u32], figures: &Figures) {
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
    for (height, pair) in gaps {
        merges.push(pair, height);
        merges.bridges += 1;
    }
}
