//! Volumes and displacements that several tests share.

use ivd_core::{Displacement, FieldBricks, Grid, NO_BRICK, Scalar, Volume, VoxelIndex, Voxels, World};
use nalgebra::{Rotation3, Vector3};

/// Hills of 0…255 on an anisotropic, rotated grid whose sides are no multiple of a brick.
pub(crate) fn hills<T: Scalar>() -> Volume {
    let (s, c) = 0.3_f64.sin_cos();
    let direction = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]];
    let grid = Grid::new([45, 37, 29], [0.8, 1.0, 1.3], [-20.0, 30.0, 1e4], direction).unwrap();
    let hill = |at: [usize; 3], centre: [f64; 3], width: f64| {
        let square: f64 = (0..3).map(|a| (at[a] as f64 - centre[a]).powi(2)).sum();
        (-square / (2.0 * width * width)).exp()
    };
    let value = |i: usize| {
        let at = grid.index(i).0;
        255.0 * (hill(at, [14.0, 18.0, 14.0], 6.0) + 0.8 * hill(at, [32.0, 20.0, 12.0], 4.0)).min(1.0)
    };
    let values: Vec<T> = (0..grid.len()).map(|i| T::from_f64(value(i).floor())).collect();
    Volume::new(grid, T::wrap(values.into())).unwrap()
}

/// A displacement whose inverse is `inverse` at world positions [mm]; `None` makes the voxel's brick absent if all of it is.
pub(crate) fn displacement(
    grid: &Grid,
    inverse: impl Fn(Vector3<f64>) -> Option<Vector3<f64>>,
) -> Displacement {
    let dims = grid.dims();
    let bricks = dims.map(|n| n.div_ceil(8));
    let (mut table, mut vectors) = (Vec::new(), Vec::new());
    for b in 0..bricks.iter().product::<usize>() {
        let at = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
        let mut stored = false;
        let brick: Vec<[f32; 3]> = (0..512)
            .map(|i| [8 * at[0] + i % 8, 8 * at[1] + i / 8 % 8, 8 * at[2] + i / 64])
            .map(|v| {
                if (0..3).any(|a| v[a] >= dims[a]) {
                    return [0.0; 3];
                }
                let World(position) = grid.world(VoxelIndex(v).into());
                let moved = inverse(position);
                stored |= moved.is_some();
                moved.map_or([0.0; 3], |m| [m.x as f32, m.y as f32, m.z as f32])
            })
            .collect();
        if stored {
            table.push((vectors.len() / 512) as u32);
            vectors.extend(brick);
        } else {
            table.push(NO_BRICK);
        }
    }
    let inverse = FieldBricks::new(dims, table, vectors.into()).unwrap();
    Displacement::new(grid.clone(), FieldBricks::zero(dims), inverse).unwrap()
}

/// A twist about the body axis through the middle, falling to 0 at 12 mm from the middle.
pub(crate) fn twisted(grid: &Grid) -> Displacement {
    let [nx, ny, nz] = grid.dims().map(|n| 0.5 * (n - 1) as f64);
    let centre = grid.world(ivd_core::VoxelCoord(Vector3::new(nx, ny, nz))).0;
    displacement(grid, |position| {
        let from = position - centre;
        let near = 1.0 - from.norm_squared() / 144.0;
        (near > 0.0).then(|| Rotation3::from_axis_angle(&Vector3::z_axis(), 0.8 * near * near) * from - from)
    })
}

/// A volume of `f` at world positions [mm].
pub(crate) fn sampled(grid: &Grid, f: impl Fn(Vector3<f64>) -> f64) -> Volume {
    let values: Vec<f32> = (0..grid.len()).map(|i| f(grid.world(grid.index(i).into()).0) as f32).collect();
    Volume::new(grid.clone(), Voxels::from(values)).unwrap()
}
