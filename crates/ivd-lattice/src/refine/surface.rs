use ivd_core::Lattice;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::features::{Features, Kind};
use super::locks::Locks;
use super::mean::Refining;
use super::numbering::Numbering;
use super::quadric::{Quadric, plane_root};
use super::refusal::Refused;
use super::shared::{NONE, Triangles, Word};
use super::star::Fan;
use crate::figures::stars::Stars;

/// A surface while it is being refined. Vertices are numbered by place and keep that number; triangles are moved together
/// after each pass.
pub(super) struct Surface {
    /// Number that each vertex has in the input.
    pub(super) numbers: Vec<u32>,
    /// Places (mm), relative to the middle.
    pub(super) positions: Vec<Vector3<f64>>,
    pub(super) triangles: Triangles,
    /// Area of the input's triangles round each vertex (mm²).
    pub(super) areas: Vec<f32>,
    /// Vertices that may go, ascending.
    pub(super) free: Vec<u32>,
    pub(super) features: Features,
    /// Vertices that may not go from the first, by what keeps them.
    pub(super) kept: Refused,
    pub(super) stars: Stars,
    /// Vertex that a removed one was collapsed onto; itself where it is left.
    pub(super) onto: Vec<Word>,
    /// Vertices collapsed onto a vertex in this pass, as chains through their own entries. The chain begins in the
    /// target and ends in a vertex that names itself.
    pub(super) merged: Vec<Word>,
    quadrics: Vec<Quadric>,
    /// One over the mean area round a vertex of the input (mm⁻²).
    per_area: f32,
    /// Cost of the cheapest collapse of each vertex that is worth a try (mm²): [`UNKNOWN`] where its neighbourhood has
    /// changed, infinite where none is.
    least: Vec<Word>,
}

/// Stands for a cost that has to be found anew.
const UNKNOWN: f32 = f32::NAN;

/// Least area that tells, of the mean: what lies round a vertex of slivers still has a shape.
const LEAST_SHARE: f32 = 1.0 / 256.0;

impl Surface {
    /// The input with its stars, quadrics and locks. Vertices whose triangles aren't one closed fan are locked too.
    ///
    /// - `feature_degrees`: turn from which edges are features; their corners are locked too.
    pub(super) fn new(lattice: &Lattice, locks: Locks<'_>, feature_degrees: Option<f64>) -> Self {
        let mut places = lattice.local_positions();
        centre(&mut places);
        let n = places.len();
        let Numbering { vertices: numbers, triangles, corners } =
            Numbering::new(&places, lattice.triangles());
        let positions: Vec<_> = numbers.par_iter().map(|&v| places[v as usize]).collect();
        let (stars, (roots, triangles)) = rayon::join(
            || Stars::new(n, &corners),
            || {
                let root = |t: &[u32; 3]| plane_root(t.map(|v| positions[v as usize]));
                (corners.par_iter().map(root).collect::<Vec<_>>(), Triangles::new(&corners, triangles))
            },
        );
        let quadrics: Vec<_> = (0..n)
            .into_par_iter()
            .map(|v| Quadric::of_star(stars.of(v).iter().map(|&t| roots[t as usize])))
            .collect();
        let area: f64 = quadrics.iter().map(|quadric| f64::from(quadric.weight())).sum();
        let locked = locks.flags(n);
        let features = Features::new(&positions, &corners, feature_degrees);
        let mut free: Vec<u32> = (0..n as u32)
            .into_par_iter()
            .filter(|&v| !locked[numbers[v as usize] as usize])
            .map_init(Fan::new, |fan, v| fan.read(v, &stars, &triangles).then_some(v))
            .flatten_iter()
            .collect();
        let locks = n - free.len();
        free.retain(|&v| features.kind(v) != Kind::Corner);
        let corners = n - locks - free.len();
        Self {
            numbers,
            positions,
            triangles,
            areas: quadrics.iter().map(Quadric::weight).collect(),
            free,
            features,
            kept: Refused { locks: locks as u64, features: corners as u64, ..Refused::default() },
            stars,
            onto: (0..n as u32).map(Word::new).collect(),
            merged: (0..n).map(|_| Word::new(NONE)).collect(),
            quadrics,
            per_area: (n as f64 / area.max(f64::MIN_POSITIVE)) as f32,
            least: (0..n).map(|_| Word::new(UNKNOWN.to_bits())).collect(),
        }
    }

    /// Largest bound of a triangle left (mm); call between passes.
    pub(super) fn max_bound(&self) -> f64 {
        (0..self.triangles.len() as u32).map(|t| self.triangles.bound(t)).fold(0.0, f32::max).into()
    }

    /// Cost (mm²) of pulling a vertex by an offset (mm): what its planes say about the place where it goes, more where it stands
    /// for more of the surface.
    ///
    /// The fourth root of that area lies between its first power, which makes the mean error least and lets some places go far
    /// wrong, and none, which only looks at how far.
    #[inline]
    pub(super) fn cost(&self, v: u32, offset: &Vector3<f64>, shape_weight: f32) -> f32 {
        let offset = offset.cast();
        let quadric = &self.quadrics[v as usize];
        let share = (quadric.weight() * self.per_area).max(LEAST_SHARE).sqrt().sqrt();
        share * (quadric.mean_square(&offset) + shape_weight * offset.norm_squared())
    }

    /// Cost of the cheapest collapse of a free vertex that is worth a try; call between passes.
    pub(super) fn least_cost(&self, v: u32, shape_weight: f32) -> f32 {
        let known = self.least[v as usize].float();
        if !known.is_nan() {
            return known;
        }
        let from = &self.positions[v as usize];
        let least = self
            .stars
            .of(v as usize)
            .iter()
            .map(|&t| after(self.triangles.corners(t), v))
            .filter(|&r| self.features.allow(v, r))
            .map(|r| self.cost(v, &(self.positions[r as usize] - from), shape_weight))
            .fold(f32::INFINITY, f32::min);
        self.least[v as usize].set_float(least);
        least
    }

    /// Notes that a vertex isn't worth a try below a cost unless something changes round it.
    pub(super) fn put_off(&self, v: u32, cost: f32) {
        self.least[v as usize].set_float(cost);
    }

    /// The planes that a vertex stands for.
    pub(super) fn quadric(&self, v: u32) -> &Quadric {
        &self.quadrics[v as usize]
    }

    /// Area of the input (mm²).
    pub(super) fn area(&self) -> f64 {
        self.areas.iter().map(|&a| f64::from(a)).sum::<f64>() / 3.0
    }

    /// Forgets what the last tries came to.
    pub(super) fn forget(&self, v: u32) {
        self.least[v as usize].set_float(UNKNOWN);
    }

    /// Whether a vertex was collapsed onto in this pass: its quadric will change and its star isn't listed whole.
    pub(super) fn is_target(&self, v: u32) -> bool {
        self.merged[v as usize].get() != NONE
    }

    /// Whether a vertex is still there.
    pub(super) fn is_left(&self, v: usize) -> bool {
        self.onto[v].get() as usize == v
    }

    /// Adds the quadric of a vertex that was collapsed to that of its target.
    pub(super) fn absorb(&mut self, u: u32) {
        let (u, y) = (u as usize, self.onto[u as usize].get() as usize);
        let gone = self.quadrics[u];
        self.quadrics[y].merge(&gone, &(self.positions[u] - self.positions[y]).cast());
    }

    /// Ends a pass: adds the quadrics up, moves the triangles that are left together and lists their stars anew.
    ///
    /// - `collapsed`: the vertices removed in this pass, in an order that no number of threads changes.
    pub(super) fn tidy(&mut self, collapsed: &[u32]) {
        for &u in collapsed {
            self.absorb(u);
            self.merged[u as usize].set(NONE);
            self.merged[self.onto[u as usize].get() as usize].set(NONE);
        }
        self.triangles.compact();
        let onto = &self.onto;
        self.free.retain(|&v| onto[v as usize].get() == v);
        let triangles = &self.triangles;
        self.stars.rebuild(self.positions.len(), triangles.len(), |t| triangles.corners(t as u32));
    }
}

impl Refining for Surface {
    const STEPS: usize = 1;

    fn positions(&self) -> &[Vector3<f64>] {
        &self.positions
    }

    fn areas(&self) -> &[f32] {
        &self.areas
    }

    fn star(&self, v: usize) -> &[u32] {
        self.stars.of(v)
    }

    fn corners(&self, t: u32) -> [u32; 3] {
        self.triangles.corners(t)
    }

    fn end_of(&self, v: usize) -> usize {
        let mut end = v;
        while !self.is_left(end) {
            end = self.onto[end].get() as usize;
        }
        end
    }
}

/// Corner that follows vertex `v` in a triangle: in a closed fan, each neighbour follows once.
#[inline]
fn after([a, b, c]: [u32; 3], v: u32) -> u32 {
    if a == v {
        b
    } else if b == v {
        c
    } else {
        a
    }
}

/// Moves places so that the middle of their box is 0.
pub(super) fn centre(positions: &mut [Vector3<f64>]) {
    let Some(first) = positions.first() else { return };
    let (lo, hi) = positions.iter().fold((*first, *first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
    let middle = (lo + hi) / 2.0;
    for p in positions {
        *p -= middle;
    }
}

/// Bytes of a surface with its quadrics, stars and bounds.
pub(super) fn bytes_for(lattice: &Lattice) -> u64 {
    surface_bytes(lattice.keys().len(), lattice.triangles().len())
}

/// The same of so many vertices and triangles.
pub(super) fn surface_bytes(vertices: usize, triangles: usize) -> u64 {
    140 * vertices as u64 + 44 * triangles as u64
}
