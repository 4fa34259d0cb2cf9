//! The body of a scene: cells round the lattice, what they are made of, and the vertices' pulls.

use ivd_core::{Error, Exec, Grid, Lattice, VoxelCoord, VoxelIndex};
use ivd_field::sampler::{brick_at, brick_voxels};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::super::biharmonic::steps;
use super::super::region::Region;
use super::material::{Hexahedron, Lame, Matter};
use super::materials::Materials;
use super::mesh::{Mesh, weights};
use super::system::{Body, Pull};
use super::tree::{Cell, Tree};

/// Stiffness of a cell's springs together, in units of the stiffest modulus in it, 1 at least, times its edge. Multipliers do
/// the rest; stiffer ones need fewer of these and more iterations.
const SPRING: f64 = 10.0;
/// Longest edge of a cell, in finest cells.
const COARSEST: i32 = 8;
/// Cells across the margin.
const ACROSS: f64 = 4.0;

/// The finest cells: `step` voxels along each axis, the first one before the first voxel.
pub(super) struct Cells {
    step: [usize; 3],
    /// Finest cells along a root's edge.
    root: i32,
}

impl Cells {
    pub(super) fn new(grid: &Grid, region: &Region, edge: Option<u8>) -> Self {
        let mut cells = Self { step: steps(grid, region, edge), root: 1 };
        while cells.root < COARSEST
            && 2.0 * f64::from(cells.root) * cells.length(grid) * ACROSS <= region.margin
        {
            cells.root *= 2;
        }
        cells
    }

    /// Longest edge of a finest cell (mm).
    pub(super) fn length(&self, grid: &Grid) -> f64 {
        (0..3).map(|a| grid.spacing()[a] * self.step[a] as f64).fold(0.0, f64::max)
    }

    /// A voxel coordinate in finest cells.
    pub(super) fn place(&self, voxel: Vector3<f64>) -> [f64; 3] {
        std::array::from_fn(|a| voxel[a] / self.step[a] as f64 + 1.0)
    }

    /// Voxel coordinate of a place in finest cells.
    fn voxel(&self, place: [f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|a, _| (place[a] - 1.0) * self.step[a] as f64)
    }

    /// Edges of a finest cell (mm), as columns.
    fn edges(&self, grid: &Grid) -> Matrix3<f64> {
        grid.linear_part() * Matrix3::from_diagonal(&Vector3::from(self.step).map(|s| s as f64))
    }

    /// Leaves where Ω may be, finest round `vertices` and borders.
    fn tree(&self, grid: &Grid, region: &Region, vertices: &[[i32; 3]], exec: &Exec) -> Result<Tree, Error> {
        let roots = std::array::from_fn(|a| {
            ((grid.dims()[a].div_ceil(self.step[a]) + 1) as i32 + self.root - 1) / self.root
        });
        let linear = grid.linear_part();
        let mut tree = Tree::new(roots, self.root, |cell| {
            let corner = |c| linear * self.voxel(cell.corner(c).map(f64::from));
            let middle = (corner(0) + corner(7)) / 2.0;
            let half = (0..8).map(|c| (corner(c) - middle).norm()).fold(0.0, f64::max);
            region.balls().any(|(centre, radius)| (middle - centre).norm() <= radius + half)
        });
        for (i, cell) in vertices.iter().enumerate() {
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

    /// The cells on either side of a border between materials by class, where Ω may be.
    fn borders(&self, grid: &Grid, region: &Region, materials: &Materials<'_>) -> Vec<[i32; 3]> {
        let (dims, linear) = (grid.dims(), grid.linear_part());
        let bricks = dims.map(|n| n.div_ceil(8));
        let cell = |v: VoxelIndex| self.place(VoxelCoord::from(v).0).map(|c| c.floor() as i32);
        let within = |v: VoxelIndex| region.weight(linear * VoxelCoord::from(v).0) > 0.0;
        let of = |brick: usize| {
            let mut found = Vec::new();
            for (_, voxel) in brick_voxels(dims, brick_at(bricks, brick)) {
                let class = materials.class(voxel);
                for axis in 0..3 {
                    let mut next = voxel;
                    next.0[axis] += 1;
                    if next.0[axis] < dims[axis] && materials.class(next) != class && within(voxel) {
                        found.extend([cell(voxel), cell(next)]);
                    }
                }
            }
            found
        };
        region.bricks(grid).into_par_iter().flat_map_iter(of).collect()
    }

    /// What a cell is made of at its Gauss points, each the mean over its octant.
    fn matter(&self, cell: &Cell, materials: &Materials<'_>) -> Matter {
        let many: [usize; 3] =
            std::array::from_fn(|a| (cell.size as usize * self.step[a]).div_ceil(2).clamp(1, 4));
        std::array::from_fn(|octant| {
            Lame::mean((0..many.iter().product::<usize>()).map(|i| {
                let part = [i % many[0], i / many[0] % many[1], i / many[0] / many[1]];
                let place = std::array::from_fn(|a| {
                    let inner = (part[a] as f64 + 0.5) / many[a] as f64 + (octant >> a & 1) as f64;
                    f64::from(cell.low[a]) + f64::from(cell.size) * 0.5 * inner
                });
                materials.at(self.voxel(place))
            }))
        })
    }
}

/// Bytes of a cell while the mesh is made, about: the nodes that its corners hang on, eight maps.
const CELL: u64 = 2048;

/// The body of a scene; the pulls' goals are 0 yet.
///
/// `constrains`: whether a vertex pulls.
pub(super) fn body(
    cells: &Cells,
    lattice: &Lattice,
    materials: &Materials<'_>,
    region: &Region,
    constrains: &(dyn Fn(usize) -> bool + Sync),
    exec: &Exec,
) -> Result<Body, Error> {
    let grid = lattice.grid();
    let places: Vec<[f64; 3]> = (0..lattice.keys().len()).map(|v| cells.place(lattice.voxel(v).0)).collect();
    let linear = grid.linear_part();
    let mut near: Vec<[i32; 3]> = places
        .iter()
        .filter(|p| region.weight(linear * cells.voxel(**p)) > 0.0)
        .map(|p| p.map(|c| c.floor() as i32))
        .collect();
    if materials.differ() {
        near.extend(cells.borders(grid, region, materials));
    }
    near.sort_unstable();
    near.dedup();
    let tree = cells.tree(grid, region, &near, exec)?;
    exec.check_cancelled()?;
    exec.check_memory("the cells of the map", CELL * tree.len() as u64)?;
    let mesh = Mesh::new(tree, |cell| {
        let corners: [Vector3<f64>; 8] =
            std::array::from_fn(|c| linear * cells.voxel(cell.corner(c).map(f64::from)));
        region.balls().any(|(centre, radius)| corners.iter().all(|x| (x - centre).norm() <= radius))
    });
    let matter: Vec<Matter> = mesh.cells.par_iter().map(|c| cells.matter(c, materials)).collect();
    let edges = cells.edges(grid);
    let mut pulls: Vec<Pull> = places
        .iter()
        .enumerate()
        .filter(|(vertex, _)| constrains(*vertex))
        .filter_map(|(vertex, place)| {
            let (cell, inner) = mesh.locate(*place)?;
            Some(Pull {
                cell: cell as u32,
                vertex: vertex as u32,
                weights: weights(inner),
                spring: 0.0,
                goal: Vector3::zeros(),
                multiplier: Vector3::zeros(),
            })
        })
        .collect();
    let mut many = vec![0_u32; mesh.cells.len()];
    for pull in &pulls {
        many[pull.cell as usize] += 1;
    }
    let edge = edges.determinant().abs().cbrt();
    for pull in &mut pulls {
        let cell = pull.cell as usize;
        let length = edge * f64::from(mesh.cells[cell].size);
        let stiffest = matter[cell].iter().map(|lame| materials.modulus(lame)).fold(1.0, f64::max);
        pull.spring = SPRING * stiffest * length / f64::from(many[cell]);
    }
    Ok(Body::new(mesh, Hexahedron::new(&edges), matter, pulls))
}
