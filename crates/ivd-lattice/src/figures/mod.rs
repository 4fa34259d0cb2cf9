//! What can be counted and measured about a lattice: its defects, its topology, its area and volume, and the shapes of its
//! triangles ([`quality()`]).
//!
//! ```
//! use ivd_core::{ElementKey, Grid, Lattice};
//! use ivd_lattice::figures::measure;
//!
//! let grid = Grid::with_spacing([2, 2, 2], [1.0; 3])?;
//! let key = |padded| ElementKey::new(grid.dims(), padded, 6);
//! let keys = vec![key([1, 1, 1]), key([2, 1, 1]), key([1, 2, 1]), key([1, 1, 2])];
//! let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
//! let tetrahedron = Lattice::new(grid, keys.into(), vec![[0.0; 3]; 4].into(), triangles.into())?;
//! let figures = measure(&tetrahedron);
//! assert!(figures.is_closed_manifold());
//! assert_eq!((figures.euler, figures.genus), (2, Some(0)));
//! assert!((figures.volume_mm3 - 1.0 / 6.0).abs() < 1e-12);
//! # Ok::<(), ivd_core::Error>(())
//! ```

pub(crate) mod link;
mod quality;
pub(crate) mod stars;

use ivd_core::{Lattice, sets};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use link::{Link, LinkCounts};
pub use quality::{ASPECT_BINS, Component, Quality, Spread, quality};
use stars::Stars;

/// Vertices or triangles summed as one piece: sums don't depend on the number of threads.
const PIECE: usize = 4096;

/// Figures of a triangle mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Vertices, used or not.
    pub vertices: u64,
    /// Triangles, degenerate ones too.
    pub triangles: u64,
    /// Edges with one triangle.
    pub boundary_edges: u64,
    /// Edges with more than two triangles.
    pub non_manifold_edges: u64,
    /// Edges whose two triangles run along them in the same direction.
    pub misoriented_edges: u64,
    /// Vertices in which several fans of triangles meet, and nothing but the vertex joins them.
    pub bow_tie_vertices: u64,
    /// Triangles that name a vertex twice, or two of whose corners lie at one place.
    pub degenerate_triangles: u64,
    /// Vertices that no triangle names.
    pub unused_vertices: u64,
    /// Euler characteristic: used vertices − edges + triangles.
    pub euler: i64,
    /// Parts that triangles connect.
    pub components: u64,
    /// Handles of all components together; only a closed, oriented manifold has them.
    pub genus: Option<u64>,
    /// Area (mm²).
    pub area_mm2: f64,
    /// Enclosed volume (mm³): positive where triangles are counter-clockwise from outside. It means something for a
    /// closed mesh only.
    pub volume_mm3: f64,
}

impl Figures {
    /// Whether every edge has two triangles that agree, every vertex one fan, and no triangle is degenerate.
    pub fn is_closed_manifold(&self) -> bool {
        self.boundary_edges == 0
            && self.non_manifold_edges == 0
            && self.misoriented_edges == 0
            && self.bow_tie_vertices == 0
            && self.degenerate_triangles == 0
    }
}

/// Measures a lattice, parallel on the calling pool; the same figures, bit for bit, for any number of threads.
///
/// Lengths are taken relative to the grid's origin, so that a lattice 10⁶ mm away loses nothing.
pub fn measure(lattice: &Lattice) -> Figures {
    let stars = Stars::new(lattice.keys().len(), lattice.triangles());
    let links = count_links(&stars, lattice.triangles());
    let (area_mm2, volume_mm3, degenerate_triangles) = extent(lattice);
    let used = stars.len() as u64 - links.unused_vertices;
    let mut figures = Figures {
        vertices: lattice.keys().len() as u64,
        triangles: lattice.triangles().len() as u64,
        boundary_edges: links.boundary_edges,
        non_manifold_edges: links.non_manifold_edges,
        misoriented_edges: links.misoriented_edges,
        bow_tie_vertices: links.bow_tie_vertices,
        degenerate_triangles,
        unused_vertices: links.unused_vertices,
        euler: used as i64 - links.edges as i64 + lattice.triangles().len() as i64,
        components: components(lattice) - links.unused_vertices,
        genus: None,
        area_mm2,
        volume_mm3,
    };
    if figures.is_closed_manifold() {
        figures.genus = u64::try_from(2 * figures.components as i64 - figures.euler).ok().map(|g| g / 2);
    }
    figures
}

fn count_links(stars: &Stars, triangles: &[[u32; 3]]) -> LinkCounts {
    let pieces: Vec<LinkCounts> = (0..stars.len().div_ceil(PIECE))
        .into_par_iter()
        .map_init(Link::default, |link, piece| {
            let mut counts = LinkCounts::default();
            for v in piece * PIECE..(piece * PIECE + PIECE).min(stars.len()) {
                counts += link.count(v as u32, stars, triangles);
            }
            counts
        })
        .collect();
    pieces.into_iter().fold(LinkCounts::default(), |mut sum, piece| {
        sum += piece;
        sum
    })
}

/// Sets of connected vertices; one that no triangle names is a set of its own.
fn components(lattice: &Lattice) -> u64 {
    component_roots(lattice).iter().enumerate().filter(|(v, root)| *v as u32 == **root).count() as u64
}

/// The first vertex of the component that each vertex is in.
pub(crate) fn component_roots(lattice: &Lattice) -> Vec<u32> {
    let mut roots = sets::singles(lattice.keys().len());
    for &[a, b, c] in lattice.triangles() {
        sets::join(&mut roots, a, b);
        sets::join(&mut roots, b, c);
    }
    sets::flatten(&mut roots);
    roots
}

/// Area (mm²), enclosed volume (mm³), degenerate triangles.
fn extent(lattice: &Lattice) -> (f64, f64, u64) {
    let linear = lattice.grid().linear_part();
    let positions: Vec<Vector3<f64>> =
        (0..lattice.keys().len()).into_par_iter().map(|v| linear * lattice.voxel(v).0).collect();
    let centre = middle(&positions);
    let pieces: Vec<(f64, f64, u64)> = lattice
        .triangles()
        .par_chunks(PIECE)
        .map(|piece| {
            let (mut area, mut volume, mut degenerate) = (0.0, 0.0, 0);
            for t in piece {
                let corners = t.map(|v| positions[v as usize]);
                let [a, b, c] = corners.map(|p| p - centre);
                area += 0.5 * (b - a).cross(&(c - a)).norm();
                volume += a.dot(&b.cross(&c)) / 6.0;
                degenerate += u64::from(is_degenerate(corners, || t.map(|v| lattice.voxel(v as usize).0)));
            }
            (area, volume, degenerate)
        })
        .collect();
    pieces.into_iter().fold((0.0, 0.0, 0), |sum, p| (sum.0 + p.0, sum.1 + p.1, sum.2 + p.2))
}

/// Middle of the bounding box.
fn middle(positions: &[Vector3<f64>]) -> Vector3<f64> {
    let Some(first) = positions.first() else { return Vector3::zeros() };
    let (lo, hi) = positions.iter().fold((*first, *first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
    (lo + hi) / 2.0
}

/// Whether two corners lie at one place of the grid. In the world they then do too, and others by rounding.
fn is_degenerate(world: [Vector3<f64>; 3], voxels: impl FnOnce() -> [Vector3<f64>; 3]) -> bool {
    let meet = |[a, b, c]: [Vector3<f64>; 3]| a == b || b == c || c == a;
    meet(world) && meet(voxels())
}

#[cfg(test)]
mod tests;
