//! Geometry of one grid cell: its corners, edges and faces, and the loops in which a surface crosses it.
//!
//! Corner `i` lies at `(i & 1, i >> 1 & 1, i >> 2 & 1)`. Edge `4 a + j` runs along axis `a` from the `j`-th corner
//! whose bit `a` is 0. Face `2 a + s` is normal to axis `a` on the low (`s = 0`) or high side.

/// Element number of the cell's own vertex among a cell's fourteen possible ones (twelve edges, then two in its middle).
pub(super) const CENTRE: u8 = 12;

/// The vertices in the cell's middle. The second is for a tube that needs it.
pub(super) const CENTRES: [u8; 2] = [CENTRE, CENTRE + 1];

/// The two ends of each edge, low end first.
pub(crate) const EDGES: [[u8; 2]; 12] = edges();

/// The four corners of each face, counter-clockwise seen from outside the cell.
pub(super) const FACES: [[u8; 4]; 6] = faces();

const fn edges() -> [[u8; 2]; 12] {
    let mut edges = [[0; 2]; 12];
    let (mut axis, mut next) = (0, 0);
    while axis < 3 {
        let mut corner = 0;
        while corner < 8 {
            if corner >> axis & 1 == 0 {
                edges[next] = [corner, corner | 1 << axis];
                next += 1;
            }
            corner += 1;
        }
        axis += 1;
    }
    edges
}

const fn faces() -> [[u8; 4]; 6] {
    let mut faces = [[0; 4]; 6];
    let mut axis = 0;
    while axis < 3 {
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let high = 1 << axis;
        faces[2 * axis] = [0, v, u | v, u];
        faces[2 * axis + 1] = [high, high | u, high | u | v, high | v];
        axis += 1;
    }
    faces
}

/// The axis that an edge runs along.
#[inline]
pub(crate) fn axis(edge: u8) -> usize {
    usize::from(edge / 4)
}

/// Offset of a corner from the cell's first one.
#[inline]
pub(crate) fn offset(corner: u8) -> [usize; 3] {
    [usize::from(corner & 1), usize::from(corner >> 1 & 1), usize::from(corner >> 2 & 1)]
}

/// Whether two edges lie on a common face of the cell.
pub(super) fn share_face(a: u8, b: u8) -> bool {
    let [ends_a, ends_b] = [EDGES[usize::from(a)], EDGES[usize::from(b)]];
    FACES.iter().any(|face| ends_a.iter().chain(&ends_b).all(|corner| face.contains(corner)))
}

/// The faces (a bit each) on which the corners inside `case` (a bit each) lie on one diagonal, those outside on the
/// other: the surface crosses such a face in two arcs, and the signs don't say how they pair up.
pub(super) fn ambiguous_faces(case: u8) -> u8 {
    let inside = |corner: u8| case >> corner & 1;
    (0..6).fold(0, |faces, f| {
        let [a, b, c, d] = FACES[f].map(inside);
        faces | u8::from(a == c && b == d && a != b) << f
    })
}

/// The closed loops of edge crossings, each directed counter-clockwise as seen from outside the surface.
///
/// `joined` has a bit for each ambiguous face: set where the face's inside corners are connected across it.
/// Every crossed edge is on exactly one loop, since it lies on two faces and each enters it once.
pub(super) fn loops(case: u8, joined: u8) -> Vec<Vec<u8>> {
    let next = successors(case, joined);
    let mut seen = [false; 12];
    let mut loops = Vec::new();
    for start in 0..12_u8 {
        let (mut at, mut ring) = (start, Vec::new());
        while let (Some(to), false) = (next[usize::from(at)], seen[usize::from(at)]) {
            seen[usize::from(at)] = true;
            ring.push(at);
            at = to;
        }
        if !ring.is_empty() {
            loops.push(ring);
        }
    }
    loops
}

/// For each crossed edge the next one on its loop: the arcs on all six faces.
fn successors(case: u8, joined: u8) -> [Option<u8>; 12] {
    let inside = |corner: u8| case >> corner & 1 == 1;
    let mut next = [None; 12];
    for (f, face) in FACES.iter().enumerate() {
        let edge = |i: usize| edge_between(face[i % 4], face[(i + 1) % 4]);
        let leaves = |i: usize| inside(face[i % 4]) && !inside(face[(i + 1) % 4]);
        let enters = |i: usize| !inside(face[i % 4]) && inside(face[(i + 1) % 4]);
        for i in (0..4).filter(|&i| leaves(i)) {
            // An arc cuts off what lies between its ends: outside corners after `i`, or inside corners before it.
            let cut_outside = joined >> f & 1 == 1;
            let partner = if cut_outside {
                (1..4).find(|k| enters(i + k)).map(|k| i + k)
            } else {
                (1..4).find(|k| enters(i + 4 - k)).map(|k| i + 4 - k)
            };
            let partner = partner.expect("a face's corners change sign as often inwards as outwards");
            next[usize::from(edge(partner))] = Some(edge(i));
        }
    }
    next
}

/// The edge between two neighbouring corners.
pub(super) fn edge_between(a: u8, b: u8) -> u8 {
    let ends = [a.min(b), a.max(b)];
    EDGES.iter().position(|e| *e == ends).expect("neighbouring corners of a face span an edge") as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_are_counter_clockwise_from_outside() {
        for (f, face) in FACES.iter().enumerate() {
            let p = face.map(|c| offset(c).map(|v| v as f64));
            let [u, v]: [[f64; 3]; 2] = [1, 3].map(|k: usize| std::array::from_fn(|a| p[k][a] - p[0][a]));
            let along = (u[(f / 2 + 1) % 3] * v[(f / 2 + 2) % 3]) - u[(f / 2 + 2) % 3] * v[(f / 2 + 1) % 3];
            assert_eq!(along, if f % 2 == 1 { 1.0 } else { -1.0 }, "face {f}");
        }
    }

    #[test]
    fn every_crossed_edge_lies_on_one_loop() {
        for case in 0..=255_u8 {
            let crossed = EDGES.iter().filter(|e| (case >> e[0] ^ case >> e[1]) & 1 == 1).count();
            for joined in [0, ambiguous_faces(case)] {
                let loops = loops(case, joined);
                assert_eq!(loops.iter().map(Vec::len).sum::<usize>(), crossed, "case {case}");
                assert!(loops.iter().all(|ring| ring.len() >= 3), "case {case}");
            }
        }
    }
}
