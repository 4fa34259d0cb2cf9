//! A balanced tree over boxes, to find those that pass a test which the box round them passes too.

use nalgebra::Vector3;

type Point = Vector3<f64>;

const FAR: f64 = f64::INFINITY;
/// Boxes of a leaf.
const LEAF: usize = 4;

/// Low and high corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Box {
    pub(super) low: Point,
    pub(super) high: Point,
}

impl Box {
    /// Contains nothing.
    pub(super) const NOTHING: Self =
        Self { low: Point::new(FAR, FAR, FAR), high: Point::new(-FAR, -FAR, -FAR) };

    /// The box round this one and a point.
    pub(super) fn and(self, p: &Point) -> Self {
        Self { low: self.low.inf(p), high: self.high.sup(p) }
    }

    /// The box round both.
    pub(super) fn or(self, other: &Self) -> Self {
        self.and(&other.low).and(&other.high)
    }

    /// The box round points.
    pub(super) fn round<'a>(points: impl IntoIterator<Item = &'a Point>) -> Self {
        points.into_iter().fold(Self::NOTHING, Self::and)
    }

    /// Whether another box lies within this one.
    pub(super) fn holds(&self, other: &Self) -> bool {
        self.low <= other.low && self.high >= other.high
    }
}

/// Boxes with their numbers, halved along the longest extent of their middles down to leaves.
pub(super) struct Boxes {
    nodes: Vec<Node>,
    items: Vec<(u32, Box)>,
}

struct Node {
    around: Box,
    /// Items up to here are its own or its halves'.
    end: u32,
    /// The first half follows at once; the second is here. 0 in a leaf.
    second: u32,
}

impl Boxes {
    /// - `items`: fewer than 2³² of them.
    pub(super) fn new(mut items: Vec<(u32, Box)>) -> Self {
        let mut nodes = Vec::with_capacity(items.len() / 2 + 1);
        build(&mut items, 0, &mut nodes);
        Self { nodes, items }
    }

    /// Tells the numbers of all boxes that pass a test. A box round others must pass if one of them does.
    pub(super) fn visit(&self, passes: impl Fn(&Box) -> bool, mut tell: impl FnMut(u32)) {
        self.descend(0, 0, &passes, &mut tell);
    }

    fn descend(&self, node: u32, first: u32, passes: &impl Fn(&Box) -> bool, tell: &mut impl FnMut(u32)) {
        let Node { around, end, second } = &self.nodes[node as usize];
        if !passes(around) {
            return;
        }
        if *second == 0 {
            let items = &self.items[first as usize..*end as usize];
            items.iter().filter(|item| passes(&item.1)).for_each(|item| tell(item.0));
            return;
        }
        self.descend(node + 1, first, passes, tell);
        self.descend(*second, self.nodes[node as usize + 1].end, passes, tell);
    }
}

fn build(items: &mut [(u32, Box)], first: u32, nodes: &mut Vec<Node>) {
    let around = items.iter().fold(Box::NOTHING, |all, item| all.or(&item.1));
    let node = nodes.len();
    nodes.push(Node { around, end: first + items.len() as u32, second: 0 });
    if items.len() <= LEAF {
        return;
    }
    let middle = |item: &(u32, Box)| item.1.low + item.1.high;
    let middles = items.iter().fold(Box::NOTHING, |all, item| all.and(&middle(item)));
    let axis = (middles.high - middles.low).imax();
    let half = items.len() / 2;
    items
        .select_nth_unstable_by(half, |a, b| middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.0.cmp(&b.0)));
    let (low, high) = items.split_at_mut(half);
    build(low, first, nodes);
    nodes[node].second = nodes.len() as u32;
    build(high, first + half as u32, nodes);
}
