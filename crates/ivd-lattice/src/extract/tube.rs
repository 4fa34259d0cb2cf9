//! Triangles of a tube between two loops of a cell.
//!
//! Up to the cube's 48 symmetries, and up to what is inside, only five pairs of loops ever bound a tube: the trilinear function
//! joins no others. A tube has no edge across a face of the cell either, which leaves so few edges from loop to loop that some
//! need a vertex or two in the cell's middle. The rows are the triangulations of least sum of squared areas, with all crossings
//! at their edges' middles, among those with fewest such vertices.

use std::collections::HashMap;

use super::cell::{self, CENTRES, EDGES};

/// The vertices in a cell's middle.
const A: u8 = CENTRES[0];
const B: u8 = CENTRES[1];

/// The edges of two loops, as sets, and the triangles between them.
struct Row {
    loops: [&'static [u8]; 2],
    triangles: &'static [[u8; 3]],
}

/// One pair of loops of every kind; case numbers as in Chernyaev 1995.
const ROWS: [Row; 5] = [
    // 4.1.2: two opposite corners.
    Row {
        loops: [&[0, 4, 8], &[3, 11, 7]],
        triangles: &[[8, 0, 7], [8, 7, 3], [4, 8, 3], [4, 3, 11], [0, 4, 11], [0, 11, 7]],
    },
    // 6.1.2: a corner and the edge farthest from it.
    Row {
        loops: [&[2, 7, 9], &[0, 1, 10, 8]],
        triangles: &[[9, 2, 10], [7, 9, 10], [7, 10, 8], [7, 8, 0], [7, 0, 1], [2, 7, 1], [2, 1, 10]],
    },
    // 12.1.2: a corner and three in an angle opposite to it.
    Row {
        loops: [&[2, 7, 9], &[0, 1, 3, 6, 8]],
        triangles: &[
            [A, 0, 1],
            [2, A, 1],
            [9, 2, 1],
            [9, 1, 3],
            [8, 0, A],
            [6, 8, A],
            [3, 6, A],
            [9, 3, A],
            [7, 9, A],
            [2, 7, A],
        ],
    },
    // 7.4.2 and 13.5.2: a corner and the ring around the opposite one.
    Row {
        loops: [&[0, 4, 8], &[1, 5, 9, 2, 6, 10]],
        triangles: &[
            [4, A, B],
            [0, 4, B],
            [1, 5, 9],
            [B, 1, 9],
            [9, 2, 6],
            [B, 9, 6],
            [0, B, 6],
            [1, B, A],
            [10, 1, A],
            [6, 10, A],
            [0, 6, A],
            [8, 0, A],
            [4, 8, A],
        ],
    },
    // 10.1.2: two opposite edges.
    Row {
        loops: [&[0, 1, 10, 8], &[2, 3, 11, 9]],
        triangles: &[
            [A, 2, 3],
            [0, A, 3],
            [0, 3, 11],
            [8, 0, 11],
            [9, 2, A],
            [11, 9, A],
            [8, 11, A],
            [10, 8, A],
            [1, 10, A],
            [0, 1, A],
        ],
    },
];

/// The tubes between all pairs of loops that can bound one.
pub(super) struct Tubes(HashMap<[u16; 2], Vec<[u8; 3]>>);

impl Tubes {
    /// All rows, turned and mirrored in every way.
    pub(super) fn new() -> Self {
        let mut tubes = HashMap::new();
        for (row, edge) in ROWS.iter().flat_map(|row| symmetries().map(move |edges| (row, edges))) {
            let turn = |corner: u8| edge.get(usize::from(corner)).copied().unwrap_or(corner);
            let key = key(row.loops.map(|ring| ring.iter().map(|e| turn(*e))));
            tubes.entry(key).or_insert_with(|| row.triangles.iter().map(|t| t.map(turn)).collect());
        }
        Self(tubes)
    }

    /// The triangles of a tube between two loops, directed as these are; `None` where there never is one.
    pub(super) fn between(&self, p: &[u8], q: &[u8]) -> Option<Vec<[u8; 3]>> {
        let triangles = self.0.get(&key([p, q].map(|ring| ring.iter().copied())))?;
        let turned = triangles.iter().map(|t| [t[0], t[2], t[1]]).collect();
        // Loops that go round the tube in the same direction are not its two ends.
        [triangles.clone(), turned]
            .into_iter()
            .find(|triangles| [p, q].iter().all(|ring| borders(triangles, ring)))
    }
}

/// Whether triangles run along every step of a loop.
fn borders(triangles: &[[u8; 3]], ring: &[u8]) -> bool {
    let along = |a: u8, b: u8| triangles.iter().any(|t| (0..3).any(|k| (t[k], t[(k + 1) % 3]) == (a, b)));
    (0..ring.len()).all(|i| along(ring[i], ring[(i + 1) % ring.len()]))
}

/// The sets of edges of two loops, the lesser first.
fn key(loops: [impl Iterator<Item = u8>; 2]) -> [u16; 2] {
    let mut key = loops.map(|ring| ring.fold(0, |set, edge| set | 1 << edge));
    key.sort_unstable();
    key
}

/// Where each edge goes, for the 48 symmetries of the cube.
fn symmetries() -> impl Iterator<Item = [u8; 12]> {
    const ORDERS: [[u8; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    ORDERS.into_iter().flat_map(|order| {
        (0..8_u8).map(move |flip| {
            let corner = |c: u8| (0..3).fold(0, |to, a| to | (c >> order[a] & 1) << a) ^ flip;
            EDGES.map(|[low, high]| cell::edge_between(corner(low), corner(high)))
        })
    })
}
