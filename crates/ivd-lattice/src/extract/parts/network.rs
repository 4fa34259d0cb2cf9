//! The curves in which the parts of a cell's corners meet on its six faces.

use super::super::cell::{FACES, edge_between};

/// A point of the network: 0…11 the middle of an edge, 12…17 the middle of a face.
pub(super) type Node = u8;

/// Node of the middle of face 0.
pub(super) const FACE: Node = 12;

/// Parts of the eight corners, numbered from 0 by first occurrence.
pub(super) type Pattern = [u8; 8];

/// A piece of curve on a face, seen from outside the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Arc {
    pub(super) from: Node,
    pub(super) to: Node,
    pub(super) left: u8,
    pub(super) right: u8,
}

/// Whether the corners of face `f` are two parts on its two diagonals.
pub(super) fn is_crossed(pattern: Pattern, f: usize) -> bool {
    let [a, b, c, d] = FACES[f].map(|corner| pattern[usize::from(corner)]);
    a == c && b == d && a != b
}

/// The arcs on all faces. Of a face with two parts on its diagonals bit `f` of `first_joined` says whether the part of the face's
/// first corner is joined across it; the other part's corners are then cut off.
///
/// - Two parts, or three of which one lies on both ends of a diagonal: arcs from edge to edge.
/// - Otherwise three or four parts meet in the middle of the face.
pub(super) fn arcs(pattern: Pattern, first_joined: u8) -> Vec<Arc> {
    let mut arcs = Vec::new();
    for (f, face) in FACES.iter().enumerate() {
        let part = |i: usize| pattern[usize::from(face[i % 4])];
        let edge = |i: usize| edge_between(face[i % 4], face[(i + 1) % 4]);
        let crossed: Vec<usize> = (0..4).filter(|&i| part(i) != part(i + 1)).collect();
        // From the edge after `last` to the edge before `first`: the corners between lie on the left.
        let mut cut = |first: usize, last: usize, other: u8| {
            arcs.push(Arc { from: edge(last), to: edge(first + 3), left: part(first), right: other });
        };
        let diagonal = if is_crossed(pattern, f) {
            Some(usize::from(first_joined >> f & 1 == 0))
        } else {
            (0..2).find(|&i| crossed.len() == 4 && part(i) == part(i + 2))
        };
        match (crossed.as_slice(), diagonal) {
            ([], _) => {}
            (&[i, j], _) => cut(i + 1, j, part(i)),
            (_, Some(joined)) => [joined + 1, joined + 3].iter().for_each(|&i| cut(i, i, part(joined))),
            (several, None) => arcs.extend(several.iter().map(|&i| Arc {
                from: edge(i),
                to: FACE + f as u8,
                left: part(i),
                right: part(i + 1),
            })),
        }
    }
    arcs
}

/// A part's border on the cell's surface: a closed walk with the part on its left.
#[derive(Debug, Clone)]
pub(super) struct Region {
    pub(super) part: u8,
    /// Indices of arcs, in the order of the walk.
    pub(super) walk: Vec<usize>,
}

/// The closed walks of all parts: each part passes each of its nodes once.
pub(super) fn regions(arcs: &[Arc]) -> Vec<Region> {
    let mut regions: Vec<Region> = Vec::new();
    for part in 0..8 {
        // With the part on the left an arc leads from `start` to `end`.
        let start = |a: &Arc| if a.left == part { a.from } else { a.to };
        let end = |a: &Arc| if a.left == part { a.to } else { a.from };
        let mut mine: Vec<usize> =
            (0..arcs.len()).filter(|&a| [arcs[a].left, arcs[a].right].contains(&part)).collect();
        while let Some(first) = mine.pop() {
            let mut walk = vec![first];
            let mut at = end(&arcs[first]);
            while let Some(next) = mine.iter().position(|&a| start(&arcs[a]) == at) {
                let next = mine.swap_remove(next);
                walk.push(next);
                at = end(&arcs[next]);
            }
            assert!(at == start(&arcs[first]), "the border of part {part} in {arcs:?} isn't closed");
            regions.push(Region { part, walk });
        }
    }
    regions
}

/// The regions' numbers, grouped by the connected parts of the network that they border.
pub(super) fn components(arcs: &[Arc], regions: &[Region]) -> Vec<Vec<usize>> {
    let mut group: [Node; 18] = std::array::from_fn(|node| node as Node);
    // A few nodes: joined by relabelling.
    for arc in arcs {
        let (a, b) = (group[usize::from(arc.from)], group[usize::from(arc.to)]);
        group.iter_mut().filter(|g| **g == b).for_each(|g| *g = a);
    }
    let mut components: Vec<(Node, Vec<usize>)> = Vec::new();
    for (r, region) in regions.iter().enumerate() {
        let own = group[usize::from(arcs[region.walk[0]].from)];
        match components.iter_mut().find(|c| c.0 == own) {
            Some(component) => component.1.push(r),
            None => components.push((own, vec![r])),
        }
    }
    components.into_iter().map(|c| c.1).collect()
}
