//! Which leaves touch.

use ivd_core::{Error, Exec};
use rayon::prelude::*;

/// Neighbours of every leaf, ascending: those of leaf `i + 1` are `of(i)`, from 0.
pub(super) struct Graph {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Graph {
    pub(super) fn of(&self, leaf: usize) -> &[u32] {
        &self.neighbours[self.starts[leaf]..self.starts[leaf + 1]]
    }
}

/// The graph of leaves that have neighbouring voxels.
pub(super) fn graph(leaves: &[u32], count: usize, dims: [usize; 3], exec: &Exec) -> Result<Graph, Error> {
    let layer = dims[0] * dims[1];
    let layers = (0..dims[2]).into_par_iter().map(|z| {
        exec.check_cancelled()?;
        let next = (z + 1 < dims[2]).then(|| &leaves[(z + 1) * layer..][..layer]);
        Ok(borders(&leaves[z * layer..][..layer], next, dims[0]))
    });
    let mut pairs: Vec<u64> = layers.collect::<Result<Vec<_>, Error>>()?.concat();
    pairs.par_sort_unstable();
    pairs.dedup();
    let mut starts = vec![0_usize; count + 1];
    let ends = |pair: &u64| [(pair >> 32) as usize - 1, *pair as u32 as usize - 1];
    for pair in &pairs {
        for leaf in ends(pair) {
            starts[leaf + 1] += 1;
        }
    }
    (0..count).for_each(|i| starts[i + 1] += starts[i]);
    let mut next = starts.clone();
    let mut neighbours = vec![0; 2 * pairs.len()];
    for pair in &pairs {
        let [a, b] = ends(pair);
        for (from, to) in [(a, b), (b, a)] {
            neighbours[next[from]] = to as u32;
            next[from] += 1;
        }
    }
    Ok(Graph { starts, neighbours })
}

/// The pairs of leaves that touch in a layer and between it and the next, the lesser in the upper half, each once.
fn borders(layer: &[u32], next: Option<&[u32]>, width: usize) -> Vec<u64> {
    let mut pairs = Vec::new();
    let mut last = 0;
    let mut see = |a: u32, b: u32| {
        let pair = u64::from(a.min(b)) << 32 | u64::from(a.max(b));
        if a != b && a > 0 && b > 0 && pair != last {
            last = pair;
            pairs.push(pair);
        }
    };
    for row in layer.chunks(width) {
        row.windows(2).for_each(|w| see(w[0], w[1]));
    }
    layer.iter().zip(layer.iter().skip(width)).for_each(|(a, b)| see(*a, *b));
    if let Some(next) = next {
        layer.iter().zip(next).for_each(|(a, b)| see(*a, *b));
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
