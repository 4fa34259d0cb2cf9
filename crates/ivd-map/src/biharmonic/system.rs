//! The equations of the nodes: the Hessian energy and the vertices' pulls.

use std::collections::BTreeMap;

use ivd_core::{Error, Exec, Grid};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::super::region::Region;
use super::energy::{MIDDLE, Room, Row, Rows};
use super::matrix::{Matrix, Triple};
use super::multigrid::{Hierarchy, Solution};
use super::nodes::{Cells, corner_of, weights};

/// `1/σ²`, in units of the energy's diagonal: what a vertex in the middle of a cell's corner weighs against that node's
/// stiffness. At 1 a bump as wide as two cells is left behind by 2 %, at 10 by 0.3 %; from 100 on only the cells' own
/// coarseness shows, and the iterations grow.
const PULL: f64 = 10.0;

/// A spring to rest at every node, in units of the energy's diagonal: so that what neither a vertex nor the border holds has
/// a solution.
const HOME: f64 = 1e-9;
/// The places where the field is to follow.
pub(super) struct Places {
    /// Vertices with a weight, sorted by cell: lowest node, trilinear weights times ω, and the vertex.
    pulls: Vec<Pull>,
    /// By cell the range in `pulls`.
    cells: BTreeMap<[i32; 3], std::ops::Range<usize>>,
}

struct Pull {
    cell: [i32; 3],
    weights: [f64; 8],
    vertex: u32,
}

impl Places {
    /// - `voxels`: voxel coordinates of the vertices.
    /// - `constrains`: whether each is to be followed.
    pub(super) fn new(
        cells: &Cells,
        grid: &Grid,
        region: &Region,
        voxels: &[Vector3<f64>],
        constrains: &[bool],
    ) -> Self {
        let linear = grid.linear_part();
        let mut pulls: Vec<Pull> = voxels
            .par_iter()
            .enumerate()
            .filter(|(vertex, _)| constrains[*vertex])
            .filter_map(|(vertex, voxel)| {
                let cut = region.weight(linear * voxel);
                let (cell, place) = cells.locate(*voxel);
                (cut > 0.0).then(|| Pull {
                    cell,
                    weights: weights(place).map(|w| w * cut),
                    vertex: vertex as u32,
                })
            })
            .collect();
        pulls.par_sort_by_key(|p| ([p.cell[2], p.cell[1], p.cell[0]], p.vertex));
        let mut cells = BTreeMap::new();
        let mut start = 0;
        for run in pulls.chunk_by(|p, q| p.cell == q.cell) {
            cells.insert(run[0].cell, start..start + run.len());
            start += run.len();
        }
        Self { pulls, cells }
    }
}

/// A matrix of the nodes, ready to be solved for any motion.
pub(super) struct System {
    pub(super) cells: Cells,
    places: Places,
    hierarchy: Hierarchy,
}

impl System {
    /// `tension`: see [`Rows::new`].
    pub(super) fn new(cells: Cells, grid: &Grid, places: Places, tension: f64) -> Self {
        let step = Vector3::from(cells.step).map(|s| s as f64);
        let rows = Rows::new(grid.linear_part() * Matrix3::from_diagonal(&step), tension);
        let spacing = std::array::from_fn(|a| grid.spacing()[a] * step[a]);
        let hierarchy = Hierarchy::new(assemble(&cells, &places, &rows), &cells.nodes, spacing);
        Self { cells, places, hierarchy }
    }

    /// The values of the nodes for which the vertices move by `motions` (mm), as far as their weights let them.
    ///
    /// - `enough`: whether values with such a residual, relative to the right-hand side, are enough.
    pub(super) fn solve(
        &self,
        motions: &[Vector3<f64>],
        start: Option<Vec<Triple>>,
        tolerance: f64,
        enough: impl FnMut(&[Triple], f64) -> bool,
        exec: &Exec,
    ) -> Result<Solution, Error> {
        let right = self.right_side(motions);
        let start = start.unwrap_or_else(|| vec![[0.0; 3]; right.len()]);
        self.hierarchy.solve(&right, start, tolerance, enough, exec)
    }

    fn right_side(&self, motions: &[Vector3<f64>]) -> Vec<Triple> {
        self.cells
            .nodes
            .free
            .all()
            .par_iter()
            .map(|node| {
                let mut sum = Vector3::zeros();
                for corner in 0..8 {
                    let cell = lower(*node, corner);
                    let Some(range) = self.places.cells.get(&cell) else { continue };
                    for pull in &self.places.pulls[range.clone()] {
                        sum += motions[pull.vertex as usize] * (PULL * pull.weights[corner]);
                    }
                }
                sum.into()
            })
            .collect()
    }

    #[cfg(test)]
    pub(super) fn matrix(&self) -> &Matrix {
        self.hierarchy.matrix()
    }
}

/// The cell of which a node is a given corner.
fn lower(node: [i32; 3], corner: usize) -> [i32; 3] {
    std::array::from_fn(|a| node[a] - (corner >> a & 1) as i32)
}

/// The energy's rows and the vertices' pulls.
fn assemble(cells: &Cells, places: &Places, rows: &Rows) -> Matrix {
    let (nodes, blocks) = (&cells.nodes, blocks(places));
    let all = nodes.free.all();
    let mut rooms: Vec<Room> = all.par_iter().map(|n| nodes.room(*n)).collect();
    rooms.sort_unstable();
    rooms.dedup();
    let kinds: BTreeMap<Room, Row> = rooms.into_par_iter().map(|r| (r, rows.row(r))).collect();
    Matrix::new(all.len(), all.len(), |i, give| {
        let node = all[i];
        let mut row = kinds[&nodes.room(node)];
        row[MIDDLE] += HOME;
        for corner in 0..8 {
            let cell = lower(node, corner);
            let Some(block) = blocks.get(&cell) else { continue };
            for other in 0..8 {
                let at = corner_of(cell, other);
                let slot = (0..3).rev().fold(0, |s, a| s * 5 + (at[a] - node[a] + 2));
                row[slot as usize] += block[corner][other];
            }
        }
        for (slot, value) in row.into_iter().enumerate().filter(|(_, v)| *v != 0.0) {
            let slot = slot as i32;
            let at = [node[0] + slot % 5 - 2, node[1] + slot / 5 % 5 - 2, node[2] + slot / 25 - 2];
            if let Some(column) = nodes.free.find(at) {
                give(column, value);
            }
        }
    })
}

/// By cell `Σ W Wᵀ / σ²` of its vertices.
fn blocks(places: &Places) -> BTreeMap<[i32; 3], [[f64; 8]; 8]> {
    let block = |range: &std::ops::Range<usize>| {
        let mut block = [[0.0; 8]; 8];
        for pull in &places.pulls[range.clone()] {
            for p in 0..8 {
                for q in 0..8 {
                    block[p][q] += PULL * pull.weights[p] * pull.weights[q];
                }
            }
        }
        block
    };
    places.cells.par_iter().map(|(cell, range)| (*cell, block(range))).collect()
}
