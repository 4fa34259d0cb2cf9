//! A dendrogram as inline SVG.

use ivd_core::counted;
use std::fmt::Write as _;

use crate::chart::{AREA, LEFT, open};
use crate::html::number;

/// What was joined with what, and at which height.
#[derive(Debug, Clone, PartialEq)]
pub struct Dendrogram<'a> {
    /// The leaves, which are its first nodes.
    pub leaves: Vec<Leaf>,
    /// Two nodes and the height at which they join, ascending; merge i is the node after the leaves and the merges before it.
    pub merges: &'a [(usize, usize, f64)],
}

/// A leaf of a [`Dendrogram`].
#[derive(Debug, Clone, PartialEq)]
pub struct Leaf {
    /// Mean of its values.
    pub mean: f64,
    /// Number of its voxels.
    pub voxels: u64,
    /// Its colour, as CSS writes it.
    pub colour: String,
}

/// Whether each merge is of two nodes that are there before it: a record may be anybody's.
fn is_sound(tree: &Dendrogram<'_>) -> bool {
    let known = |(i, m): (usize, &(usize, usize, f64))| m.0.max(m.1) < tree.leaves.len() + i && m.0 != m.1;
    tree.merges.len() < tree.leaves.len() && tree.merges.iter().enumerate().all(known)
}

/// Leaves from left to right, so that no two branches cross: roots in the order of their nodes.
fn order(tree: &Dendrogram<'_>) -> Vec<usize> {
    let count = tree.leaves.len();
    let mut child = vec![false; count + tree.merges.len()];
    for (a, b, _) in tree.merges {
        (child[*a], child[*b]) = (true, true);
    }
    let mut stack: Vec<usize> = (0..child.len()).rev().filter(|n| !child[*n]).collect();
    let mut order = Vec::new();
    while let Some(node) = stack.pop() {
        match node.checked_sub(count) {
            None => order.push(node),
            Some(merge) => stack.extend([tree.merges[merge].1, tree.merges[merge].0]),
        }
    }
    order
}

/// The dendrogram as SVG; nothing where it has no two leaves, or isn't one.
pub fn dendrogram(found: &Dendrogram<'_>) -> String {
    if found.leaves.len() < 2 || !is_sound(found) {
        return String::new();
    }
    let count = found.leaves.len();
    // Heights span decades: their square roots leave the low ones to be seen.
    let top = found.merges.iter().map(|m| m.2.max(0.0).sqrt()).fold(1e-300, f64::max);
    let up = |height: f64| (AREA[1] - 14.0) * (1.0 - height.max(0.0).sqrt() / top) + 6.0;
    let mut places = vec![(0.0, up(0.0)); count];
    let mut svg = open();
    for (place, leaf) in order(found).into_iter().enumerate() {
        let x = LEFT + (place as f64 + 0.5) / count as f64 * AREA[0];
        places[leaf].0 = x;
        let Leaf { mean, voxels, colour } = &found.leaves[leaf];
        let _ = write!(
            svg,
            "<circle cx='{x:.1}' cy='{:.1}' r='4' fill='{colour}' stroke='#888'><title>mean {}, {}</title></circle>\
             <text x='{x:.1}' y='{:.1}' class='small' text-anchor='middle'>{}</text>",
            up(0.0),
            number(*mean),
            counted(*voxels, "voxel", "voxels"),
            AREA[1] + 8.0,
            number(*mean)
        );
    }
    for (a, b, height) in found.merges {
        let (left, right, y) = (places[*a], places[*b], up(*height));
        let _ = write!(
            svg,
            "<path d='M{:.1} {:.1}V{y:.1}H{:.1}V{:.1}' class='line'><title>height {}</title></path>",
            left.0,
            left.1,
            right.0,
            right.1,
            number(*height)
        );
        places.push((left.0.midpoint(right.0), y));
    }
    let _ = write!(
        svg,
        "<text x='{:.1}' y='{:.1}' class='label' text-anchor='middle'>classes by their means; heights as square roots</text></svg>",
        LEFT + AREA[0] / 2.0,
        AREA[1] + 24.0
    );
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(count: usize, merges: &[(usize, usize, f64)]) -> Dendrogram<'_> {
        let leaf = |i| Leaf { mean: i as f64, voxels: 10, colour: "#777".to_owned() };
        Dendrogram { leaves: (0..count).map(leaf).collect(), merges }
    }

    #[test]
    fn branches_do_not_cross() {
        let found = tree(4, &[(0, 3, 1.0), (1, 2, 2.0), (4, 5, 9.0)]);
        assert_eq!(order(&found), [0, 3, 1, 2]);
        let svg = dendrogram(&found);
        assert_eq!((svg.matches("<path").count(), svg.matches("<circle").count()), (3, 4));
    }

    #[test]
    fn what_is_no_tree_is_not_drawn() {
        for merges in [&[(0, 9, 1.0)][..], &[(0, 0, 1.0)], &[(0, 1, 1.0), (2, 2, 1.0)]] {
            assert_eq!(dendrogram(&tree(2, merges)), "");
        }
        assert_eq!(dendrogram(&tree(1, &[])), "");
    }
}
