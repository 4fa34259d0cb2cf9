//! A dendrogram as inline SVG.

use std::fmt::Write as _;

use serde_json::Value;

use super::chart::{AREA, LEFT, number, open};
use super::slices::class_colour;

/// The merges among the last classes of a tree: `leaves` with a mean and a number of voxels, and `merges` of two nodes at a
/// height; node `leaves + i` is made by merge `i`.
struct Dendrogram {
    leaves: Vec<(f64, u64)>,
    merges: Vec<(usize, usize, f64)>,
}

impl Dendrogram {
    fn read(metrics: &Value) -> Option<Self> {
        let list = |key: &str| metrics.get(key)?.as_array();
        let leaf = |v: &Value| Some((v.get("mean")?.as_f64()?, v.get("voxels")?.as_u64()?));
        let node = |v: &Value| usize::try_from(v.as_u64()?).ok();
        let merge = |v: &Value| Some((node(v.get(0)?)?, node(v.get(1)?)?, v.get(2)?.as_f64()?));
        let leaves: Vec<(f64, u64)> = list("leaves")?.iter().map(leaf).collect::<Option<_>>()?;
        let merges: Vec<(usize, usize, f64)> = list("merges")?.iter().map(merge).collect::<Option<_>>()?;
        let known = |(i, m): (usize, &(usize, usize, f64))| m.0.max(m.1) < leaves.len() + i && m.0 != m.1;
        let sound = merges.len() < leaves.len() && merges.iter().enumerate().all(known);
        sound.then_some(Self { leaves, merges })
    }

    /// Leaves from left to right, so that no two branches cross: roots in the order of their nodes.
    fn order(&self) -> Vec<usize> {
        let count = self.leaves.len();
        let mut child = vec![false; count + self.merges.len()];
        for (a, b, _) in &self.merges {
            (child[*a], child[*b]) = (true, true);
        }
        let mut stack: Vec<usize> = (0..child.len()).rev().filter(|n| !child[*n]).collect();
        let mut order = Vec::new();
        while let Some(node) = stack.pop() {
            match node.checked_sub(count) {
                None => order.push(node),
                Some(merge) => stack.extend([self.merges[merge].1, self.merges[merge].0]),
            }
        }
        order
    }
}

/// The dendrogram of a record's figures; nothing where they have none.
pub(super) fn dendrogram(metrics: Option<&Value>) -> String {
    let Some(found) = metrics.and_then(Dendrogram::read).filter(|d| d.leaves.len() > 1) else {
        return String::new();
    };
    let count = found.leaves.len();
    // Heights span decades: their square roots leave the low ones to be seen.
    let top = found.merges.iter().map(|m| m.2.max(0.0).sqrt()).fold(1e-300, f64::max);
    let up = |height: f64| (AREA[1] - 14.0) * (1.0 - height.max(0.0).sqrt() / top) + 6.0;
    let mut places = vec![(0.0, up(0.0)); count];
    let mut svg = open();
    for (place, leaf) in found.order().into_iter().enumerate() {
        let x = LEFT + (place as f64 + 0.5) / count as f64 * AREA[0];
        places[leaf].0 = x;
        let (mean, voxels) = found.leaves[leaf];
        let _ = write!(
            svg,
            "<circle cx='{x:.1}' cy='{:.1}' r='4' fill='{}' stroke='#888'><title>mean {}, {voxels} voxels</title></circle>\
             <text x='{x:.1}' y='{:.1}' class='small' text-anchor='middle'>{}</text>",
            up(0.0),
            class_colour(leaf),
            number(mean),
            AREA[1] + 8.0,
            number(mean)
        );
    }
    for (a, b, height) in &found.merges {
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
    use serde_json::json;

    fn leaves(count: u64) -> Value {
        (0..count).map(|i| json!({ "mean": i, "voxels": 10 })).collect()
    }

    #[test]
    fn branches_do_not_cross() {
        let metrics = json!({ "leaves": leaves(4), "merges": [[0, 3, 1.0], [1, 2, 2.0], [4, 5, 9.0]] });
        let found = Dendrogram::read(&metrics).unwrap();
        assert_eq!(found.order(), [0, 3, 1, 2]);
        let svg = dendrogram(Some(&metrics));
        assert_eq!((svg.matches("<path").count(), svg.matches("<circle").count()), (3, 4));
    }

    #[test]
    fn what_is_no_tree_is_not_drawn() {
        for merges in
            [json!([[0, 9, 1.0]]), json!([[0, 0, 1.0]]), json!([[0, 1, 1.0], [2, 2, 1.0]]), json!(7)]
        {
            assert_eq!(dendrogram(Some(&json!({ "leaves": leaves(2), "merges": merges }))), "");
        }
        assert_eq!(dendrogram(None), "");
    }
}
