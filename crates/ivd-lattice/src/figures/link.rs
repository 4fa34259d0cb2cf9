use std::ops::AddAssign;

use ivd_core::sets;

use super::stars::Stars;

/// What the edges and links of some vertices show; sums over all vertices describe the mesh.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LinkCounts {
    pub(crate) edges: u64,
    pub(crate) boundary_edges: u64,
    pub(crate) non_manifold_edges: u64,
    pub(crate) misoriented_edges: u64,
    pub(crate) bow_tie_vertices: u64,
    pub(crate) unused_vertices: u64,
}

impl AddAssign for LinkCounts {
    fn add_assign(&mut self, other: Self) {
        self.edges += other.edges;
        self.boundary_edges += other.boundary_edges;
        self.non_manifold_edges += other.non_manifold_edges;
        self.misoriented_edges += other.misoriented_edges;
        self.bow_tie_vertices += other.bow_tie_vertices;
        self.unused_vertices += other.unused_vertices;
    }
}

/// More triangles than this round a vertex aren't looked at for a ring: that compares each with each.
const MOST_IN_RING: usize = 16;

/// Scratch for one vertex's link after another.
#[derive(Debug, Default)]
pub(crate) struct Link {
    /// Neighbour, and whether the half-edge towards it leaves the vertex.
    spokes: Vec<(u32, bool)>,
    /// Ends of the link's edges: the neighbours that share a triangle.
    sides: Vec<[u32; 2]>,
    /// Distinct neighbours, and the parent of each in a forest of connected ones.
    neighbours: Vec<u32>,
    parent: Vec<u32>,
}

impl Link {
    /// Counts vertex `v` and those of its edges that lead to higher vertices, so that each edge is counted once.
    pub(crate) fn count(&mut self, v: u32, stars: &Stars, triangles: &[[u32; 3]]) -> LinkCounts {
        if !self.is_ring(v, stars, triangles) {
            return self.count_all(v, stars, triangles);
        }
        self.neighbours.clear();
        self.neighbours.extend(self.sides.iter().map(|side| side[0]));
        LinkCounts {
            edges: self.neighbours.iter().filter(|w| **w > v).count() as u64,
            ..LinkCounts::default()
        }
    }

    /// As [`Link::count`], whatever the triangles are like.
    fn count_all(&mut self, v: u32, stars: &Stars, triangles: &[[u32; 3]]) -> LinkCounts {
        let mut counts = LinkCounts::default();
        self.neighbours.clear();
        self.gather(v, stars, triangles);
        if stars.of(v as usize).is_empty() {
            counts.unused_vertices = 1;
            return counts;
        }
        for edge in self.spokes.chunk_by(|a, b| a.0 == b.0) {
            let w = edge[0].0;
            self.neighbours.push(w);
            if w < v {
                continue;
            }
            let leaving = edge.iter().filter(|s| s.1).count();
            counts.edges += 1;
            counts.boundary_edges += u64::from(edge.len() == 1);
            counts.non_manifold_edges += u64::from(edge.len() > 2);
            counts.misoriented_edges += u64::from(edge.len() == 2 && leaving != 1);
        }
        counts.bow_tie_vertices = u64::from(self.parts() > 1);
        counts
    }

    /// Distinct neighbours of the vertex counted last, ascending; none of one that no triangle names.
    pub(super) fn neighbours(&mut self) -> &[u32] {
        self.neighbours.sort_unstable();
        &self.neighbours
    }

    /// Whether the triangles follow one another round the vertex in one ring, all turning the same way, as nearly everywhere: then
    /// there is nothing to count but edges, and each neighbour begins one side of the link.
    fn is_ring(&mut self, v: u32, stars: &Stars, triangles: &[[u32; 3]]) -> bool {
        self.sides.clear();
        let star = stars.of(v as usize);
        if star.len() > MOST_IN_RING {
            return false;
        }
        for &t in star {
            let [a, b, c] = triangles[t as usize];
            let side = if a == v {
                [b, c]
            } else if b == v {
                [c, a]
            } else {
                [a, b]
            };
            if side[0] == side[1] || side.contains(&v) {
                return false;
            }
            self.sides.push(side);
        }
        let Some(&first) = self.sides.first() else { return false };
        // The next side is always the same, so a walk that is back after as many steps as there are sides, and not before, went along each
        // of them once.
        let mut end = first[1];
        for _ in 1..self.sides.len() {
            match self.sides.iter().find(|side| side[0] == end) {
                Some(side) if end != first[0] => end = side[1],
                _ => return false,
            }
        }
        end == first[0]
    }

    fn gather(&mut self, v: u32, stars: &Stars, triangles: &[[u32; 3]]) {
        self.spokes.clear();
        self.sides.clear();
        let mut last = u32::MAX;
        for &t in stars.of(v as usize) {
            // A triangle that names the vertex twice is listed twice, in a row.
            if std::mem::replace(&mut last, t) == t {
                continue;
            }
            let [a, b, c] = triangles[t as usize];
            for (from, to) in [(a, b), (b, c), (c, a)] {
                match (from == v, to == v) {
                    (true, false) => self.spokes.push((to, true)),
                    (false, true) => self.spokes.push((from, false)),
                    (false, false) => self.sides.push([from, to]),
                    (true, true) => {}
                }
            }
        }
        self.spokes.sort_unstable();
    }

    /// Connected parts of the link: more than one where surfaces touch in the vertex alone.
    fn parts(&mut self) -> usize {
        self.parent.clear();
        self.parent.extend(0..self.neighbours.len() as u32);
        let mut parts = self.neighbours.len();
        for side in &self.sides {
            let [a, b] = side.map(|w| {
                self.neighbours.binary_search(&w).expect("both ends of a side are neighbours") as u32
            });
            parts -= usize::from(sets::join(&mut self.parent, a, b));
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::noise;

    use super::*;

    #[test]
    fn a_ring_of_triangles_counts_as_its_edges_do_one_by_one() {
        // Few vertices and many triangles, so that rings, holes, fans, repeats and triangles without an inside all occur.
        let (mut rings, mut others) = (0, 0);
        for seed in 0..20_000_u64 {
            let draw = |i: u64, most: u64| noise::below(seed, i, most) as u32;
            let count = 1 + u64::from(draw(63, 9));
            let mut triangles: Vec<[u32; 3]> =
                (0..count).map(|t| std::array::from_fn(|k| draw(3 * t + k as u64, 6))).collect();
            if seed % 2 == 0 {
                // An octahedron's upper half and what else there is.
                triangles.truncate(draw(62, 3) as usize);
                triangles.extend([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]);
            }
            let stars = Stars::new(6, &triangles);
            let (mut fast, mut plain) = (Link::default(), Link::default());
            for v in 0..6 {
                assert_eq!(
                    fast.count(v, &stars, &triangles),
                    plain.count_all(v, &stars, &triangles),
                    "{triangles:?} {v}"
                );
                assert_eq!(fast.neighbours(), plain.neighbours(), "{triangles:?} {v}");
                if fast.is_ring(v, &stars, &triangles) { rings += 1 } else { others += 1 }
            }
        }
        assert!(rings > 5000 && others > 5000, "{rings} rings, {others} others");
    }
}
