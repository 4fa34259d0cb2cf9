//! The octree from the bottom up: which leaf cells the surface meets, then the nodes above them, level by level.

mod cover;
mod morton;
mod overlap;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Lattice, OCTREE_MAX_DEPTH, Octree, OctreeNode, OctreeParts};
use rayon::prelude::*;

use crate::inside::Crossings;
use crate::{Error, Params};

/// Most nodes that a 30-bit payload names.
const MAX_NODES: u64 = 1 << 30;

/// Builds the octree of a closed lattice, as [`Octree`] describes it.
///
/// A node that no triangle meets is a leaf, inside or outside as its voxels are; a node that one meets is divided
/// until it is a leaf of [`Params::leaf_size`] voxels a side. The same lattice gives the same octree, for any number of
/// threads.
///
/// # Errors
/// [`ivd_core::Error::Param`] for a bad leaf size, [`Error::Open`] for a lattice that isn't closed, [`Error::TooLarge`] beyond 2³⁰
/// nodes, 2³² listed triangles or 2²¹ − 2 voxels along an axis; in [`Error::Core`] a lattice that breaks its own check,
/// and cancelling.
pub fn build(lattice: &Lattice, params: &Params, exec: &Exec) -> Result<Octree, Error> {
    const TASK: &str = "octree";
    params.check()?;
    exec.run(|| {
        exec.observer().begin(TASK, 3);
        let crossings = Crossings::find(lattice, exec)?;
        exec.observer().advance(TASK, 1);
        let longest = lattice.grid().dims().into_iter().max().expect("three axes") + 2;
        let leaf_bits = params.leaf_size.trailing_zeros();
        let depth = longest.next_power_of_two().trailing_zeros().max(leaf_bits) as u8;
        debug_assert!(depth <= OCTREE_MAX_DEPTH, "Crossings::find refuses longer axes");

        let pairs = cover::leaf_triangles(lattice, depth, leaf_bits);
        exec.check_cancelled()?;
        exec.observer().advance(TASK, 1);
        fits("listed triangles", pairs.len() as u64, u64::from(u32::MAX))?;
        fits("triangles", lattice.triangles().len() as u64, u64::from(u32::MAX))?;
        let (codes, leaf_start) = runs(&pairs);
        let nodes = nodes(lattice, &crossings, &codes, depth, leaf_bits, exec)?;
        exec.observer().advance(TASK, 1);
        exec.observer().end(TASK);
        Ok(Octree::new(OctreeParts {
            grid: lattice.grid().clone(),
            depth,
            nodes: nodes.into(),
            leaf_start: leaf_start.into(),
            leaf_triangles: pairs.par_iter().map(|pair| pair.1).collect::<Vec<_>>().into(),
            triangle_count: lattice.triangles().len() as u32,
            vertex_count: lattice.keys().len() as u32,
        })?)
    })
}

fn fits(what: &'static str, needed: u64, limit: u64) -> Result<(), Error> {
    if needed > limit { Err(Error::TooLarge { what, needed, limit }) } else { Ok(()) }
}

/// The leaf cells in the order of their codes, and where the run of each begins.
fn runs(pairs: &[(u64, u32)]) -> (Vec<u64>, Vec<u32>) {
    let (mut codes, mut starts) = (Vec::new(), Vec::new());
    for (i, pair) in pairs.iter().enumerate() {
        if codes.last() != Some(&pair.0) {
            codes.push(pair.0);
            starts.push(i as u32);
        }
    }
    starts.push(pairs.len() as u32);
    (codes, starts)
}

/// A node of the level under work: its code at that level, and the leaf cells below it as a range of the codes.
struct Pending {
    code: u64,
    cells: std::ops::Range<usize>,
}

/// The nodes, breadth first, each level in the order of its codes.
fn nodes(
    lattice: &Lattice,
    crossings: &Crossings,
    codes: &[u64],
    depth: u8,
    leaf_bits: u32,
    exec: &Exec,
) -> Result<Vec<u32>, Error> {
    let dims = lattice.grid().dims();
    let mut nodes = Vec::new();
    let mut level = vec![Pending { code: 0, cells: 0..codes.len() }];
    for below in (0..=u32::from(depth) - leaf_bits).rev() {
        exec.check_cancelled()?;
        let mut next = Vec::new();
        let first = nodes.len() + level.len();
        for node in &level {
            nodes.push(Octree::pack(if node.cells.is_empty() {
                homogeneous(crossings, dims, node.code, below + leaf_bits)
            } else if below == 0 {
                OctreeNode::Surface { slot: node.cells.start as u32 }
            } else {
                let first_child = (first + next.len()) as u32;
                next.extend((0..8).map(|octant| child(codes, node, octant, below - 1)));
                OctreeNode::Internal { first_child }
            }));
        }
        fits("nodes", (nodes.len() + next.len()) as u64, MAX_NODES)?;
        level = next;
    }
    Ok(nodes)
}

/// The child at an octant; its cells are those whose code begins with its own. `below` levels lie under the child.
fn child(codes: &[u64], node: &Pending, octant: u64, below: u32) -> Pending {
    let code = node.code << 3 | octant;
    let cells = &codes[node.cells.clone()];
    let from = cells.partition_point(|&c| c >> (3 * below) < code);
    let to = cells.partition_point(|&c| c >> (3 * below) <= code);
    Pending { code, cells: node.cells.start + from..node.cells.start + to }
}

/// The leaf for a node that no triangle meets: its first voxel speaks for all. Voxels of the border layer are outside.
fn homogeneous(crossings: &Crossings, dims: [usize; 3], code: u64, bits: u32) -> OctreeNode {
    let padded = morton::decode(code).map(|c| (c as usize) << bits);
    let in_grid = (0..3).all(|a| (1..=dims[a]).contains(&padded[a]));
    if in_grid && crossings.contains(padded.map(|p| p - 1)) {
        OctreeNode::Inside
    } else {
        OctreeNode::Outside
    }
}
