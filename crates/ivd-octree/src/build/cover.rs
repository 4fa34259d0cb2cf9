//! Which leaf cells each triangle meets.

use ivd_core::Lattice;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::morton;
use super::overlap::triangle_meets_box;

/// From voxel coordinates to the tree's, in which the leaf of padded voxel p spans p … p + 1: one voxel for the padding,
/// half a voxel because a box is wider than its voxels' centres.
const SHIFT: f64 = 1.5;

/// Distance (voxels) at which a triangle still counts as touching a cell's border.
const TOUCH: f64 = 1e-9;

/// The pairs (Morton code of a leaf cell, triangle) of all triangles and the cells whose closed box they meet, sorted.
pub(super) fn leaf_triangles(lattice: &Lattice, depth: u8, leaf_bits: u32) -> Vec<(u64, u32)> {
    const CHUNK: usize = 1 << 12;
    let cells =
        Cells { size: f64::from(1_u32 << leaf_bits), last: (1_u32 << (u32::from(depth) - leaf_bits)) - 1 };
    let places: Vec<Vector3<f64>> = (0..lattice.keys().len())
        .into_par_iter()
        .map(|vertex| lattice.voxel(vertex).0.add_scalar(SHIFT))
        .collect();
    let mut pairs: Vec<(u64, u32)> = lattice
        .triangles()
        .par_chunks(CHUNK)
        .enumerate()
        .flat_map_iter(|(chunk, triangles)| {
            let mut pairs = Vec::with_capacity(2 * triangles.len());
            for (i, triangle) in triangles.iter().enumerate() {
                let corners = triangle.map(|v| places[v as usize]);
                let index = (chunk * CHUNK + i) as u32;
                cells.visit(&corners, |cell| pairs.push((morton::encode(cell), index)));
            }
            pairs
        })
        .collect();
    pairs.par_sort_unstable();
    pairs
}

/// The cells that may become leaves.
struct Cells {
    /// Voxels along an edge.
    size: f64,
    /// Largest coordinate of a cell.
    last: u32,
}

impl Cells {
    /// Calls `found` with every cell that the triangle meets.
    fn visit(&self, corners: &[Vector3<f64>; 3], mut found: impl FnMut([u32; 3])) {
        let low = corners[0].inf(&corners[1]).inf(&corners[2]);
        let high = corners[0].sup(&corners[1]).sup(&corners[2]);
        let cell = |at: f64| ((at / self.size).floor().max(0.0) as u32).min(self.last);
        let from = std::array::from_fn(|a| cell(low[a] - TOUCH));
        let to = std::array::from_fn(|a| cell(high[a] + TOUCH));
        if from == to {
            found(from);
        } else {
            self.divide(corners, from, to, &mut found);
        }
    }

    /// Halves a block of cells `from ..= to` until what the triangle misses is cut off.
    fn divide(
        &self,
        corners: &[Vector3<f64>; 3],
        from: [u32; 3],
        to: [u32; 3],
        found: &mut impl FnMut([u32; 3]),
    ) {
        let lo = Vector3::from(from.map(f64::from)) * self.size;
        let hi = Vector3::from(to.map(|c| f64::from(c + 1))) * self.size;
        if !triangle_meets_box(corners, lo, hi) {
            return;
        }
        let axis = (0..3).max_by_key(|&a| (to[a] - from[a], 2 - a)).expect("three axes");
        if from == to {
            found(from);
            return;
        }
        let middle = u32::midpoint(from[axis], to[axis]);
        let (mut below, mut above) = (to, from);
        below[axis] = middle;
        above[axis] = middle + 1;
        self.divide(corners, from, below, found);
        self.divide(corners, above, to, found);
    }
}
