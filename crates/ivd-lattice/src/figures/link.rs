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

/// Scratch for one vertex's link after another.
#[derive(Debug, Default)]
pub(crate) struct Link {
    /// Neighbour, and whether the half-edge towards it leaves the vertex.
    spokes: Vec<(u32, bool)>,
    /// Ends of the link's edges: the neighbours that share a triangle.
    sides: Vec<[u32; 2]>,
    /// Distinct neighbours, ascending, and the parent of each in a forest of connected ones.
    neighbours: Vec<u32>,
    parent: Vec<u32>,
}

impl Link {
    /// Counts vertex `v` and those of its edges that lead to higher vertices, so that each edge is counted once.
    pub(crate) fn count(&mut self, v: u32, stars: &Stars, triangles: &[[u32; 3]]) -> LinkCounts {
        self.gather(v, stars, triangles);
        let mut counts = LinkCounts::default();
        self.neighbours.clear();
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
    pub(super) fn neighbours(&self) -> &[u32] {
        &self.neighbours
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
