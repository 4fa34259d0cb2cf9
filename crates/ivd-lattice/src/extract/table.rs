//! Triangles of a cell for every sign case and every decision about its ambiguous faces.
//!
//! The table is built by code from the cell's geometry: face arcs → loops → triangles. Its one rule makes the mesh
//! manifold whatever the field: no triangle has an edge inside a face of the cell other than the face's own arcs,
//! since the neighbour across that face might use the same edge. Loops that can't be triangulated so get a vertex of
//! their own in the cell's middle; no case has two such loops.
//!
//! Two loops may also bound one tube instead of two sheets: where that can be, there is a crossing with it too. Which of them the
//! field calls for is found out elsewhere ([`super::interior`]).

use std::sync::LazyLock;

use super::cell::{self, CENTRE, CENTRES, EDGES};
use super::tube::Tubes;

/// How the surface crosses a cell of one case.
#[derive(Debug, Clone, Default)]
struct Crossing {
    triangles: Vec<[u8; 3]>,
    /// Edges around the vertices in the cell's middle; none in most cases.
    fans: Vec<Vec<u8>>,
}

/// A crossing with a tube in place of two sheets.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tube {
    /// An edge of each of the two loops.
    pub(super) ends: [u8; 2],
    /// The crossing.
    pub(super) id: CrossingId,
}

/// All cases.
#[derive(Debug)]
pub(super) struct CaseTable {
    /// First span of each case; the decisions of its ambiguous faces, packed, count from there.
    first: [u16; 256],
    /// Ambiguous faces of each case, a bit each.
    ambiguous: [u8; 256],
    spans: Vec<Span>,
    triangles: Vec<[u8; 3]>,
    fans: Vec<Vec<Vec<u8>>>,
    tubes: Vec<Tube>,
    /// What the signs alone settle: as they are, and with every triangle turned over.
    pub(super) simple: [Simple; 2],
}

/// The triangles of those cases whose signs leave nothing open.
#[derive(Debug)]
pub(super) struct Simple([SimpleCase; 256]);

/// At most four triangles between edges.
#[derive(Debug, Clone, Copy)]
pub(super) struct SimpleCase {
    pub(super) triangles: [[u8; 3]; 4],
    pub(super) count: u8,
    is: bool,
}

impl Simple {
    const NONE: Self = Self([SimpleCase { triangles: [[0; 3]; 4], count: 0, is: false }; 256]);

    /// The triangles of a case, if its signs settle them.
    #[inline(always)]
    pub(super) fn get(&self, case: u8) -> Option<&SimpleCase> {
        Some(&self.0[usize::from(case)]).filter(|case| case.is)
    }

    fn new(table: &CaseTable, flip: bool) -> Self {
        Self(std::array::from_fn(|case| {
            let id = table.crossing(case as u8, 0);
            let is = table.ambiguous(case as u8) == 0 && table.tubes(id).is_empty();
            let mut simple = SimpleCase { triangles: [[0; 3]; 4], count: 0, is };
            if is {
                let triangles = table.triangles(id);
                assert!(
                    table.fans(id).is_empty(),
                    "case {case}: only what is open has a vertex in the middle"
                );
                simple.count = triangles.len() as u8;
                for (to, &[a, b, c]) in simple.triangles[..triangles.len()].iter_mut().zip(triangles) {
                    *to = if flip { [a, c, b] } else { [a, b, c] };
                }
            }
            simple
        }))
    }
}

/// Where one crossing's triangles are in the table.
#[derive(Debug, Clone, Copy)]
struct Span {
    start: u16,
    count: u8,
    /// First of the crossing's tubes, and how many there are.
    tubes: [u16; 2],
}

/// A crossing of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct CrossingId(u16);

impl CrossingId {
    /// Its number in the table.
    pub(super) fn number(self) -> u16 {
        self.0
    }

    /// The crossing of a number that the table gave.
    pub(super) fn numbered(number: u16) -> Self {
        Self(number)
    }
}

/// The table, built at its first use.
pub(super) static CASES: LazyLock<CaseTable> = LazyLock::new(CaseTable::build);

/// Triangles of each case where inside corners are never joined across a face: all corners are edges, none a vertex in the
/// cell's middle, and no triangle has an edge across a face other than the face's own arcs.
pub(crate) static PARTED: LazyLock<Vec<Vec<[u8; 3]>>> = LazyLock::new(|| {
    let sheets = |ring: &Vec<u8>| triangulate(ring).expect("parted loops need no vertex in the middle");
    (0..=255).map(|case| cell::loops(case, 0).iter().flat_map(sheets).collect()).collect()
});

impl CaseTable {
    fn build() -> Self {
        let mut table = Self {
            first: [0; 256],
            ambiguous: [0; 256],
            spans: Vec::new(),
            triangles: Vec::new(),
            fans: Vec::new(),
            tubes: Vec::new(),
            simple: [Simple::NONE, Simple::NONE],
        };
        let mut loops = Vec::new();
        for case in 0..=255_u8 {
            let faces = cell::ambiguous_faces(case);
            table.first[usize::from(case)] = table.spans.len() as u16;
            table.ambiguous[usize::from(case)] = faces;
            for packed in 0..1_u8 << faces.count_ones() {
                let rings = cell::loops(case, unpack(packed, faces));
                table.add(cross(&rings));
                loops.push(rings);
            }
        }
        let tubes = Tubes::new();
        for (id, rings) in loops.iter().enumerate() {
            let first = table.tubes.len();
            for (a, b) in (0..rings.len()).flat_map(|b| (0..b).map(move |a| (a, b))) {
                let Some(tube) = tubes.between(&rings[a], &rings[b]) else { continue };
                let id = CrossingId(table.spans.len() as u16);
                table.tubes.push(Tube { ends: [rings[a][0], rings[b][0]], id });
                let others = (0..rings.len()).filter(|i| *i != a && *i != b).map(|i| rings[i].clone());
                table.add(with_tube(&others.collect::<Vec<_>>(), tube));
            }
            table.spans[id].tubes = [first as u16, (table.tubes.len() - first) as u16];
        }
        table.simple = [false, true].map(|flip| Simple::new(&table, flip));
        table
    }

    fn add(&mut self, crossing: Crossing) {
        self.spans.push(Span {
            start: self.triangles.len() as u16,
            count: crossing.triangles.len() as u8,
            tubes: [0; 2],
        });
        self.triangles.extend(crossing.triangles);
        self.fans.push(crossing.fans);
    }

    /// Every crossing, by number.
    pub(super) fn all(&self) -> impl Iterator<Item = CrossingId> {
        (0..self.spans.len() as u16).map(CrossingId)
    }

    /// Ambiguous faces of a case, a bit each.
    #[inline]
    pub(super) fn ambiguous(&self, case: u8) -> u8 {
        self.ambiguous[usize::from(case)]
    }

    /// The crossing of a case. Bit `k` of `joined` is the decision about the `k`-th of its ambiguous faces.
    #[inline]
    pub(super) fn crossing(&self, case: u8, joined: u8) -> CrossingId {
        CrossingId(self.first[usize::from(case)] + u16::from(joined))
    }

    /// Corners of the triangles: edges 0…11, or one of [`CENTRES`]; counter-clockwise from outside on a right-handed grid.
    #[inline]
    pub(super) fn triangles(&self, id: CrossingId) -> &[[u8; 3]] {
        let span = self.spans[usize::from(id.0)];
        &self.triangles[usize::from(span.start)..][..usize::from(span.count)]
    }

    /// The crossings that have a tube in place of two of this one's sheets.
    #[inline]
    pub(super) fn tubes(&self, id: CrossingId) -> &[Tube] {
        let [first, count] = self.spans[usize::from(id.0)].tubes.map(usize::from);
        &self.tubes[first..first + count]
    }

    /// Edges around each of the vertices in the cell's middle; none in most cases.
    #[inline]
    pub(super) fn fans(&self, id: CrossingId) -> &[Vec<u8>] {
        &self.fans[usize::from(id.0)]
    }
}

/// Spreads the low bits of `packed` over the bits set in `faces`.
fn unpack(packed: u8, faces: u8) -> u8 {
    let mut rank = 0;
    (0..6).filter(|f| faces >> f & 1 == 1).fold(0, |joined, f| {
        let bit = packed >> rank & 1;
        rank += 1;
        joined | bit << f
    })
}

/// A sheet for each loop.
fn cross(rings: &[Vec<u8>]) -> Crossing {
    let mut crossing = Crossing::default();
    for ring in rings {
        if let Some(triangles) = triangulate(ring) {
            crossing.triangles.extend(triangles);
        } else {
            assert!(crossing.fans.is_empty(), "two of {rings:?} need a vertex in the middle");
            let next = ring.iter().cycle().skip(1);
            crossing.triangles.extend(ring.iter().zip(next).map(|(&a, &b)| [a, b, CENTRE]));
            crossing.fans.push(ring.clone());
        }
    }
    crossing
}

/// A tube, and a sheet for each of the other loops.
fn with_tube(others: &[Vec<u8>], tube: Vec<[u8; 3]>) -> Crossing {
    let mut crossing = cross(others);
    assert!(crossing.fans.is_empty(), "beside a tube {others:?} need a vertex in the middle");
    for centre in CENTRES {
        let near = tube.iter().filter(|t| t.contains(&centre)).flatten();
        let mut edges: Vec<u8> = near.copied().filter(|corner| !CENTRES.contains(corner)).collect();
        if edges.is_empty() {
            break;
        }
        edges.sort_unstable();
        edges.dedup();
        crossing.fans.push(edges);
    }
    crossing.triangles.extend(tube);
    crossing
}

/// Best triangulation of part of a loop: its cost and triangles.
type Best = Option<(i32, Vec<[u8; 3]>)>;

/// Triangles between the vertices of a loop, without an edge across a face; `None` where there is no such
/// triangulation. Among several, the one of least sum of squared areas with all crossings at their edges' middles
/// (minimum weight triangulation by dynamic programming, Klincsek 1980).
pub(super) fn triangulate(ring: &[u8]) -> Option<Vec<[u8; 3]>> {
    let n = ring.len();
    let allowed = |i: usize, j: usize| j - i == 1 || j - i == n - 1 || !cell::share_face(ring[i], ring[j]);
    // best[i][j]: the part of the loop from i to j, closed by the edge (i, j).
    let mut best: Vec<Vec<Best>> = vec![vec![None; n]; n];
    for span in 1..n {
        for i in 0..n - span {
            let j = i + span;
            if !allowed(i, j) {
                continue;
            }
            if span == 1 {
                best[i][j] = Some((0, Vec::new()));
                continue;
            }
            for k in i + 1..j {
                let (Some(left), Some(right)) = (&best[i][k], &best[k][j]) else { continue };
                let cost = left.0 + right.0 + squared_area(ring[i], ring[k], ring[j]);
                if best[i][j].as_ref().is_none_or(|b| cost < b.0) {
                    let mut triangles = [left.1.as_slice(), &right.1].concat();
                    triangles.push([ring[i], ring[k], ring[j]]);
                    best[i][j] = Some((cost, triangles));
                }
            }
        }
    }
    best[0][n - 1].take().map(|b| b.1)
}

/// Sixty-four times the squared area of the triangle between the middles of three edges.
fn squared_area(a: u8, b: u8, c: u8) -> i32 {
    let [p, q, r] = [a, b, c].map(|e| {
        let [low, high] = EDGES[usize::from(e)].map(|corner| cell::offset(corner).map(|v| v as i32));
        [low[0] + high[0], low[1] + high[1], low[2] + high[2]]
    });
    let [u, v]: [[i32; 3]; 2] = [q, r].map(|to| std::array::from_fn(|k| to[k] - p[k]));
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    cross.iter().map(|c| c * c).sum()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Case, joined faces, and a crossing with the tubes of the case, without or with one.
    fn all() -> impl Iterator<Item = (u8, u8, CrossingId)> {
        (0..=255_u8).flat_map(|case| {
            let faces = CASES.ambiguous(case);
            (0..1_u8 << faces.count_ones()).flat_map(move |packed| {
                let id = CASES.crossing(case, packed);
                let ids = std::iter::once(id).chain(CASES.tubes(id).iter().map(|tube| tube.id));
                ids.map(move |id| (case, unpack(packed, faces), id))
            })
        })
    }

    #[test]
    fn there_are_656_cases_of_at_most_12_triangles_and_148_with_a_tube() {
        let sheets: Vec<CrossingId> =
            all().map(|(.., id)| id).filter(|id| !CASES.tubes.iter().any(|tube| tube.id == *id)).collect();
        assert_eq!((sheets.len(), CASES.tubes.len()), (656, 148));
        assert_eq!(sheets.iter().map(|id| CASES.triangles(*id).len()).max(), Some(12));
        assert_eq!(sheets.iter().filter(|id| !CASES.fans(**id).is_empty()).count(), 116);
    }

    #[test]
    fn a_tube_is_one_sheet_with_two_borders() {
        for (case, joined, id) in all() {
            for tube in CASES.tubes(id) {
                let rings = cell::loops(case, joined);
                let ends = tube.ends.map(|end| rings.iter().position(|ring| ring.contains(&end)).unwrap());
                let mut corners = BTreeSet::from([tube.ends[0]]);
                for _ in CASES.triangles(tube.id) {
                    let near =
                        CASES.triangles(tube.id).iter().filter(|t| t.iter().any(|c| corners.contains(c)));
                    let near: Vec<u8> = near.flatten().copied().collect();
                    corners.extend(near);
                }
                let mut expected: BTreeSet<u8> = ends.iter().flat_map(|ring| rings[*ring].clone()).collect();
                let part: Vec<_> =
                    CASES.triangles(tube.id).iter().filter(|t| corners.contains(&t[0])).collect();
                expected.extend(CENTRES.iter().filter(|centre| part.iter().any(|t| t.contains(centre))));
                assert_eq!(corners, expected, "case {case}, joined {joined}");
                let edges: BTreeSet<[u8; 2]> = part
                    .iter()
                    .flat_map(|t| (0..3).map(|k| [t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3])]))
                    .collect();
                assert_eq!(corners.len() + part.len(), edges.len(), "case {case}, joined {joined}");
            }
        }
    }

    #[test]
    fn the_border_of_a_cells_triangles_is_its_face_arcs() {
        for (case, joined, id) in all() {
            let triangles = CASES.triangles(id);
            let mut edges = BTreeSet::new();
            for t in triangles {
                for k in 0..3 {
                    assert!(edges.insert((t[k], t[(k + 1) % 3])), "case {case}: edge twice");
                }
            }
            let border: Vec<(u8, u8)> =
                edges.iter().copied().filter(|&(a, b)| !edges.contains(&(b, a))).collect();
            let mut arcs: Vec<(u8, u8)> = cell::loops(case, joined)
                .iter()
                .flat_map(|r| (0..r.len()).map(|i| (r[i], r[(i + 1) % r.len()])).collect::<Vec<_>>())
                .collect();
            arcs.sort_unstable();
            assert_eq!(border, arcs, "case {case}, joined {joined}");
        }
    }

    #[test]
    fn no_inner_edge_lies_in_a_face() {
        for (case, _, id) in all() {
            let triangles = CASES.triangles(id);
            for t in triangles {
                for k in 0..3 {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    let inner = triangles.iter().any(|o| (0..3).any(|m| (o[m], o[(m + 1) % 3]) == (b, a)));
                    assert!(!inner || a >= CENTRE || b >= CENTRE || !cell::share_face(a, b), "case {case}");
                }
            }
        }
    }

    #[test]
    fn where_inside_corners_are_never_joined_no_case_needs_a_vertex_in_the_middle() {
        for (case, triangles) in (0..=255).zip(PARTED.iter()) {
            let crossed = EDGES.iter().filter(|e| (case >> e[0] ^ case >> e[1]) & 1 == 1).count();
            assert_eq!(triangles.len(), crossed - 2 * cell::loops(case, 0).len(), "case {case}");
            let mut sides = BTreeSet::new();
            for t in triangles {
                assert!(t.iter().all(|&e| e < CENTRE));
                for k in 0..3 {
                    assert!(sides.insert((t[k], t[(k + 1) % 3])), "case {case}: edge twice");
                }
            }
            for &(a, b) in &sides {
                let inner = sides.contains(&(b, a));
                assert!(!inner || !cell::share_face(a, b), "case {case}: a chord across a face");
            }
        }
    }

    #[test]
    fn a_corner_inside_is_seen_counter_clockwise_from_outside() {
        let t = CASES.triangles(CASES.crossing(1, 0))[0];
        let axes = t.map(cell::axis);
        assert!([[0, 1, 2], [1, 2, 0], [2, 0, 1]].contains(&axes), "{t:?}");
    }
}
