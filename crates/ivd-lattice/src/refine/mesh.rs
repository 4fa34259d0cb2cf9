use ivd_core::Lattice;
use nalgebra::Vector3;

use super::Refused;
use super::features::{Features, Kind};
use super::locks::Locks;
use super::mean::{Refining, Seen};
use super::refusal::StopReason;
use super::report::Outcome;
use super::shared::GONE;
use super::star::Fan;

/// A surface that one thread changes triangle by triangle, with the input's numbers; every star is up to date at any time.
pub(super) struct Mesh {
    /// Places (mm), relative to the middle.
    pub(super) positions: Vec<Vector3<f64>>,
    /// Corners, or [`GONE`].
    pub(super) triangles: Vec<[u32; 3]>,
    /// Bound of each triangle's distance from the input, both ways (mm).
    pub(super) bounds: Vec<f32>,
    pub(super) features: Features,
    /// Vertices that may go from the first, ascending.
    pub(super) free: Vec<u32>,
    /// Vertices that may not, by what keeps them.
    pub(super) kept: Refused,
    stars: Vec<Vec<u32>>,
    areas: Vec<f32>,
    onto: Vec<u32>,
}

impl Mesh {
    /// The input. Locked are those that the caller says, corners of features, and vertices whose triangles aren't one
    /// closed fan.
    pub(super) fn new(lattice: &Lattice, locks: Locks<'_>, feature_degrees: Option<f64>) -> Self {
        let mut positions = lattice.local_positions();
        super::surface::centre(&mut positions);
        let n = positions.len();
        let triangles = lattice.triangles().to_vec();
        let mut stars = vec![Vec::new(); n];
        let mut areas = vec![0.0_f32; n];
        for (t, corners) in triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|v| positions[v as usize]);
            let area = 0.5 * (b - a).cross(&(c - a)).norm() as f32;
            for &v in corners {
                stars[v as usize].push(t as u32);
                areas[v as usize] += area;
            }
        }
        let features = Features::new(&positions, &triangles, feature_degrees);
        let mut mesh = Self {
            bounds: vec![0.0; triangles.len()],
            positions,
            triangles,
            features,
            free: Vec::new(),
            kept: Refused::default(),
            stars,
            areas,
            onto: (0..n as u32).collect(),
        };
        let locked = locks.flags(n);
        let mut fan = Fan::new();
        for v in 0..n as u32 {
            if locked[v as usize] || !mesh.read(v, &mut fan) {
                mesh.kept.locks += 1;
            } else if mesh.features.kind(v) == Kind::Corner {
                mesh.kept.features += 1;
            } else {
                mesh.free.push(v);
            }
        }
        mesh
    }

    /// Bytes of such a surface.
    pub(super) fn bytes_for(lattice: &Lattice) -> u64 {
        132 * lattice.keys().len() as u64 + 80 * lattice.triangles().len() as u64
    }

    /// Reads the fan of a vertex with its places. Returns `false` where its triangles aren't one closed fan.
    pub(super) fn read(&self, v: u32, fan: &mut Fan) -> bool {
        let star = self.stars[v as usize].iter().map(|&t| (t, self.triangles[t as usize]));
        let closed = fan.gather(v, star);
        if closed {
            fan.locate(&self.positions);
        }
        closed
    }

    /// Whether an edge joins two vertices.
    pub(super) fn has_edge(&self, a: u32, b: u32) -> bool {
        let [star, other] = if self.star_of(a).len() <= self.star_of(b).len() { [a, b] } else { [b, a] };
        self.star_of(star).iter().any(|&t| self.triangles[t as usize].contains(&other))
    }

    /// Triangles round a vertex.
    pub(super) fn star_of(&self, v: u32) -> &[u32] {
        &self.stars[v as usize]
    }

    /// Vertices left, ascending.
    pub(super) fn left(&self) -> Vec<u32> {
        (0..self.onto.len() as u32).filter(|&v| self.onto[v as usize] == v).collect()
    }

    /// The link condition (Dey et al. 1999) for a collapse of `u` onto `y`: they share the two neighbours of their edge
    /// and no other, and `u` is no corner of a tetrahedron.
    ///
    /// - `ring`: neighbours of `u` in order, `y` first.
    pub(super) fn links(&self, [u, y]: [u32; 2], ring: &[u32]) -> bool {
        if ring.len() == 3 && self.has_triangle([ring[0], ring[1], ring[2]], u) {
            return false;
        }
        ring[1..].iter().filter(|&&r| self.has_edge(y, r)).count() == 2
    }

    /// Whether a triangle joins three vertices that a given vertex has no part in.
    pub(super) fn has_triangle(&self, wanted: [u32; 3], without: u32) -> bool {
        let least = wanted.map(|v| self.star_of(v)).into_iter().min_by_key(|star| star.len());
        least.unwrap_or_default().iter().any(|&t| {
            let corners = self.triangles[t as usize];
            wanted.iter().all(|v| corners.contains(v)) && !corners.contains(&without)
        })
    }

    /// Puts other triangles in the place of those round a vertex, which is gone then.
    ///
    /// - `fan`: the vertex's.
    /// - `patch`: new triangles, in places of the fan's ring, no more than it has triangles; `bounds`: theirs (mm).
    /// - `near`: a neighbour in whose surroundings the surface is now nearest.
    pub(super) fn replace(&mut self, v: u32, fan: &Fan, patch: &[[u8; 3]], bounds: &[f32], near: u32) {
        let slots = fan.triangles();
        for &r in fan.ring() {
            let star = &mut self.stars[r as usize];
            // Two of a fan's triangles meet in each of its ring.
            for _ in 0..2 {
                if let Some(at) = star.iter().position(|t| slots.contains(t)) {
                    star.remove(at);
                }
            }
        }
        self.stars[v as usize] = Vec::new();
        for (i, &t) in slots.iter().enumerate() {
            let corners = patch.get(i).map_or(GONE, |p| p.map(|at| fan.ring()[at as usize]));
            self.triangles[t as usize] = corners;
            if corners != GONE {
                self.bounds[t as usize] = bounds[i];
                for c in corners {
                    self.stars[c as usize].push(t);
                }
            }
        }
        self.features.join(v);
        self.onto[v as usize] = near;
    }

    /// Largest bound of a triangle left (mm).
    pub(super) fn max_bound(&self) -> f64 {
        let left = self.triangles.iter().zip(&self.bounds).filter(|t| *t.0 != GONE);
        left.map(|t| *t.1).fold(0.0, f32::max).into()
    }

    /// What is left, in the order of the input; call when all is done.
    pub(super) fn outcome(
        &self,
        seen: Seen,
        stopped_by: StopReason,
        refused: Refused,
        passes: u32,
    ) -> Outcome {
        Outcome {
            kept: self.left(),
            triangles: self.triangles.iter().copied().filter(|t| *t != GONE).collect(),
            max_error_mm: self.max_bound(),
            seen,
            stopped_by,
            refused,
            passes,
        }
    }
}

impl Refining for Mesh {
    /// What a hole is filled with may lie far from the vertex that stands for it.
    const STEPS: usize = 64;

    fn positions(&self) -> &[Vector3<f64>] {
        &self.positions
    }

    fn areas(&self) -> &[f32] {
        &self.areas
    }

    fn star(&self, v: usize) -> &[u32] {
        &self.stars[v]
    }

    fn corners(&self, t: u32) -> [u32; 3] {
        self.triangles[t as usize]
    }

    fn end_of(&self, v: usize) -> usize {
        let mut end = v;
        while self.onto[end] as usize != end {
            end = self.onto[end] as usize;
        }
        end
    }
}
