//! Neighbours, rings round a target, and how a force spreads over them.

use ivd_core::Lattice;
use nalgebra::Vector3;

/// Neighbours of the vertices that may be reached along the triangles' edges, ascending, each once; those of the others
/// are not all known.
#[derive(Debug, Clone)]
pub(super) struct Edges {
    first: Vec<u32>,
    other: Vec<u32>,
    /// Squared length of each at rest (mm²).
    squared: Vec<f64>,
}

impl Edges {
    /// The neighbours of the vertices for which `near` is true.
    ///
    /// - `rest`: rest positions of all vertices (mm).
    pub(super) fn new(lattice: &Lattice, rest: &[Vector3<f64>], near: impl Fn(u32) -> bool) -> Self {
        let near: Vec<bool> = (0..lattice.keys().len() as u32).map(near).collect();
        let reached = lattice.triangles().iter().filter(|t| t.iter().any(|&v| near[v as usize]));
        let corners = reached.flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
        let mut pairs: Vec<[u32; 2]> =
            corners.filter(|[a, b]| a != b).flat_map(|[a, b]| [[a, b], [b, a]]).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut first = vec![0; lattice.keys().len() + 1];
        for [a, _] in &pairs {
            first[*a as usize + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let squared =
            pairs.iter().map(|&[a, b]| (rest[b as usize] - rest[a as usize]).norm_squared()).collect();
        Self { first, other: pairs.into_iter().map(|[_, b]| b).collect(), squared }
    }

    /// Those between vertices of which both are `wanted`.
    pub(super) fn between(mut self, wanted: impl Fn(usize) -> bool) -> Self {
        let mut kept = 0;
        let mut start = 0;
        for v in 0..self.first.len() - 1 {
            let end = self.first[v + 1] as usize;
            let known = start < end && wanted(v);
            for i in start..end {
                if known && wanted(self.other[i] as usize) {
                    (self.other[kept], self.squared[kept]) = (self.other[i], self.squared[i]);
                    kept += 1;
                }
            }
            start = end;
            self.first[v + 1] = kept as u32;
        }
        self.other.truncate(kept);
        self.squared.truncate(kept);
        self
    }

    pub(super) fn of(&self, vertex: usize) -> &[u32] {
        &self.other[self.range(vertex)]
    }

    /// The neighbours, each with the squared length of the edge to it at rest (mm²).
    #[inline]
    pub(super) fn with_lengths(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.range(vertex);
        let squared = self.squared[range.clone()].iter().copied();
        self.other[range].iter().map(|&u| u as usize).zip(squared)
    }

    fn range(&self, vertex: usize) -> std::ops::Range<usize> {
        self.first[vertex] as usize..self.first[vertex + 1] as usize
    }
}

/// How a moved vertex is followed at a distance of `t` radii: 1 at the target, 0 with its slope from the radius on, so
/// that the lattice doesn't tear there.
pub(super) fn taper(t: f64) -> f64 {
    if t < 1.0 { (1.0 - t * t).powi(2) } else { 0.0 }
}

/// The vertices that a handle reaches: rings of neighbours, breadth first, in the order of the vertices.
pub(super) struct Rings {
    /// Vertices by ring; ring 0 is the target.
    vertices: Vec<Vec<u32>>,
    radius: f64,
    target: usize,
}

impl Rings {
    /// Rings round `target` through neighbours nearer than `radius` (mm) to it.
    pub(super) fn new(edges: &Edges, rest: &[Vector3<f64>], target: usize, radius: f64) -> Self {
        let mut seen = vec![false; rest.len()];
        seen[target] = true;
        let mut rings = vec![vec![target as u32]];
        loop {
            let mut next = Vec::new();
            for &v in rings.last().expect("ring 0 is there") {
                for &u in edges.of(v as usize) {
                    let near = (rest[u as usize] - rest[target]).norm() < radius;
                    if near && !std::mem::replace(&mut seen[u as usize], true) {
                        next.push(u);
                    }
                }
            }
            if next.is_empty() {
                return Self { vertices: rings, radius, target };
            }
            next.sort_unstable();
            rings.push(next);
        }
    }

    /// The vertices of all rings, ascending.
    pub(super) fn reached(&self) -> Vec<u32> {
        let mut all = self.vertices.concat();
        all.sort_unstable();
        all
    }

    /// Component forces by vertex, as fractions of the target's force, and their sum by ring.
    ///
    /// A vertex takes the mean fraction of its neighbours in the ring before, times the cosine of the angle between the
    /// target's displacement and the way from the vertex to the displaced target (thesis, equations 6.2 and 6.3), times
    /// the taper. A ring that would hold more force than the one before is scaled down to it. The cosine counts by its size:
    /// a pull along the surface pushes the vertices ahead forward, not back. With `literal` neither taper nor scaling nor
    /// size apply. Below `epsilon` a vertex passes nothing on.
    pub(super) fn shares(
        &self,
        edges: &Edges,
        rest: &[Vector3<f64>],
        displaced: Vector3<f64>,
        epsilon: f64,
        literal: bool,
    ) -> (Vec<(usize, f64)>, Vec<f64>) {
        let mut share = vec![f64::NAN; rest.len()];
        share[self.target] = 1.0;
        let (mut all, mut sums) = (vec![(self.target, 1.0)], vec![1.0]);
        for ring in &self.vertices[1..] {
            // A vertex of this ring has no share yet: NaN never passes the comparison.
            let raw = |&v: &u32| {
                let passing = edges.of(v as usize).iter().map(|&u| share[u as usize]);
                let (sum, n) =
                    passing.filter(|s| s.abs() > epsilon).fold((0.0, 0.0), |(sum, n), s| (sum + s, n + 1.0));
                let cosine = cosine(displaced, rest[self.target] + displaced - rest[v as usize]);
                let mean = if n > 0.0 { sum / n } else { 0.0 };
                let distance = (rest[v as usize] - rest[self.target]).norm();
                if literal { mean * cosine } else { mean * cosine.abs() * taper(distance / self.radius) }
            };
            let mut fractions: Vec<f64> = ring.iter().map(raw).collect();
            let total: f64 = fractions.iter().sum();
            let before = *sums.last().expect("ring 0 is there");
            if !literal && total > before {
                for fraction in &mut fractions {
                    *fraction *= before / total;
                }
            }
            sums.push(fractions.iter().sum());
            for (&v, &fraction) in ring.iter().zip(&fractions) {
                share[v as usize] = fraction;
                all.push((v as usize, fraction));
            }
        }
        (all, sums)
    }
}

fn cosine(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    let lengths = a.norm() * b.norm();
    if lengths > 0.0 && lengths.is_finite() { (a.dot(&b) / lengths).clamp(-1.0, 1.0) } else { 0.0 }
}
