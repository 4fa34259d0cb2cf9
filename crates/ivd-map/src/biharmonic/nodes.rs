//! Nodes of the coarse cells in Ω.

use ivd_core::{FieldBricks, Grid, VoxelCoord};
use ivd_field::sampler::{Corners, interpolate};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::super::region::Region;
use super::energy::Room;
use super::matrix::{Matrix, Triple};

/// Nodes along the edge of a block of the index.
const SIDE: usize = 8;
const ABSENT: u32 = u32::MAX;

/// Numbers of nodes by their coordinate: a table of blocks of 8³, of which those with a node are stored.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Index {
    low: [i32; 3],
    blocks: [usize; 3],
    table: Vec<u32>,
    slots: Vec<u32>,
    nodes: Vec<[i32; 3]>,
}

impl Index {
    /// An index of nodes, each given once.
    pub(super) fn new(nodes: Vec<[i32; 3]>) -> Self {
        let most = |f: fn(i32, i32) -> i32, start: i32| {
            nodes.iter().fold([start; 3], |m, n| std::array::from_fn(|a| f(m[a], n[a])))
        };
        let (low, high) = (most(i32::min, i32::MAX), most(i32::max, i32::MIN));
        if nodes.is_empty() {
            return Self { low: [0; 3], blocks: [0; 3], table: vec![], slots: vec![], nodes };
        }
        let blocks: [usize; 3] = std::array::from_fn(|a| (high[a] - low[a]) as usize / SIDE + 1);
        let mut index =
            Self { low, blocks, table: vec![ABSENT; blocks.iter().product()], slots: vec![], nodes: vec![] };
        for (i, node) in nodes.iter().enumerate() {
            let (block, slot) = index.place(*node).expect("between the lowest and the highest node");
            if index.table[block] == ABSENT {
                index.table[block] = (index.slots.len() / SIDE.pow(3)) as u32;
                index.slots.resize(index.slots.len() + SIDE.pow(3), ABSENT);
            }
            index.slots[index.table[block] as usize * SIDE.pow(3) + slot] = i as u32;
        }
        index.nodes = nodes;
        index
    }

    fn place(&self, node: [i32; 3]) -> Option<(usize, usize)> {
        let (mut block, mut slot) = (0, 0);
        for a in (0..3).rev() {
            let at = usize::try_from(node[a] - self.low[a]).ok()?;
            if at / SIDE >= self.blocks[a] {
                return None;
            }
            block = block * self.blocks[a] + at / SIDE;
            slot = slot * SIDE + at % SIDE;
        }
        Some((block, slot))
    }

    /// The number of a node.
    #[inline]
    pub(super) fn find(&self, node: [i32; 3]) -> Option<usize> {
        let (block, slot) = self.place(node)?;
        let block = self.table[block];
        if block == ABSENT {
            return None;
        }
        let found = self.slots[block as usize * SIDE.pow(3) + slot];
        (found != ABSENT).then_some(found as usize)
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Coordinates by number.
    pub(super) fn all(&self) -> &[[i32; 3]] {
        &self.nodes
    }
}

/// The nodes of a level: those that are free to move, and the lowest and highest that there are. What lies between and isn't
/// free is held at 0.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Level {
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
    pub(super) free: Index,
}

impl Level {
    /// The level of every second node along the halved axes.
    pub(super) fn coarser(&self, halved: [bool; 3]) -> Self {
        let even = |c: &&[i32; 3]| (0..3).all(|a| !halved[a] || c[a] & 1 == 0);
        let half =
            |c: &[i32; 3], up: i32| std::array::from_fn(|a| if halved[a] { (c[a] + up) >> 1 } else { c[a] });
        let free = Index::new(self.free.all().iter().filter(even).map(|c| half(c, 0)).collect());
        Self { low: half(&self.low, 1), high: half(&self.high, 0), free }
    }

    /// Linear interpolation from a coarser level; what isn't free is 0.
    pub(super) fn interpolation(&self, coarse: &Self, halved: [bool; 3]) -> Matrix {
        Matrix::new(self.free.len(), coarse.free.len(), |i, give| {
            let at = self.free.all()[i];
            for corner in 0..8 {
                let mut weight = 1.0;
                let c: [i32; 3] = std::array::from_fn(|a| {
                    let upper = corner >> a & 1;
                    if halved[a] && at[a] & 1 == 1 {
                        weight *= 0.5;
                        return (at[a] >> 1) + upper;
                    }
                    weight *= f64::from(1 - upper);
                    if halved[a] { at[a] >> 1 } else { at[a] }
                });
                if weight > 0.0
                    && let Some(c) = coarse.free.find(c)
                {
                    give(c, weight);
                }
            }
        })
    }

    /// How far a node is from the lowest and the highest.
    pub(super) fn room(&self, node: [i32; 3]) -> Room {
        std::array::from_fn(|a| [node[a] - self.low[a], self.high[a] - node[a]].map(|d| d.min(2) as u8))
    }
}

/// Cells of `step` voxels along each axis: node `n` lies at the voxel `n · step`. The nodes within Ω are free, those beyond
/// it are held, and there are none more than a cell further than any voxel or vertex.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cells {
    pub(super) step: [usize; 3],
    pub(super) nodes: Level,
}

impl Cells {
    /// The cells of a region. `edge`: voxels along the longest edge of a cell, a power of two.
    pub(super) fn new(grid: &Grid, region: &Region, edge: Option<u8>) -> Self {
        let step = grid.cell_steps(edge, region.narrowest());
        // Vertices lie up to a voxel beyond the grid.
        let low = [-2; 3];
        let high = std::array::from_fn(|a| ((grid.dims()[a] + 1).div_ceil(step[a]) + 1) as i32);
        let mut cells = Self { step, nodes: Level { low, high, free: Index::new(vec![]) } };
        let linear = grid.linear_part();
        let blocks = cells.blocks(grid, region);
        let parts: Vec<Vec<[i32; 3]>> = blocks
            .par_iter()
            .map(|block| {
                let at = |i: usize| {
                    let inner = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
                    std::array::from_fn(|a| cells.nodes.low[a] + (block[a] * SIDE + inner[a]) as i32)
                };
                let moves = |n: &[i32; 3]| {
                    (0..3).all(|a| n[a] <= cells.nodes.high[a])
                        && region.weight(linear * cells.voxel(*n).0) > 0.0
                };
                (0..SIDE.pow(3)).map(at).filter(moves).collect()
            })
            .collect();
        cells.nodes.free = Index::new(parts.concat());
        cells
    }

    /// Blocks of 8³ nodes that Ω may meet, ascending, counted from the lowest node.
    fn blocks(&self, grid: &Grid, region: &Region) -> Vec<[usize; 3]> {
        let to_voxel = grid.inverse_linear_part();
        let many: [usize; 3] =
            std::array::from_fn(|a| (self.nodes.high[a] - self.nodes.low[a]) as usize / SIDE + 1);
        let mut hit = Vec::new();
        for (centre, radius) in region.balls() {
            let at = to_voxel * centre;
            let extent = grid.ball_extent(radius);
            let range: [std::ops::Range<usize>; 3] = std::array::from_fn(|a| {
                let block =
                    |x: f64| ((x / self.step[a] as f64 - f64::from(self.nodes.low[a])) / SIDE as f64).floor();
                let top = many[a] as f64;
                block(at[a] - extent[a]).clamp(0.0, top) as usize
                    ..(block(at[a] + extent[a]) + 1.0).clamp(0.0, top) as usize
            });
            for z in range[2].clone() {
                for y in range[1].clone() {
                    hit.extend(range[0].clone().map(|x| [z, y, x]));
                }
            }
        }
        hit.sort_unstable();
        hit.dedup();
        hit.into_iter().map(|[z, y, x]| [x, y, z]).collect()
    }

    /// Where a node lies.
    pub(super) fn voxel(&self, node: [i32; 3]) -> VoxelCoord {
        VoxelCoord(Vector3::from_fn(|a, _| f64::from(node[a]) * self.step[a] as f64))
    }

    /// Lowest node of the cell that holds a voxel coordinate, and the place in it, 0…1; beyond the outermost cell its border.
    pub(super) fn locate(&self, voxel: Vector3<f64>) -> ([i32; 3], [f64; 3]) {
        let mut place = [0.0; 3];
        let node = std::array::from_fn(|a| {
            let at = (voxel[a] / self.step[a] as f64)
                .clamp(f64::from(self.nodes.low[a]), f64::from(self.nodes.high[a]));
            let base = at.floor().min(f64::from(self.nodes.high[a] - 1));
            place[a] = at - base;
            base as i32
        });
        (node, place)
    }

    /// The values at the nodes, trilinear at the voxels of a brick, x fastest: what [`Cells::interpolate`] gives there. `first`: the brick's lowest voxel.
    pub(super) fn interpolate_brick(&self, values: &[Triple], first: [usize; 3]) -> Vec<Vector3<f64>> {
        let lowest: [i32; 3] = std::array::from_fn(|a| (first[a] / self.step[a]) as i32);
        let [nx, ny, nz] = self.step.map(|step| (FieldBricks::SIDE / step + 1) as i32);
        let at = |node: [i32; 3]| {
            self.nodes.free.find(node).map_or_else(Vector3::zeros, |i| Vector3::from(values[i]))
        };
        let node = |[x, y, z]: [i32; 3]| at([lowest[0] + x, lowest[1] + y, lowest[2] + z]);
        let of_nodes: Vec<_> =
            (0..nx * ny * nz).map(|i| node([i % nx, i / nx % ny, i / (nx * ny)])).collect();
        let along_x = spread(&of_nodes, 1, self.step[0]);
        let along_y = spread(&along_x, FieldBricks::SIDE, self.step[1]);
        spread(&along_y, FieldBricks::SIDE * FieldBricks::SIDE, self.step[2])
    }

    /// The values at the nodes, trilinear at a voxel coordinate. `near`: the cell of the last one asked for.
    pub(super) fn interpolate(
        &self,
        values: &[Triple],
        voxel: Vector3<f64>,
        near: &mut Near,
    ) -> Vector3<f64> {
        let (node, place) = self.locate(voxel);
        if near.cell != Some(node) {
            near.cell = Some(node);
            near.corners = std::array::from_fn(|corner| {
                let free = self.nodes.free.find(corner_of(node, corner));
                free.map_or_else(Vector3::zeros, |i| Vector3::from(values[i]))
            });
        }
        interpolate(&near.corners, place.into())
    }
}

/// Values at the nodes along an axis, linear at a brick's voxels along it.
///
/// - `inner`: values beside one another before the axis comes to its next node; `step`: voxels from node to node.
fn spread(values: &[Vector3<f64>], inner: usize, step: usize) -> Vec<Vector3<f64>> {
    const BRICK: usize = FieldBricks::SIDE;
    let nodes = BRICK / step + 1;
    let mut out = Vec::with_capacity(values.len() / nodes * BRICK);
    for row in values.chunks_exact(inner * nodes) {
        for at in 0..BRICK {
            let t = (at % step) as f64 / step as f64;
            let (low, high) = row[inner * (at / step)..].split_at(inner);
            out.extend(low.iter().zip(high).map(|(a, b)| a * (1.0 - t) + b * t));
        }
    }
    out
}

/// The cell that was read last, and the values at its corners.
#[derive(Default)]
pub(super) struct Near {
    cell: Option<[i32; 3]>,
    corners: Corners,
}

/// A corner of a cell: x in bit 0, y in bit 1, z in bit 2.
pub(super) fn corner_of(node: [i32; 3], corner: usize) -> [i32; 3] {
    std::array::from_fn(|a| node[a] + (corner >> a & 1) as i32)
}

/// Trilinear weights of a cell's corners.
pub(super) fn weights(place: [f64; 3]) -> [f64; 8] {
    std::array::from_fn(|corner| {
        (0..3).map(|a| if corner >> a & 1 == 1 { place[a] } else { 1.0 - place[a] }).product()
    })
}
