//! Cells over a grid: where Ω is, how fine, and what they are made of.

use ivd_core::{Error, Exec, Grid, VoxelCoord, VoxelIndex};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::material::{Lame, Matter};
use crate::mesh::Mesh;
use crate::tree::{Cell, Tree};

/// Longest edge of a cell, in finest cells.
const COARSEST: i32 = 8;
/// Bytes of a cell while the mesh is made, about: the nodes that its corners hang on, eight maps.
const CELL: u64 = 2048;

/// What space is made of.
pub trait Medium: Sync {
    /// What the voxel nearest to a voxel coordinate is made of; also beyond the grid.
    fn at(&self, voxel: Vector3<f64>) -> Lame;

    /// What kind of matter a voxel is of. Between different kinds cells are fine.
    fn kind(&self, voxel: VoxelIndex) -> Option<u16>;

    /// Whether there is more than one kind.
    fn has_kinds(&self) -> bool;
}

/// The finest cells over a grid: so many voxels along each axis, the first one before the first voxel. Places are counted in them.
#[derive(Debug, Clone)]
pub struct Cells {
    grid: Grid,
    /// Centres, relative to the grid's origin, and radii (mm) of the balls that Ω is the union of.
    balls: Vec<(Vector3<f64>, f64)>,
    step: [usize; 3],
    /// Finest cells along a root's edge.
    root: i32,
}

impl Cells {
    /// - `balls`: Ω: centres, relative to the grid's origin, and radii (mm).
    /// - `edge`: of the finest cells, in voxels: 1, 2 or 4; without it as [`Grid::cell_steps`] chooses for the smallest ball.
    /// - `longest`: of any cell (mm), about.
    pub fn new(grid: &Grid, balls: Vec<(Vector3<f64>, f64)>, edge: Option<u8>, longest: f64) -> Self {
        let least = balls.iter().map(|b| b.1).fold(f64::INFINITY, f64::min);
        let step = grid.cell_steps(edge, least);
        let mut cells = Self { grid: grid.clone(), balls, step, root: 1 };
        while cells.root < COARSEST && 2.0 * f64::from(cells.root) * cells.length() <= longest {
            cells.root *= 2;
        }
        cells
    }

    /// Longest edge of a finest cell (mm).
    pub fn length(&self) -> f64 {
        (0..3).map(|a| self.grid.spacing()[a] * self.step[a] as f64).fold(0.0, f64::max)
    }

    /// A voxel coordinate in finest cells.
    pub fn place(&self, voxel: Vector3<f64>) -> [f64; 3] {
        std::array::from_fn(|a| voxel[a] / self.step[a] as f64 + 1.0)
    }

    /// Voxel coordinate of a place in finest cells.
    pub fn voxel(&self, place: [f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|a, _| (place[a] - 1.0) * self.step[a] as f64)
    }

    /// Where a place in finest cells lies (mm), relative to the grid's origin.
    pub fn local(&self, place: [f64; 3]) -> Vector3<f64> {
        self.grid.linear_part() * self.voxel(place)
    }

    /// The bricks of the grid's voxels that Ω may meet, ascending.
    pub fn bricks(&self) -> Vec<usize> {
        self.grid.bricks_of_balls(self.balls.iter().copied())
    }

    /// Edges of a finest cell (mm), as columns.
    pub fn edges(&self) -> Matrix3<f64> {
        self.grid.linear_part() * Matrix3::from_diagonal(&Vector3::from(self.step).map(|s| s as f64))
    }

    /// Whether a point (mm, relative to the grid's origin) lies in Ω.
    pub fn holds(&self, point: Vector3<f64>) -> bool {
        self.balls.iter().any(|(centre, radius)| (point - centre).norm_squared() < radius * radius)
    }

    /// The cells wholly in Ω, finest round places (voxel coordinates) in it and at borders of the medium.
    ///
    /// # Errors
    /// The memory limit; cancellation.
    pub fn mesh(&self, fine: &[Vector3<f64>], medium: &impl Medium, exec: &Exec) -> Result<Mesh, Error> {
        let linear = self.grid.linear_part();
        let mut near: Vec<[i32; 3]> = fine
            .iter()
            .filter(|v| self.holds(linear * *v))
            .map(|v| self.place(*v).map(|c| c.floor() as i32))
            .collect();
        if medium.has_kinds() {
            near.extend(self.borders(medium));
        }
        near.sort_unstable();
        near.dedup();
        let tree = self.tree(&near, exec)?;
        exec.check_cancelled()?;
        exec.check_memory("the cells of elastic matter", CELL * tree.len() as u64)?;
        Ok(Mesh::new(tree, |cell| {
            let corners: [Vector3<f64>; 8] =
                std::array::from_fn(|c| self.local(cell.corner(c).map(f64::from)));
            self.balls.iter().any(|(centre, radius)| corners.iter().all(|x| (x - centre).norm() <= *radius))
        }))
    }

    /// What the cells of a mesh are made of.
    pub fn matter(&self, mesh: &Mesh, medium: &impl Medium) -> Vec<Matter> {
        mesh.cells.par_iter().map(|cell| self.matter_of(cell, medium)).collect()
    }

    /// Leaves where Ω may be, finest round `near` (finest cells).
    fn tree(&self, near: &[[i32; 3]], exec: &Exec) -> Result<Tree, Error> {
        let dims = self.grid.dims();
        let roots = std::array::from_fn(|a| {
            ((dims[a].div_ceil(self.step[a]) + 1) as i32 + self.root - 1) / self.root
        });
        let mut tree = Tree::new(roots, self.root, |cell| {
            let corner = |c| self.local(cell.corner(c).map(f64::from));
            let middle = (corner(0) + corner(7)) / 2.0;
            let half = (0..8).map(|c| (corner(c) - middle).norm()).fold(0.0, f64::max);
            self.balls.iter().any(|(centre, radius)| (middle - centre).norm() <= radius + half)
        });
        for (i, cell) in near.iter().enumerate() {
            if i % 4096 == 0 {
                exec.check_cancelled()?;
            }
            for side in 0..27 {
                let step = [side % 3 - 1, side / 3 % 3 - 1, side / 9 - 1];
                tree.refine(std::array::from_fn(|a| cell[a] + step[a]), 1);
            }
        }
        tree.balance();
        Ok(tree)
    }

    /// The finest cells on either side of a border between kinds, in Ω.
    fn borders(&self, medium: &impl Medium) -> Vec<[i32; 3]> {
        let (dims, linear) = (self.grid.dims(), self.grid.linear_part());
        let cell = |v: VoxelIndex| self.place(VoxelCoord::from(v).0).map(|c| c.floor() as i32);
        let within = |v: VoxelIndex| self.holds(linear * VoxelCoord::from(v).0);
        let of_row = |row: usize| {
            let (y, z) = (row % dims[1], row / dims[1]);
            let mut found = Vec::new();
            for x in self.span(y, z) {
                let voxel = VoxelIndex([x, y, z]);
                let kind = medium.kind(voxel);
                for axis in 0..3 {
                    let mut next = voxel;
                    next.0[axis] += 1;
                    if next.0[axis] < dims[axis] && medium.kind(next) != kind && within(voxel) {
                        found.extend([cell(voxel), cell(next)]);
                    }
                }
            }
            found.dedup();
            found
        };
        (0..dims[1] * dims[2]).into_par_iter().flat_map_iter(of_row).collect()
    }

    /// The voxels of a row along x that Ω may meet.
    fn span(&self, y: usize, z: usize) -> std::ops::Range<usize> {
        let nx = self.grid.dims()[0];
        let to_voxel = self.grid.inverse_linear_part();
        let (mut low, mut high) = (nx, 0);
        for (centre, radius) in &self.balls {
            let at = to_voxel * centre;
            let extent = self.grid.ball_extent(*radius);
            if (at.y - y as f64).abs() <= extent[1] && (at.z - z as f64).abs() <= extent[2] {
                low = low.min((at.x - extent[0]).floor().clamp(0.0, nx as f64) as usize);
                high = high.max((at.x + extent[0] + 1.0).ceil().clamp(0.0, nx as f64) as usize);
            }
        }
        low..high.max(low)
    }

    /// What a cell is made of at its Gauss points, each the mean over its octant.
    fn matter_of(&self, cell: &Cell, medium: &impl Medium) -> Matter {
        let many: [usize; 3] =
            std::array::from_fn(|a| (cell.size as usize * self.step[a]).div_ceil(2).clamp(1, 4));
        std::array::from_fn(|octant| {
            Lame::mean((0..many.iter().product::<usize>()).map(|i| {
                let part = [i % many[0], i / many[0] % many[1], i / many[0] / many[1]];
                let place = std::array::from_fn(|a| {
                    let inner = (part[a] as f64 + 0.5) / many[a] as f64 + (octant >> a & 1) as f64;
                    f64::from(cell.low[a]) + f64::from(cell.size) * 0.5 * inner
                });
                medium.at(self.voxel(place))
            }))
        })
    }
}
