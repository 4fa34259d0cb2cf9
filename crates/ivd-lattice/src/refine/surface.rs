use ivd_core::Lattice;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::deviation::bounds_after;
use super::quadric::Quadric;
use super::star::{Fan, GONE, MAX_VALENCE};
use crate::figures::stars::Stars;

/// No vertex.
const NONE: u32 = u32::MAX;

/// Least height of a new triangle as a share of its longest side.
const LEAST_HEIGHT: f64 = 1e-4;

/// Why a collapse is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It would pinch the surface: the two ends have more neighbours in common than their two triangles.
    Link,
    /// It would turn a triangle too far or leave one without area.
    Flip,
    /// It would make a component vanish: a tetrahedron is the least.
    Speck,
    /// The bound would exceed what was asked for.
    Bound,
}

/// A surface while it is being refined. Vertices keep their index; triangles are moved together after each pass.
pub(super) struct Surface {
    /// Places (mm), relative to the middle.
    pub(super) positions: Vec<Vector3<f64>>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Bound of each triangle's distance from the input, both ways (mm).
    bounds: Vec<f64>,
    quadrics: Vec<Quadric>,
    /// Vertex that a removed one was collapsed onto; itself where it is left.
    pub(super) onto: Vec<u32>,
    /// Vertices that may go, ascending.
    pub(super) free: Vec<u32>,
    pub(super) stars: Stars,
    /// Vertices collapsed onto a vertex in this pass, as chains through their own entries.
    merged: Vec<u32>,
    targets: Vec<u32>,
    marks: Vec<u32>,
    mark: u32,
    triangles_left: usize,
}

/// Limits of a single collapse.
pub(super) struct Limits {
    /// Least cosine between a triangle's normals before and after.
    pub(super) turn_cosine: f64,
    /// Largest bound allowed (mm).
    pub(super) bound: f64,
}

impl Surface {
    /// The input with its stars, quadrics and locks. Vertices whose triangles aren't one closed fan are locked.
    pub(super) fn new(lattice: &Lattice) -> Self {
        let mut positions = lattice.local_positions();
        centre(&mut positions);
        let (n, triangles) = (positions.len(), lattice.triangles.clone());
        let stars = Stars::new(n, &triangles);
        let quadrics = (0..n)
            .into_par_iter()
            .map(|v| {
                let mut sum = Quadric::default();
                for &t in stars.of(v) {
                    sum += Quadric::of_triangle(triangles[t as usize].map(|c| positions[c as usize]));
                }
                sum
            })
            .collect();
        let free = (0..n as u32)
            .into_par_iter()
            .map_init(Fan::new, |fan, v| fan.read(v, &stars, &triangles).then_some(v))
            .flatten()
            .collect();
        Self {
            positions,
            bounds: vec![0.0; triangles.len()],
            triangles_left: triangles.len(),
            triangles,
            quadrics,
            onto: (0..n as u32).collect(),
            free,
            stars,
            merged: vec![NONE; n],
            targets: Vec::new(),
            marks: vec![0; n],
            mark: 0,
        }
    }

    /// Triangles left.
    pub(super) fn triangles_left(&self) -> usize {
        self.triangles_left
    }

    /// Largest bound of a triangle left (mm); call between passes.
    pub(super) fn max_bound(&self) -> f64 {
        self.bounds.par_iter().copied().reduce(|| 0.0, f64::max)
    }

    /// Cost of a collapse (mm²): what the vertex's planes say about the place of the other end.
    #[inline]
    pub(super) fn cost(&self, v: u32, onto: u32, shape_weight: f64) -> f32 {
        let (from, to) = (&self.positions[v as usize], &self.positions[onto as usize]);
        (self.quadrics[v as usize].mean_square(to) + shape_weight * (to - from).norm_squared()) as f32
    }

    /// Whether a vertex was collapsed onto in this pass: its quadric has changed and its star isn't listed whole.
    pub(super) fn is_target(&self, v: u32) -> bool {
        self.merged[v as usize] != NONE
    }

    /// Collapses the vertex of `fan`, `u`, onto its neighbour `y` if nothing speaks against it.
    pub(super) fn collapse(&mut self, u: u32, y: u32, fan: &mut Fan, limits: &Limits) -> Result<(), Refusal> {
        fan.turn_to(y);
        self.check_shape(u, fan, limits)?;
        self.check_link(u, y, fan)?;
        let bounds = self.bounds_after(u, fan);
        let k = fan.ring().len();
        if bounds[1..k - 1].iter().any(|&b| b > limits.bound) {
            return Err(Refusal::Bound);
        }
        for (i, &t) in fan.triangles().iter().enumerate() {
            let t = t as usize;
            if i == 0 || i == k - 1 {
                self.triangles[t] = GONE;
            } else {
                let corner = self.triangles[t].iter_mut().find(|c| **c == u);
                *corner.expect("the fan lists the vertex's triangles") = y;
                self.bounds[t] = bounds[i];
            }
        }
        self.triangles_left -= 2;
        self.record(u, y);
        Ok(())
    }

    fn record(&mut self, u: u32, y: u32) {
        let gone = self.quadrics[u as usize];
        self.quadrics[y as usize] += gone;
        self.onto[u as usize] = y;
        // The chain ends in a vertex that names itself.
        let first = self.merged[y as usize];
        if first == NONE {
            self.targets.push(y);
        }
        self.merged[u as usize] = if first == NONE { u } else { first };
        self.merged[y as usize] = u;
        self.targets.push(u);
    }

    /// No new triangle may turn too far from the old one or be nearly without area.
    fn check_shape(&self, u: u32, fan: &Fan, limits: &Limits) -> Result<(), Refusal> {
        let (from, ring) = (self.positions[u as usize], fan.ring());
        let to = self.positions[ring[0] as usize];
        for side in ring[1..].windows(2) {
            let [b, c] = [side[0], side[1]].map(|r| self.positions[r as usize]);
            let (edge, old, new) = (c - b, (b - from).cross(&(c - from)), (b - to).cross(&(c - to)));
            let longest = edge.norm_squared().max((b - to).norm_squared()).max((c - to).norm_squared());
            let size = new.norm_squared();
            let flat = size <= (LEAST_HEIGHT * longest).powi(2);
            if flat || old.dot(&new) < limits.turn_cosine * (old.norm_squared() * size).sqrt() {
                return Err(Refusal::Flip);
            }
        }
        Ok(())
    }

    /// The link condition (Dey et al. 1999): `u` and `y` share the two neighbours of their edge's triangles and no
    /// other, and no new triangle exists already.
    fn check_link(&mut self, u: u32, y: u32, fan: &Fan) -> Result<(), Refusal> {
        self.mark += 2;
        let (ring, mark) = (fan.ring(), self.mark);
        for &r in &ring[1..] {
            self.marks[r as usize] = mark;
        }
        let (mut common, mut last) = (0, y);
        loop {
            for &t in self.stars.of(last as usize) {
                let corners = self.triangles[t as usize];
                if corners == GONE {
                    continue;
                }
                // The third side of a fan of three, seen from the other side: a tetrahedron.
                if ring.len() == 3 && !corners.contains(&u) && ring[1..].iter().all(|r| corners.contains(r)) {
                    return Err(Refusal::Speck);
                }
                for c in corners {
                    if c != y && self.marks[c as usize] == mark {
                        self.marks[c as usize] = mark + 1;
                        common += 1;
                    }
                }
            }
            let next = self.merged[last as usize];
            if next == NONE || next == last {
                break;
            }
            last = next;
        }
        if common == 2 { Ok(()) } else { Err(Refusal::Link) }
    }

    fn bounds_after(&self, u: u32, fan: &Fan) -> [f64; MAX_VALENCE] {
        let k = fan.ring().len();
        let mut ring = [Vector3::zeros(); MAX_VALENCE];
        let mut old = [0.0; MAX_VALENCE];
        for i in 0..k {
            ring[i] = self.positions[fan.ring()[i] as usize];
            old[i] = self.bounds[fan.triangles()[i] as usize];
        }
        bounds_after(&self.positions[u as usize], &ring[..k], &old[..k])
    }

    /// The vertex left that a vertex ended on, through all its collapses.
    pub(super) fn end_of(&self, v: usize) -> usize {
        let mut end = v;
        while self.onto[end] as usize != end {
            end = self.onto[end] as usize;
        }
        end
    }

    /// Ends a pass: moves the triangles that are left together and lists their stars anew.
    pub(super) fn tidy(&mut self) {
        let mut kept = 0;
        for t in 0..self.triangles.len() {
            if self.triangles[t] != GONE {
                self.triangles[kept] = self.triangles[t];
                self.bounds[kept] = self.bounds[t];
                kept += 1;
            }
        }
        self.triangles.truncate(kept);
        self.bounds.truncate(kept);
        for v in self.targets.drain(..) {
            self.merged[v as usize] = NONE;
        }
        let onto = &self.onto;
        self.free.retain(|&v| onto[v as usize] == v);
        self.stars.rebuild(self.positions.len(), &self.triangles);
        self.marks.fill(0);
        self.mark = 0;
    }
}

/// Moves places so that the middle of their box is 0: quadrics lose the least.
fn centre(positions: &mut [Vector3<f64>]) {
    let Some(first) = positions.first() else { return };
    let (lo, hi) = positions.iter().fold((*first, *first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
    let middle = (lo + hi) / 2.0;
    for p in positions {
        *p -= middle;
    }
}
