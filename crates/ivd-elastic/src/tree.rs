//! Cells of an octree: roots side by side, each cut into eight as often as asked, 2:1 balanced.

/// A place that no root covers.
const ABSENT: u32 = u32::MAX;
/// A cell that isn't cut.
const LEAF: u32 = u32::MAX - 1;

/// A cell: its lowest corner and its edge, in finest cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// Lowest corner.
    pub low: [i32; 3],
    /// Edge.
    pub size: i32,
}

impl Cell {
    /// Its corner, x in bit 0, y in bit 1, z in bit 2.
    pub fn corner(&self, corner: usize) -> [i32; 3] {
        std::array::from_fn(|a| self.low[a] + self.size * (corner >> a & 1) as i32)
    }
}

/// What lies at a finest cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum At {
    /// Beyond all roots: a natural end.
    Beyond,
    /// A root that was left out: held.
    Absent,
    /// A leaf, and its number in the tree.
    Leaf(u32, Cell),
}

/// An octree over a box of roots.
#[derive(Debug, Clone)]
pub(crate) struct Tree {
    roots: [i32; 3],
    /// Finest cells along a root's edge: a power of two.
    edge: i32,
    /// By number the first of eight children, or what there is instead.
    children: Vec<u32>,
}

impl Tree {
    /// Uncut roots, those that `there` takes. `edge`: finest cells along a root's edge, a power of two.
    pub(crate) fn new(roots: [i32; 3], edge: i32, there: impl Fn(&Cell) -> bool) -> Self {
        let mut tree = Self { roots, edge, children: Vec::new() };
        for z in 0..roots[2] {
            for y in 0..roots[1] {
                for x in 0..roots[0] {
                    let root = Cell { low: [x * edge, y * edge, z * edge], size: edge };
                    tree.children.push(if there(&root) { LEAF } else { ABSENT });
                }
            }
        }
        tree
    }

    /// Cells and roots, also those that are cut.
    pub(crate) fn len(&self) -> usize {
        self.children.len()
    }

    /// The leaf at a finest cell.
    pub(crate) fn at(&self, finest: [i32; 3]) -> At {
        if (0..3).any(|a| finest[a] < 0 || finest[a] >= self.roots[a] * self.edge) {
            return At::Beyond;
        }
        let root: [i32; 3] = std::array::from_fn(|a| finest[a] / self.edge);
        let mut number = (root[0] + self.roots[0] * (root[1] + self.roots[1] * root[2])) as usize;
        let mut cell = Cell { low: root.map(|r| r * self.edge), size: self.edge };
        loop {
            match self.children[number] {
                ABSENT => return At::Absent,
                LEAF => return At::Leaf(number as u32, cell),
                first => {
                    let half = cell.size / 2;
                    let upper: [bool; 3] = std::array::from_fn(|a| finest[a] >= cell.low[a] + half);
                    let low = std::array::from_fn(|a| cell.low[a] + half * i32::from(upper[a]));
                    let child = (0..3).map(|a| usize::from(upper[a]) << a).sum::<usize>();
                    (number, cell) = (first as usize + child, Cell { low, size: half });
                }
            }
        }
    }

    fn cut(&mut self, number: u32) {
        self.children[number as usize] = self.children.len() as u32;
        self.children.extend([LEAF; 8]);
    }

    /// Cuts the leaf at a finest cell until its edge is at most `size`.
    pub(crate) fn refine(&mut self, finest: [i32; 3], size: i32) {
        while let At::Leaf(number, cell) = self.at(finest)
            && cell.size > size
        {
            self.cut(number);
        }
    }

    /// Cuts leaves until none is more than twice as long as one that it touches, if only at a corner.
    pub(crate) fn balance(&mut self) {
        let mut work: Vec<Cell> = self.leaves().into_iter().map(|(_, cell)| cell).collect();
        while let Some(cell) = work.pop() {
            for side in 0..27 {
                let step = [side % 3 - 1, side / 3 % 3 - 1, side / 9 - 1];
                let beside: [i32; 3] = std::array::from_fn(|a| cell.low[a] + step[a] * cell.size);
                while let At::Leaf(number, other) = self.at(beside)
                    && other.size > 2 * cell.size
                {
                    self.cut(number);
                    let half = Cell { low: other.low, size: other.size / 2 };
                    work.extend((0..8).map(|corner| Cell { low: half.corner(corner), size: half.size }));
                }
            }
        }
    }

    /// The leaves with their numbers, in the order of roots and children.
    pub(crate) fn leaves(&self) -> Vec<(u32, Cell)> {
        let (mut out, mut work) = (Vec::new(), Vec::new());
        for root in 0..self.roots.iter().product::<i32>() {
            let low = [
                root % self.roots[0],
                root / self.roots[0] % self.roots[1],
                root / self.roots[0] / self.roots[1],
            ];
            work.push((root as u32, Cell { low: low.map(|c| c * self.edge), size: self.edge }));
            while let Some((number, cell)) = work.pop() {
                match self.children[number as usize] {
                    ABSENT => {}
                    LEAF => out.push((number, cell)),
                    first => {
                        let half = Cell { low: cell.low, size: cell.size / 2 };
                        let child =
                            |c: usize| (first + c as u32, Cell { low: half.corner(c), size: half.size });
                        work.extend((0..8).rev().map(child));
                    }
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_leaf_touches_one_of_a_quarter_of_its_edge_and_leaves_fill_the_box() {
        let mut tree = Tree::new([3, 2, 2], 16, |_| true);
        tree.refine([17, 3, 9], 1);
        tree.refine([40, 31, 31], 2);
        tree.balance();
        let leaves = tree.leaves();
        let volume: i64 = leaves.iter().map(|(_, c)| i64::from(c.size).pow(3)).sum();
        assert_eq!(volume, 3 * 2 * 2 * 16_i64.pow(3));
        let touch = |p: &Cell, q: &Cell| {
            (0..3).all(|a| p.low[a] <= q.low[a] + q.size && q.low[a] <= p.low[a] + p.size)
        };
        for (_, p) in &leaves {
            assert!(leaves.iter().all(|(_, q)| !touch(p, q) || p.size <= 2 * q.size));
        }
        assert!(matches!(tree.at([17, 3, 9]), At::Leaf(_, Cell { size: 1, .. })));
        assert_eq!(tree.at([48, 0, 0]), At::Beyond);
    }
}
