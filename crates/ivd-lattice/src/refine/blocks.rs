//! Blocks of space, so that threads can collapse vertices side by side.
//!
//! A vertex whose whole ring lies in one block may be removed together with any such vertex of another block: a triangle
//! that lies in two blocks has no corner of that kind, so that neither removal touches it. What lies across a border of
//! blocks waits; the next pass has its borders elsewhere. Blocks follow from the surface alone, not from the number of
//! threads, and within one the order is that of cost: the result is the same for any number of threads.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::surface::Surface;

/// Side of a block in mean lengths of a side of a triangle. Larger leaves less on borders (an eighth or so at 48) and
/// fewer blocks for threads to share.
const SIDE: f64 = 48.0;
/// Blocks along an axis at most.
const MOST: f64 = 16.0;

/// Which block each vertex is in.
pub(super) struct Blocks {
    of: Vec<u16>,
    count: usize,
}

impl Blocks {
    /// Everything in one block.
    pub(super) fn one(surface: &Surface) -> Self {
        Self { of: vec![0; surface.positions.len()], count: 1 }
    }

    /// Cubes of a size that suits the triangles left, shifted by half a side in every second pass.
    pub(super) fn new(surface: &Surface, area: f64, pass: u32) -> Self {
        let high = surface.positions.par_iter().copied().reduce(Vector3::zeros, |a, b| a.sup(&b));
        // Positions are centred: the box reaches as far below 0 as above.
        let mean_side = (2.0 * area / surface.triangles.len().max(1) as f64).sqrt();
        let side = (SIDE * mean_side).max(2.0 * high.max() / (MOST - 1.0));
        if side.is_nan() || side <= 0.0 {
            return Self::one(surface);
        }
        let shift = if pass.is_multiple_of(2) { 0.0 } else { 0.5 };
        let dims = high.map(|h| (2.0 * h / side + shift) as usize + 1);
        let of = surface
            .positions
            .par_iter()
            .map(|p| {
                let cell = ((p + high) / side).map(|c| (c + shift) as usize);
                let [x, y, z] = [cell.x.min(dims.x - 1), cell.y.min(dims.y - 1), cell.z.min(dims.z - 1)];
                (x + dims.x * (y + dims.y * z)) as u16
            })
            .collect();
        Self { of, count: dims.product() }
    }

    /// The block of a vertex.
    #[inline]
    pub(super) fn of(&self, v: u32) -> u16 {
        self.of[v as usize]
    }

    /// Groups entries, the low half of each of which is a vertex, by block: the blocks that have any, and theirs in the
    /// order given.
    pub(super) fn group<'a>(&self, entries: &'a mut Vec<u64>) -> Vec<(u16, &'a mut [u64])> {
        let mut lengths = vec![0; self.count];
        for &entry in &*entries {
            lengths[self.of(entry as u32) as usize] += 1;
        }
        let mut next: Vec<usize> = Vec::with_capacity(self.count);
        let mut sum = 0;
        for length in &lengths {
            next.push(sum);
            sum += length;
        }
        let mut grouped = vec![0; entries.len()];
        for &entry in &*entries {
            let slot = &mut next[self.of(entry as u32) as usize];
            grouped[*slot] = entry;
            *slot += 1;
        }
        *entries = grouped;
        split(entries, &lengths)
    }
}

/// Cuts entries into pieces of given lengths, without the empty ones.
fn split<'a>(mut entries: &'a mut [u64], lengths: &[usize]) -> Vec<(u16, &'a mut [u64])> {
    let mut pieces = Vec::new();
    for (block, &length) in lengths.iter().enumerate().filter(|l| *l.1 > 0) {
        let (piece, rest) = entries.split_at_mut(length);
        pieces.push((block as u16, piece));
        entries = rest;
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_grouped_by_block_and_keep_their_order() {
        let blocks = Blocks { of: vec![2, 0, 2, 4, 0], count: 5 };
        let mut entries = vec![7 << 32 | 2, 9 << 32 | 1, 1 << 32 | 3, 3 << 32, 2 << 32 | 4];
        let [c, b, d, a, e] = entries[..] else { unreachable!() };
        let groups = blocks.group(&mut entries);
        let groups: Vec<_> = groups.iter().map(|g| (g.0, g.1.to_vec())).collect();
        assert_eq!(groups, [(0, vec![b, e]), (2, vec![c, a]), (4, vec![d])]);
    }
}
