//! How well shaped a mesh is.

use ivd_core::Lattice;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::link::{Link, LinkCounts};
use super::stars::Stars;
use super::{PIECE, component_roots};

/// Lower ends of the histogram's bins; the last bin is open.
pub const ASPECT_BINS: [f64; 8] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 100.0];

/// Least, mean and largest of some values; all 0 where there are none.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Spread {
    /// Least value.
    pub min: f64,
    /// Mean value.
    pub mean: f64,
    /// Largest value.
    pub max: f64,
}

/// A part of a mesh that triangles connect.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Component {
    /// Least vertex.
    pub first_vertex: u32,
    /// Vertices.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Area (mm²).
    pub area_mm2: f64,
    /// Enclosed volume (mm³), negative for a cavity; it means something for a closed component only.
    pub volume_mm3: f64,
    /// Handles; only a closed, oriented manifold has them.
    pub genus: Option<u64>,
}

/// Shapes of triangles, lengths of edges, valences, and figures of each component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Aspect ratio of the triangles with an area: longest edge / (2 √3 · inradius), 1 for an equilateral one.
    pub aspect: Spread,
    /// Triangles by their aspect ratio, from each of [`ASPECT_BINS`] to the next; those without area in the last.
    pub aspect_histogram: [u64; ASPECT_BINS.len()],
    /// Triangles without area.
    pub flat_triangles: u64,
    /// Smallest angle of each triangle (degrees), 0 for one without area; 60 is best.
    pub smallest_angle_degrees: Spread,
    /// Lengths of the edges (mm), each counted once.
    pub edge_mm: Spread,
    /// Vertices by their number of neighbours, from 0; what no triangle names has none.
    pub valences: Vec<u64>,
    /// Share of the vertices that have six neighbours; 0 where there are no vertices.
    pub regular_share: f64,
    /// Components by their least vertex.
    pub components: Vec<Component>,
}

/// Sums on the way to a [`Spread`].
#[derive(Clone, Copy)]
struct Sum {
    count: u64,
    min: f64,
    max: f64,
    total: f64,
}

impl Default for Sum {
    fn default() -> Self {
        Self { count: 0, min: f64::INFINITY, max: f64::NEG_INFINITY, total: 0.0 }
    }
}

impl Sum {
    fn add(&mut self, value: f64) {
        self.join(Self { count: 1, min: value, max: value, total: value });
    }

    fn join(&mut self, other: Self) {
        self.count += other.count;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.total += other.total;
    }

    fn spread(self) -> Spread {
        if self.count == 0 {
            return Spread::default();
        }
        Spread { min: self.min, mean: self.total / self.count as f64, max: self.max }
    }
}

/// What the vertices of a piece show.
#[derive(Default)]
struct Rings {
    edges: Sum,
    valences: Vec<u64>,
    /// Component, its vertices and what their links show, one entry a run of vertices.
    runs: Vec<(u32, u64, LinkCounts)>,
}

/// What the triangles of a piece show.
#[derive(Default)]
struct Shapes {
    aspect: Sum,
    histogram: [u64; ASPECT_BINS.len()],
    flat: u64,
    angle: Sum,
    /// Component, and its triangles, area and volume, one entry a run of triangles.
    runs: Vec<(u32, Component)>,
}

/// Measures shapes; the same figures, bit for bit, for any number of threads. Lengths are taken relative to the grid's
/// origin. Takes about as long as [`measure`](super::measure).
pub fn quality(lattice: &Lattice) -> Quality {
    let positions = lattice.local_positions();
    let (component_of, firsts) = label(lattice);
    let rings = rings(lattice, &positions, &component_of);
    let shapes = shapes(lattice, &positions, &component_of, &firsts);
    let mut components: Vec<Component> =
        firsts.iter().map(|&first_vertex| Component { first_vertex, ..Component::default() }).collect();
    let mut links = vec![LinkCounts::default(); firsts.len()];
    let (mut edges, mut valences) = (Sum::default(), Vec::new());
    for piece in rings {
        edges.join(piece.edges);
        if valences.len() < piece.valences.len() {
            valences.resize(piece.valences.len(), 0);
        }
        for (sum, count) in valences.iter_mut().zip(piece.valences) {
            *sum += count;
        }
        for (component, vertices, counts) in piece.runs {
            components[component as usize].vertices += vertices;
            links[component as usize] += counts;
        }
    }
    let mut sum = Shapes::default();
    for piece in shapes {
        sum.aspect.join(piece.aspect);
        sum.angle.join(piece.angle);
        sum.flat += piece.flat;
        for (bin, count) in sum.histogram.iter_mut().zip(piece.histogram) {
            *bin += count;
        }
        for (component, part) in piece.runs {
            let whole = &mut components[component as usize];
            whole.triangles += part.triangles;
            whole.area_mm2 += part.area_mm2;
            whole.volume_mm3 += part.volume_mm3;
        }
    }
    for (component, links) in components.iter_mut().zip(&links) {
        component.genus = genus(component, links);
    }
    components.retain(|c| c.triangles > 0);
    let regular: u64 = valences.get(6).copied().unwrap_or(0);
    Quality {
        aspect: sum.aspect.spread(),
        aspect_histogram: sum.histogram,
        flat_triangles: sum.flat,
        smallest_angle_degrees: sum.angle.spread(),
        edge_mm: edges.spread(),
        valences,
        regular_share: if lattice.keys().is_empty() {
            0.0
        } else {
            regular as f64 / lattice.keys().len() as f64
        },
        components,
    }
}

fn genus(component: &Component, links: &LinkCounts) -> Option<u64> {
    let defects =
        links.boundary_edges + links.non_manifold_edges + links.misoriented_edges + links.bow_tie_vertices;
    let euler = component.vertices as i64 - links.edges as i64 + component.triangles as i64;
    (defects == 0).then(|| u64::try_from(2 - euler).ok().map(|g| g / 2))?
}

/// The component of each vertex, numbered by their least vertices, which are given too.
fn label(lattice: &Lattice) -> (Vec<u32>, Vec<u32>) {
    let roots = component_roots(lattice);
    let (mut component_of, mut firsts) = (vec![0; roots.len()], Vec::new());
    for (v, &first) in roots.iter().enumerate() {
        if first as usize == v {
            component_of[v] = firsts.len() as u32;
            firsts.push(first);
        } else {
            component_of[v] = component_of[first as usize];
        }
    }
    (component_of, firsts)
}

fn rings(lattice: &Lattice, positions: &[Vector3<f64>], component_of: &[u32]) -> Vec<Rings> {
    let stars = Stars::new(lattice.keys().len(), lattice.triangles());
    let piece = |link: &mut Link, piece: usize| {
        let mut rings = Rings::default();
        for v in piece * PIECE..(piece * PIECE + PIECE).min(stars.len()) {
            let counts = link.count(v as u32, &stars, lattice.triangles());
            let neighbours = link.neighbours();
            if rings.valences.len() <= neighbours.len() {
                rings.valences.resize(neighbours.len() + 1, 0);
            }
            rings.valences[neighbours.len()] += 1;
            for &w in neighbours.iter().filter(|&&w| w as usize > v) {
                rings.edges.add((positions[w as usize] - positions[v]).norm());
            }
            match rings.runs.last_mut().filter(|run| run.0 == component_of[v]) {
                Some(run) => {
                    run.1 += 1;
                    run.2 += counts;
                }
                None => rings.runs.push((component_of[v], 1, counts)),
            }
        }
        rings
    };
    (0..stars.len().div_ceil(PIECE)).into_par_iter().map_init(Link::default, piece).collect()
}

fn shapes(
    lattice: &Lattice,
    positions: &[Vector3<f64>],
    component_of: &[u32],
    firsts: &[u32],
) -> Vec<Shapes> {
    let piece = |triangles: &[[u32; 3]]| {
        let mut shapes = Shapes::default();
        for t in triangles {
            let component = component_of[t[0] as usize];
            let origin = positions[firsts[component as usize] as usize];
            let corners = t.map(|v| positions[v as usize] - origin);
            let area = shapes.add(corners);
            let [a, b, c] = corners;
            let volume = a.dot(&b.cross(&c)) / 6.0;
            if shapes.runs.last().is_none_or(|run| run.0 != component) {
                shapes.runs.push((component, Component::default()));
            }
            if let Some((_, run)) = shapes.runs.last_mut() {
                run.triangles += 1;
                run.area_mm2 += area;
                run.volume_mm3 += volume;
            }
        }
        shapes
    };
    lattice.triangles().par_chunks(PIECE).map(piece).collect()
}

impl Shapes {
    /// Takes a triangle; gives its area (mm²).
    fn add(&mut self, [a, b, c]: [Vector3<f64>; 3]) -> f64 {
        let area = 0.5 * (b - a).cross(&(c - a)).norm();
        let mut sides = [(b - a).norm(), (c - b).norm(), (a - c).norm()];
        sides.sort_unstable_by(f64::total_cmp);
        let [shortest, middle, longest] = sides;
        if area == 0.0 {
            self.flat += 1;
            self.histogram[ASPECT_BINS.len() - 1] += 1;
            self.angle.add(0.0);
            return 0.0;
        }
        let inradius = 2.0 * area / (shortest + middle + longest);
        let aspect = longest / (2.0 * 3.0_f64.sqrt() * inradius);
        self.aspect.add(aspect);
        self.histogram[ASPECT_BINS.partition_point(|bin| *bin <= aspect).max(1) - 1] += 1;
        // The smallest angle is across from the shortest side: its sine is twice the area by the other two.
        self.angle.add((2.0 * area / (middle * longest)).min(1.0).asin().to_degrees());
        area
    }
}
