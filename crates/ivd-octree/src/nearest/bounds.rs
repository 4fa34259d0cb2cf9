//! From the octree to the tree of boxes.

use ivd_core::{Lattice, Octree, OctreeNode};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::blocks::{Block, Bounds, Lane, Tree};
use crate::Error;

/// Outward slack of a box, as a fraction of the largest coordinate of the lattice: a point beside the lattice loses half as
/// much when it is rounded to single precision.
const SLACK: f64 = 1.0 / (1 << 22) as f64;

/// Builds the boxes of each part of the triangles from the leaves up.
pub(super) fn trees<const N: usize>(
    octree: &Octree,
    lattice: &Lattice,
    positions: &[Vector3<f64>],
    frame: Matrix3<f64>,
    cell_axes: Matrix3<f64>,
    part: impl Fn(u32) -> Option<usize>,
) -> Result<[Tree; N], Error> {
    let listed = octree.leaf_triangles().len() as u64;
    if listed > Lane::LIMIT {
        return Err(Error::TooLarge { what: "listed triangles", needed: listed, limit: Lane::LIMIT });
    }
    let framed: Vec<Vector3<f64>> = positions.par_iter().map(|p| frame * p).collect();
    let slack = SLACK * framed.iter().map(Vector3::amax).fold(0.0, f64::max);
    let mut builder = Builder {
        octree,
        lattice,
        framed,
        cell_axes,
        slack,
        part,
        blocks: std::array::from_fn(|_| Vec::new()),
    };
    let roots = builder.node(0, [0; 3], octree.depth());
    let mut blocks = builder.blocks.into_iter();
    Ok(roots.map(|(_, root)| Tree { blocks: blocks.next().expect("as many as roots"), root }))
}

/// What a node holds of a part.
type Item = (Bounds, Lane);

struct Builder<'a, F, const N: usize> {
    octree: &'a Octree,
    lattice: &'a Lattice,
    /// Vertices in the frame of the boxes (mm).
    framed: Vec<Vector3<f64>>,
    /// Columns: a voxel's edges in that frame (mm).
    cell_axes: Matrix3<f64>,
    slack: f64,
    /// Which part a triangle belongs to; none of those that aren't looked for.
    part: F,
    blocks: [Vec<Block>; N],
}

impl<F: Fn(u32) -> Option<usize>, const N: usize> Builder<'_, F, N> {
    /// Box and lane of each part in a node of 2^`bits` voxels a side whose first padded voxel is `at`.
    fn node(&mut self, index: u32, at: [u64; 3], bits: u8) -> [Item; N] {
        let mut items: [Vec<Item>; N] = std::array::from_fn(|_| Vec::new());
        match self.octree.node(index) {
            OctreeNode::Outside | OctreeNode::Inside => {}
            OctreeNode::Surface { slot } => self.leaf(slot, at, bits, &mut items),
            OctreeNode::Internal { first_child } => {
                for octant in 0..8 {
                    let corner = std::array::from_fn(|a| at[a] + ((octant as u64 >> a & 1) << (bits - 1)));
                    let found = self.node(first_child + octant, corner, bits - 1);
                    for (items, item) in items.iter_mut().zip(found) {
                        items.extend((item.1 != Lane::NOTHING).then_some(item));
                    }
                }
            }
        }
        let mut blocks = self.blocks.iter_mut();
        items.map(|items| pack(items, blocks.next().expect("one list a part")))
    }

    /// Triangles of a leaf, each with the box of what its cell may hold of it.
    fn leaf(&self, slot: u32, at: [u64; 3], bits: u8, items: &mut [Vec<Item>; N]) {
        let cell = self.cell(at, bits);
        for &triangle in self.octree.leaf(slot) {
            let Some(part) = (self.part)(triangle) else { continue };
            let corners = self.lattice.triangles()[triangle as usize].map(|v| self.framed[v as usize]);
            let lo = corners[0].inf(&corners[1]).inf(&corners[2]).sup(&cell.0);
            let hi = corners[0].sup(&corners[1]).sup(&corners[2]).inf(&cell.1);
            items[part].push((self.outward(lo, hi), Lane::triangle(triangle)));
        }
    }

    /// The box round a cell (mm); wider than it where the grid is sheared.
    fn cell(&self, at: [u64; 3], bits: u8) -> (Vector3<f64>, Vector3<f64>) {
        // The tree's box of padded voxels p … p + n spans the voxel coordinates p − 1.5 … p + n − 1.5.
        let corner = Vector3::from(at.map(|p| p as f64 - 1.5));
        let edge = (1_u64 << bits) as f64;
        let first = self.cell_axes * corner;
        let (mut lo, mut hi) = (first, first);
        for axis in self.cell_axes.column_iter() {
            let reach = axis * edge;
            lo += reach.map(|c| c.min(0.0));
            hi += reach.map(|c| c.max(0.0));
        }
        (lo, hi)
    }

    fn outward(&self, lo: Vector3<f64>, hi: Vector3<f64>) -> Bounds {
        Bounds {
            lo: lo.map(|c| ((c - self.slack) as f32).next_down()).into(),
            hi: hi.map(|c| ((c + self.slack) as f32).next_up()).into(),
        }
    }
}

/// One lane over all items: blocks of eight, and blocks over them until one is left.
fn pack(mut items: Vec<Item>, blocks: &mut Vec<Block>) -> Item {
    while items.len() > 1 {
        let mut packed = Vec::with_capacity(items.len().div_ceil(Block::LANES));
        for group in items.chunks(Block::LANES) {
            let bounds = group.iter().fold(Bounds::NOTHING, |all, item| all.union(item.0));
            packed.push((bounds, Lane::block(blocks.len() as u32)));
            blocks.push(Block::new(group));
        }
        items = packed;
    }
    items.first().copied().unwrap_or((Bounds::NOTHING, Lane::NOTHING))
}
