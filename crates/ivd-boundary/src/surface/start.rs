//! What a surface starts from.

use ivd_core::{Exec, Grid, Labels, Mask, Volume, VoxelCoord, World, parallel};
use nalgebra::Vector3;

use super::params::{StartShape, SurfaceParams};
use crate::axes::{edges_along_axes, mean_edge};
use crate::part::bounds;
use crate::{ComponentParams, Error, component};

/// A set of points.
pub(super) enum Start {
    /// Within a radius of a point (mm).
    Ball([f64; 3], f64),
    /// Within a distance along each of the volume's axes (mm) of a point.
    Cube([f64; 3], f64),
    /// Between two corners, along the axes of space (mm).
    Box([f64; 3], [f64; 3]),
    /// The voxels of a mask on the volume's grid.
    Drawn(Mask),
}

/// Voxels (edges of a cube of their size) about a seed.
const ABOUT_SEED: f64 = 3.0;
/// Shortest sides of the volume about its middle.
const ABOUT_MIDDLE: f64 = 0.2;

impl Start {
    /// What is asked for.
    ///
    /// # Errors
    /// A seed outside the volume, a class that isn't there, a mask on another grid.
    pub(super) fn of(
        volume: &Volume,
        labels: Option<&Labels>,
        drawn: Option<&Mask>,
        params: &SurfaceParams,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let grid = volume.grid();
        if let Some(mask) = drawn {
            params.check_beside_drawn()?;
            grid.require(mask.grid(), "volume", "start")?;
            exec.check_memory("the start", grid.len() as u64)?;
            return Ok(Self::Drawn(mask.clone()));
        }
        if let (Some(from), Some(to)) = (params.box_from, params.box_to) {
            let [low, high] = [f64::min, f64::max].map(|f| std::array::from_fn(|a| f(from[a], to[a])));
            return Ok(Self::Box(low, high));
        }
        if let Some(class) = params.class {
            let chosen =
                ComponentParams { class: Some(class), seed: params.seed, ..ComponentParams::default() };
            return Ok(Self::Drawn(component(volume, labels, &chosen, exec)?.mask));
        }
        let middle = grid.world(VoxelCoord(Vector3::from(grid.dims().map(|n| (n as f64 - 1.0) / 2.0)))).0;
        let radius = params.radius.unwrap_or_else(|| match params.seed {
            Some(_) => ABOUT_SEED * mean_edge(grid.dims(), grid.spacing()),
            None => ABOUT_MIDDLE * shortest_side(grid),
        });
        let centre = match params.seed {
            Some(seed) => {
                crate::component::seed_voxel(volume, seed)?;
                seed
            }
            None => middle.into(),
        };
        Ok(match params.start {
            Some(StartShape::Cube) => Self::Cube(centre, radius),
            _ => Self::Ball(centre, radius),
        })
    }

    /// Tells which voxels of the grid lie in it, at a resolution: by the middle of each coarse voxel. A start that misses all of them has
    /// the one at its own middle.
    pub(super) fn voxels<'a>(
        &'a self,
        grid: &'a Grid,
        factor: [usize; 3],
    ) -> impl Fn([usize; 3]) -> bool + Sync + 'a {
        let middle = move |voxel: [usize; 3]| -> [f64; 3] {
            std::array::from_fn(|a| ((voxel[a] * factor[a]) as f64) + (factor[a] as f64 - 1.0) / 2.0)
        };
        let single = self.centre().map(|centre| {
            let at = grid.voxel(World(Vector3::from(centre))).0;
            std::array::from_fn(|a| {
                (at[a].round().clamp(0.0, grid.dims()[a] as f64 - 1.0) as usize) / factor[a]
            })
        });
        let dims = grid.dims();
        let axes = grid.linear_part();
        move |voxel: [usize; 3]| {
            if single == Some(voxel) {
                return true;
            }
            let at = middle(voxel);
            match self {
                Self::Drawn(mask) => {
                    let near: [usize; 3] = std::array::from_fn(|a| (at[a].round() as usize).min(dims[a] - 1));
                    mask.inside()[near[0] + dims[0] * (near[1] + dims[1] * near[2])] != 0
                }
                Self::Ball(centre, radius) => {
                    let world = grid.world(VoxelCoord(Vector3::from(at))).0;
                    (world - Vector3::from(*centre)).norm() <= *radius
                }
                Self::Cube(centre, half) => {
                    let world = grid.world(VoxelCoord(Vector3::from(at))).0 - Vector3::from(*centre);
                    (0..3).all(|a| {
                        let axis = axes.column(a);
                        world.dot(&axis).abs() <= half * axis.norm()
                    })
                }
                Self::Box(low, high) => {
                    let world = grid.world(VoxelCoord(Vector3::from(at))).0;
                    (0..3).all(|a| low[a] <= world[a] && world[a] <= high[a])
                }
            }
        }
    }

    /// Lowest and one past the highest voxel that it can hold.
    pub(super) fn bounds(&self, grid: &Grid) -> [[usize; 3]; 2] {
        let dims = grid.dims();
        let corners: Vec<[f64; 3]> = match self {
            Self::Drawn(mask) => return bounds(mask.inside(), dims),
            Self::Ball(centre, radius) => around(*centre, [*radius; 3]),
            Self::Cube(centre, half) => around(*centre, [half * 3.0_f64.sqrt(); 3]),
            Self::Box(low, high) => {
                let half: [f64; 3] = std::array::from_fn(|a| (high[a] - low[a]) / 2.0);
                around(std::array::from_fn(|a| f64::midpoint(low[a], high[a])), half)
            }
        };
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in corners {
            let VoxelCoord(at) = grid.voxel(World(Vector3::from(corner)));
            for a in 0..3 {
                low[a] = low[a].min(at[a]);
                high[a] = high[a].max(at[a]);
            }
        }
        let clamped = |v: f64, a: usize| v.clamp(0.0, dims[a] as f64) as usize;
        // One voxel more: the one at the start's middle belongs to it even where its own middle doesn't.
        [
            std::array::from_fn(|a| clamped(low[a].floor() - 1.0, a)),
            std::array::from_fn(|a| clamped(high[a].ceil() + 2.0, a)),
        ]
    }

    /// Tells which voxels of the grid lie in it, at a resolution. Where the middles of coarse voxels miss more than half of it, such as of a
    /// start of one voxel's thickness, all that touch it.
    pub(super) fn at_resolution<'a>(
        &'a self,
        grid: &'a Grid,
        level_dims: [usize; 3],
        factor: [usize; 3],
    ) -> Box<dyn Fn([usize; 3]) -> bool + Sync + 'a> {
        let [low, high] = self.bounds(grid);
        let is_near = move |voxel: [usize; 3]| {
            (0..3).all(|a| low[a] / factor[a] <= voxel[a] && voxel[a] * factor[a] < high[a])
        };
        let by_middle = self.voxels(grid, factor);
        // A ball of two coarse voxels' radius holds as many of their middles as it is large.
        let coarse_edge = (0..3).map(|a| grid.spacing()[a] * factor[a] as f64).fold(0.0, f64::max);
        let is_thick = matches!(self, Self::Ball(_, radius) if *radius >= 2.0 * coarse_edge);
        if factor == [1; 3] || is_thick {
            return Box::new(move |voxel| is_near(voxel) && by_middle(voxel));
        }
        let coarse = |voxel: [usize; 3]| -> [usize; 3] { std::array::from_fn(|a| voxel[a] / factor[a]) };
        let linear = move |[x, y, z]: [usize; 3]| x + level_dims[0] * (y + level_dims[1] * z);
        // Of every coarse layer the voxels that the start touches, and how many finer ones it has there.
        let layer = level_dims[0] * level_dims[1];
        let layers = parallel::map(level_dims[2], &|z| {
            let (mut touched, mut count) = (vec![false; layer], 0_usize);
            let from = [low[0], low[1], low[2].max(z * factor[2])];
            let to = [high[0], high[1], high[2].min((z + 1) * factor[2])];
            self.each(grid, [from, to], |voxel| {
                let [x, y, _] = coarse(voxel);
                touched[x + level_dims[0] * y] = true;
                count += 1;
            });
            (touched, count)
        });
        let count: usize = layers.iter().map(|(_, count)| count).sum();
        let touched: Vec<bool> = layers.into_iter().flat_map(|(touched, _)| touched).collect();
        let each = factor.iter().product::<usize>();
        let held = (0..touched.len())
            .filter(|&i| {
                let [nx, ny, _] = level_dims;
                touched[i] && by_middle([i % nx, i / nx % ny, i / nx / ny])
            })
            .count();
        if 2 * held * each < count {
            return Box::new(move |voxel| touched[linear(voxel)]);
        }
        Box::new(move |voxel| is_near(voxel) && by_middle(voxel))
    }

    /// Hands on its voxels between two corners (the lowest, and one past the highest).
    pub(super) fn each(&self, grid: &Grid, [low, high]: [[usize; 3]; 2], mut of: impl FnMut([usize; 3])) {
        let holds = self.voxels(grid, [1; 3]);
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                (low[0]..high[0]).map(|x| [x, y, z]).filter(|&voxel| holds(voxel)).for_each(&mut of);
            }
        }
    }

    /// The point that a start stands about, which it holds.
    fn centre(&self) -> Option<[f64; 3]> {
        match self {
            Self::Ball(centre, _) | Self::Cube(centre, _) => Some(*centre),
            Self::Box(..) | Self::Drawn(_) => None,
        }
    }
}

/// Shortest side of the volume (mm), of the axes of more than one voxel.
fn shortest_side(grid: &Grid) -> f64 {
    let (edges, dims) = (grid.spacing(), grid.dims());
    edges_along_axes(dims, std::array::from_fn(|a| edges[a] * dims[a] as f64)).fold(f64::INFINITY, f64::min)
}

/// Corners of a box about a point.
fn around(centre: [f64; 3], half: [f64; 3]) -> Vec<[f64; 3]> {
    (0..8)
        .map(|corner| {
            std::array::from_fn(|a| centre[a] + if corner >> a & 1 == 1 { half[a] } else { -half[a] })
        })
        .collect()
}
