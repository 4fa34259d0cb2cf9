//! Nodes of the cells, those that hang on a coarser cell's face or edge expressed by that cell's corners.

use std::collections::BTreeMap;

use crate::tree::{At, Cell, Tree};

const NONE: u32 = u32::MAX;

/// The cells that take part, and their nodes.
///
/// A node that isn't a corner of every leaf it touches hangs: its value is the trilinear one of the coarser leaf, so that the
/// field is continuous, exactly.
#[derive(Debug, Clone)]
pub struct Mesh {
    tree: Tree,
    /// Cells that take part.
    pub cells: Vec<Cell>,
    /// By number in the tree the cell, or `NONE`.
    numbers: Vec<u32>,
    /// Nodes that hang on nothing, in finest cells, ascending in z, y, x.
    pub nodes: Vec<[i32; 3]>,
    /// Whether a node is held.
    pub held: Vec<bool>,
    /// Nodes and weights of corner `c` of cell `e`: `terms[starts[8 e + c]..starts[8 e + c + 1]]`.
    starts: Vec<u32>,
    terms: Vec<(u32, f64)>,
}

impl Mesh {
    /// The leaves of a balanced tree that `takes_part` takes. Nodes at other leaves are held.
    pub(crate) fn new(tree: Tree, takes_part: impl Fn(&Cell) -> bool) -> Self {
        let leaves = tree.leaves();
        let mut numbers = vec![NONE; tree.len()];
        let mut cells = Vec::new();
        let mut others = Vec::new();
        for (number, cell) in leaves {
            if takes_part(&cell) {
                numbers[number as usize] = cells.len() as u32;
                cells.push(cell);
            } else {
                others.push(cell);
            }
        }
        let corners: Vec<BTreeMap<[i32; 3], f64>> =
            cells.iter().flat_map(|cell| (0..8).map(|c| expand(&tree, cell.corner(c)))).collect();
        let mut nodes: Vec<[i32; 3]> = corners.iter().flat_map(|c| c.keys().copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let find = |node: &[i32; 3]| nodes.binary_search(node).ok();
        let mut starts = vec![0];
        let mut terms = Vec::new();
        for corner in &corners {
            terms.extend(corner.iter().map(|(n, w)| (find(n).expect("collected above") as u32, *w)));
            starts.push(terms.len() as u32);
        }
        let mut held: Vec<bool> = nodes
            .iter()
            .map(|node| {
                around(unturned(*node)).any(|finest| match tree.at(finest) {
                    At::Beyond => false,
                    At::Absent => true,
                    At::Leaf(number, _) => numbers[number as usize] == NONE,
                })
            })
            .collect();
        for cell in others {
            for node in (0..8).flat_map(|c| expand(&tree, cell.corner(c)).into_keys()) {
                if let Some(i) = find(&node) {
                    held[i] = true;
                }
            }
        }
        let nodes = nodes.into_iter().map(unturned).collect();
        Self { tree, cells, numbers, nodes, held, starts, terms }
    }

    /// Nodes and weights of a cell's corner.
    pub fn corner(&self, cell: usize, corner: usize) -> &[(u32, f64)] {
        let at = 8 * cell + corner;
        &self.terms[self.starts[at] as usize..self.starts[at + 1] as usize]
    }

    /// The values at a cell's corners.
    pub fn gather(&self, cell: usize, values: &[[f64; 3]]) -> [[f64; 3]; 8] {
        self.gather_of(cell, |node| &values[node as usize])
    }

    /// The same of nodes' values by number.
    #[inline]
    pub(crate) fn gather_of<'a>(&self, cell: usize, value: impl Fn(u32) -> &'a [f64; 3]) -> [[f64; 3]; 8] {
        let starts = &self.starts[8 * cell..=8 * cell + 8];
        let mut out = [[0.0; 3]; 8];
        let terms = &self.terms[starts[0] as usize..starts[8] as usize];
        if let Ok(own) = <&[(u32, f64); 8]>::try_from(terms) {
            // Where nothing hangs every corner is a node.
            for (out, (node, _)) in out.iter_mut().zip(own) {
                *out = *value(*node);
            }
            return out;
        }
        for (corner, out) in out.iter_mut().enumerate() {
            for (node, weight) in self.corner(cell, corner) {
                let v = value(*node);
                *out = [out[0] + weight * v[0], out[1] + weight * v[1], out[2] + weight * v[2]];
            }
        }
        out
    }

    /// The cell that takes part at a place (finest cells), and the place in it, 0…1.
    pub fn locate(&self, place: [f64; 3]) -> Option<(usize, [f64; 3])> {
        let At::Leaf(number, cell) = self.tree.at(place.map(|c| c.floor() as i32)) else { return None };
        let found = self.numbers[number as usize];
        let inner = std::array::from_fn(|a| (place[a] - f64::from(cell.low[a])) / f64::from(cell.size));
        (found != NONE).then_some((found as usize, inner))
    }
}

/// Coordinates as z, y, x and back.
fn unturned(node: [i32; 3]) -> [i32; 3] {
    [node[2], node[1], node[0]]
}

/// The eight finest cells that touch a node.
fn around(node: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    (0..8).map(move |c: usize| std::array::from_fn(|a| node[a] - (c >> a & 1) as i32))
}

/// A node (z, y, x) by the nodes that hang on nothing.
fn expand(tree: &Tree, node: [i32; 3]) -> BTreeMap<[i32; 3], f64> {
    let hangs_on = around(node)
        .filter_map(|finest| match tree.at(finest) {
            At::Leaf(_, cell) if (0..3).any(|a| (node[a] - cell.low[a]) % cell.size != 0) => Some(cell),
            _ => None,
        })
        .max_by_key(|cell| cell.size);
    let Some(cell) = hangs_on else { return BTreeMap::from([(unturned(node), 1.0)]) };
    let place = std::array::from_fn(|a| f64::from(node[a] - cell.low[a]) / f64::from(cell.size));
    let mut out = BTreeMap::new();
    for (corner, weight) in weights(place).into_iter().enumerate().filter(|(_, w)| *w != 0.0) {
        for (n, w) in expand(tree, cell.corner(corner)) {
            *out.entry(n).or_insert(0.0) += weight * w;
        }
    }
    out
}

/// Trilinear weights of a cell's corners.
pub fn weights(place: [f64; 3]) -> [f64; 8] {
    std::array::from_fn(|corner| {
        (0..3).map(|a| if corner >> a & 1 == 1 { place[a] } else { 1.0 - place[a] }).product()
    })
}
