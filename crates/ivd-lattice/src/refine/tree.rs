//! The nearest triangle of a mesh: a balanced tree of boxes.
//!
//! Triangles are parted by the middles of their boxes along the longest extent, down to leaves of four. A tree of `l`
//! leaves has `2 l - 1` nodes in preorder, the left part being the largest full tree: no node needs to name its children.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::distance::closest_on_triangle;

type Point = Vector3<f64>;

/// Triangles of a leaf.
const LEAF: usize = 4;
/// Parts with fewer triangles are built by one thread.
const ALONE: usize = 1 << 12;
/// Levels of a tree of 2³² triangles, with room to spare.
const DEPTH: usize = 48;

/// Triangles, and the boxes round them.
pub(super) struct Tree {
    /// Low and high corner of each node's box.
    boxes: Vec<[Point; 2]>,
    triangles: Vec<[Point; 3]>,
}

/// The triangle of a tree nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Near {
    /// Its number in the tree.
    pub(super) triangle: u32,
    /// Its distance (mm).
    pub(super) off: f64,
}

impl Tree {
    /// The tree of a mesh's triangles. The numbers that it gives them are its own.
    pub(super) fn new(places: &[Point], triangles: &[[u32; 3]]) -> Self {
        let unsorted: Vec<[Point; 3]> = triangles.par_iter().map(|t| t.map(|v| places[v as usize])).collect();
        let middles: Vec<Point> =
            unsorted.par_iter().map(|[a, b, c]| a.inf(b).inf(c) + a.sup(b).sup(c)).collect();
        let mut order: Vec<u32> = (0..unsorted.len() as u32).collect();
        let nodes = (2 * unsorted.len().div_ceil(LEAF)).saturating_sub(1);
        let mut boxes = vec![[Point::zeros(); 2]; nodes];
        if nodes > 0 {
            build(&unsorted, &middles, &mut order, &mut boxes);
        }
        Self { boxes, triangles: order.par_iter().map(|&t| unsorted[t as usize]).collect() }
    }

    /// Bytes that a tree of so many triangles takes while it is built.
    pub(super) fn bytes(triangles: usize) -> u64 {
        200 * triangles as u64
    }

    /// Number of triangles.
    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there are no triangles.
    pub(super) fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Corners of a triangle.
    pub(super) fn corners(&self, triangle: u32) -> &[Point; 3] {
        &self.triangles[triangle as usize]
    }

    /// Distance (mm) of a point from a triangle.
    pub(super) fn off(&self, p: &Point, triangle: u32) -> f64 {
        self.squared(p, triangle).sqrt()
    }

    fn squared(&self, p: &Point, triangle: u32) -> f64 {
        let [a, b, c] = self.corners(triangle);
        (closest_on_triangle(p, [a, b, c]) - p).norm_squared()
    }

    /// The triangle nearest to a point; of equally near ones always the same. The tree mustn't be empty.
    ///
    /// - `guess`: a triangle that may be near; the nearer, the less there is to search.
    pub(super) fn nearest(&self, p: &Point, guess: u32) -> Near {
        let mut best = (self.squared(p, guess), guess);
        let mut stack = [(0.0, 0, 0, 0); DEPTH];
        stack[0] = (self.to_box(p, 0), 0, 0, self.triangles.len());
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (off, node, first, count) = stack[height];
            if off >= best.0 {
                continue;
            }
            if count <= LEAF {
                for t in first as u32..(first + count) as u32 {
                    let squared = self.squared(p, t);
                    if squared < best.0 {
                        best = (squared, t);
                    }
                }
                continue;
            }
            let (left, right) = (left_of(count), node + 2 * left_of(count) / LEAF);
            let low = (self.to_box(p, node + 1), node + 1, first, left);
            let high = (self.to_box(p, right), right, first + left, count - left);
            // The nearer part is searched first.
            let (next, later) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            stack[height] = later;
            stack[height + 1] = next;
            height += 2;
        }
        Near { triangle: best.1, off: best.0.sqrt() }
    }

    /// Squared distance (mm²) of a point from a node's box.
    fn to_box(&self, p: &Point, node: usize) -> f64 {
        let [low, high] = &self.boxes[node];
        (low - p).sup(&(p - high)).sup(&Point::zeros()).norm_squared()
    }
}

/// Triangles of the left part of a node of more than one leaf: the largest full tree that isn't all.
fn left_of(count: usize) -> usize {
    count.div_ceil(LEAF).next_power_of_two() / 2 * LEAF
}

fn build(triangles: &[[Point; 3]], middles: &[Point], order: &mut [u32], boxes: &mut [[Point; 2]]) {
    let nothing = || [Point::repeat(f64::INFINITY), Point::repeat(f64::NEG_INFINITY)];
    let around = order.iter().fold(nothing(), |[low, high], &t| {
        let [a, b, c] = &triangles[t as usize];
        [low.inf(a).inf(b).inf(c), high.sup(a).sup(b).sup(c)]
    });
    boxes[0] = around;
    if order.len() <= LEAF {
        return;
    }
    let [low, high] = order.iter().fold(nothing(), |[low, high], &t| {
        let middle = &middles[t as usize];
        [low.inf(middle), high.sup(middle)]
    });
    let axis = (high - low).imax();
    let left = left_of(order.len());
    order.select_nth_unstable_by(left, |&a, &b| {
        middles[a as usize][axis].total_cmp(&middles[b as usize][axis]).then(a.cmp(&b))
    });
    let (left_order, right_order) = order.split_at_mut(left);
    let (left_boxes, right_boxes) = boxes[1..].split_at_mut(2 * left / LEAF - 1);
    if left_order.len() < ALONE {
        build(triangles, middles, left_order, left_boxes);
        build(triangles, middles, right_order, right_boxes);
    } else {
        rayon::join(
            || build(triangles, middles, left_order, left_boxes),
            || build(triangles, middles, right_order, right_boxes),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_triangle_is_as_near_as_a_search_of_all_finds() {
        let place = |i: u32| {
            let hash = |k: u32| f64::from((i * 4 + k).wrapping_mul(2_654_435_761) >> 12) / f64::from(1 << 20);
            Point::new(hash(0), 3.0 * hash(1), 0.2 * hash(2))
        };
        let places: Vec<_> = (0..400).map(place).collect();
        for count in [1, 4, 5, 8, 9, 63, 64, 65, 130] {
            let triangles: Vec<_> = (0..count).map(|i| [i, (i * 7 + 3) % 400, (i * 11 + 5) % 400]).collect();
            let tree = Tree::new(&places, &triangles);
            for i in 400..600 {
                let p = place(i) * 1.5 - Point::repeat(0.2);
                let plain = (0..count).map(|t| tree.off(&p, t)).fold(f64::INFINITY, f64::min);
                let found = tree.nearest(&p, i % count);
                assert_eq!((found.off, tree.off(&p, found.triangle)), (plain, plain), "{count} triangles");
            }
        }
    }
}
