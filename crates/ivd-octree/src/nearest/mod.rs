//! The lattice point nearest to a place, through the octree.
//!
//! Best first, branch and bound: a node is opened only while its box may hold a point nearer than the nearest so far. A
//! node's box is what its leaves' triangles fill of their cells, taken in a frame in which the grid's cells are boxes and
//! lengths are world millimetres. Bounds are single precision, rounded outwards; distances to triangles are double
//! precision. The answer is therefore that of a loop over all triangles, to the last bit and including ties, whatever
//! the order in which nodes are opened.

mod blocks;
mod bounds;

use std::sync::Arc;

use ivd_core::geometry::closest_on_triangle;
use ivd_core::{Lattice, Octree};
use nalgebra::{Matrix3, Vector3};

use crate::Error;
use blocks::{Block, Lane, Tree};

/// The lattice point nearest to a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Triangle of the lattice; of several at one distance the lowest.
    pub triangle: u32,
    /// Weights of the triangle's corners, ≥ 0, sum 1.
    pub barycentric: [f64; 3],
    /// Distance (mm).
    pub distance_mm: f64,
    /// The lattice point (mm), relative to the grid's origin.
    pub point: Vector3<f64>,
}

/// Finds nearest lattice points. Made once by [`prepare`]; queries take `&self` and run from many threads.
pub struct NearestIndex {
    /// From local millimetres to the frame of the boxes.
    frame: Matrix3<f64>,
    /// Vertices (mm), relative to the grid's origin.
    positions: Arc<Vec<Vector3<f64>>>,
    triangles: Arc<Vec<[u32; 3]>>,
    tree: Tree,
}

impl std::fmt::Debug for NearestIndex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NearestIndex").field("triangles", &self.triangles.len()).finish_non_exhaustive()
    }
}

/// Prepares the search of a lattice through its octree.
///
/// # Errors
/// In [`Error::Core`] an octree that was built over another lattice.
pub fn prepare(lattice: &Lattice, octree: &Octree) -> Result<NearestIndex, Error> {
    let [index] = prepare_parts(lattice, octree, |_| Some(0))?;
    Ok(index)
}

/// The octree of another lattice.
fn of_another(problem: String) -> Error {
    let what = "octree and lattice don't belong together";
    ivd_core::Error::Mismatch { what, problem, remedy: "build the octree of this lattice" }.into()
}

/// As [`prepare`], one search for each part of the triangles; `part` tells which of the `N` a triangle belongs to; one that belongs to
/// none is never found.
///
/// # Errors
/// As [`prepare`].
pub fn prepare_parts<const N: usize>(
    lattice: &Lattice,
    octree: &Octree,
    part: impl Fn(u32) -> Option<usize>,
) -> Result<[NearestIndex; N], Error> {
    let counts = [
        ("triangles", octree.triangle_count() as usize, lattice.triangles().len()),
        ("vertices", octree.vertex_count() as usize, lattice.keys().len()),
    ];
    if let Some((what, tree, mesh)) = counts.into_iter().find(|c| c.1 != c.2) {
        return Err(of_another(format!("{tree} {what} in the octree, {mesh} in the lattice")));
    }
    if !octree.grid().matches(lattice.grid()) {
        return Err(of_another("their grids differ".to_owned()));
    }
    // linear = q · r with q a rotation and r upper triangular (diagonal for a grid without shear): in the frame turned
    // by qᵀ cells are boxes and lengths are unchanged.
    let (q, r) = lattice.grid().linear_part().qr().unpack();
    let positions = lattice.local_positions();
    let frame = q.transpose();
    let trees = bounds::trees(octree, lattice, &positions, frame, r, part)?;
    let (positions, triangles) = (Arc::new(positions), Arc::new(lattice.triangles().to_vec()));
    Ok(trees.map(|tree| NearestIndex {
        frame,
        positions: positions.clone(),
        triangles: triangles.clone(),
        tree,
    }))
}

/// The search of one query.
struct Search<'a> {
    index: &'a NearestIndex,
    point: Vector3<f64>,
    /// The point in the frame of the boxes.
    framed: [f32; 3],
    best: Option<Nearest>,
    /// Square of the least distance so far (mm²).
    best_squared: f64,
    /// The same, rounded up.
    limit: f32,
    /// Whether the first better triangle ends the search.
    first: bool,
    ended: bool,
}

impl NearestIndex {
    /// The lattice point nearest to `point` (mm, relative to the grid's origin), where one lies within `bound` (mm).
    ///
    /// A bound makes the search faster; among neighbouring points the last distance plus the step is one. Infinity finds
    /// any. `None` for an empty lattice, a point that isn't finite, or where everything is further away.
    pub fn nearest(&self, point: Vector3<f64>, bound: f64) -> Option<Nearest> {
        if !point.iter().all(|c| c.is_finite()) || bound.is_nan() || bound < 0.0 {
            return None;
        }
        let framed = (self.frame * point).map(|c| c as f32).into();
        // A bound that is itself a rounded distance must not cut off the point that it belongs to.
        let best_squared = (bound * (1.0 + 1e-12)).powi(2);
        let limit = above(best_squared);
        let (first, ended) = (false, false);
        let mut search = Search { index: self, point, framed, best: None, best_squared, limit, first, ended };
        search.lane(self.tree.root);
        search.best
    }

    /// A lattice point nearer to `point` than `than`, which another part's search found for it; of two at one distance the
    /// lower triangle's counts as nearer. Any such point, not the nearest: sooner found.
    pub fn nearer(&self, point: Vector3<f64>, than: &Nearest) -> Option<Vector3<f64>> {
        let framed = (self.frame * point).map(|c| c as f32).into();
        let best_squared = (than.point - point).norm_squared();
        let (limit, best, first) = (above(best_squared), Some(*than), true);
        let mut search =
            Search { index: self, point, framed, best, best_squared, limit, first, ended: false };
        search.lane(self.tree.root);
        search.ended.then(|| search.best.expect("it began with one").point)
    }
}

impl Search<'_> {
    fn lane(&mut self, lane: Lane) {
        match lane.get() {
            blocks::Target::Nothing => {}
            blocks::Target::Triangle(triangle) => self.triangle(triangle),
            blocks::Target::Block(block) => self.block(block),
        }
    }

    /// Opens the lanes of a block that may hold something nearer, the nearest first.
    fn block(&mut self, block: u32) {
        let block: &Block = &self.index.tree.blocks[block as usize];
        let squared = block.squared_distances(self.framed);
        let mut near = [(0.0_f32, 0_usize); Block::LANES];
        let mut count = 0;
        for (i, &d) in squared.iter().enumerate() {
            if d <= self.limit {
                let mut at = count;
                while at > 0 && near[at - 1].0 > d {
                    near[at] = near[at - 1];
                    at -= 1;
                }
                near[at] = (d, i);
                count += 1;
            }
        }
        for &(d, i) in &near[..count] {
            if d > self.limit || self.ended {
                break;
            }
            self.lane(block.lanes[i]);
        }
    }

    fn triangle(&mut self, triangle: u32) {
        let corners = self.index.triangles[triangle as usize].map(|v| self.index.positions[v as usize]);
        if beyond(&corners, self.point, self.best_squared) {
            return;
        }
        let barycentric = closest_on_triangle(&corners, self.point);
        let found = corners[0] * barycentric[0] + corners[1] * barycentric[1] + corners[2] * barycentric[2];
        let squared = (found - self.point).norm_squared();
        let better = squared < self.best_squared
            || squared == self.best_squared && self.best.is_none_or(|best| triangle < best.triangle);
        if better {
            self.best = Some(Nearest { triangle, barycentric, distance_mm: squared.sqrt(), point: found });
            self.best_squared = squared;
            self.limit = above(squared);
            self.ended = self.first;
        }
    }
}

/// Whether a plane square to the way from the first corner to the point parts the two by more than the limit: the
/// cheapest test that is as good as the distance itself where the point is further off than the triangle is large. The
/// factor keeps rounding from ever passing over a tie.
#[inline]
fn beyond(corners: &[Vector3<f64>; 3], point: Vector3<f64>, limit_squared: f64) -> bool {
    let way = point - corners[0];
    let length_squared = way.norm_squared();
    let least = length_squared.min(way.dot(&(point - corners[1]))).min(way.dot(&(point - corners[2])));
    least > 0.0 && least * least > limit_squared * length_squared * (1.0 + 1e-9)
}

/// A single not below a double.
fn above(value: f64) -> f32 {
    let near = value as f32;
    if f64::from(near) < value { near.next_up() } else { near }
}
