use std::sync::Arc;

use ivd_core::{Displacement, FieldBricks, Grid, Volume, VoxelCoord, VoxelIndex};
use ivd_field::warp::{WarpParams, volume};
use nalgebra::Vector3;

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::{EDGE_MM, grid, judged, root_mean_square, sampled, sizes_up_to};

/// The voxel's size against the deformed density's distance from `f(ψ(y))`. Linear warping has no knob of its own.
pub(super) fn experiment(size: usize) -> Result<Experiment, Problem> {
    let settings: Result<Vec<Setting>, Problem> = sizes_up_to(size)
        .map(|n| {
            let grid = grid(n)?;
            let input = Arc::new(sampled(&grid, density)?);
            let field = Arc::new(swirl(&grid)?);
            let voxel = format!("{:.3} mm", EDGE_MM / n as f64);
            Ok(Setting::new([("voxel", voxel)], false, move |exec| {
                let found = volume(&input, &field, &WarpParams::default(), exec)?;
                Ok(Box::new(move || {
                    let resampled = found.voxels_resampled as f64;
                    Ok(judged(difference(&found.output), [("voxels_resampled", resampled)]))
                }))
            }))
        })
        .collect();
    Ok(Experiment {
        stage: "warp",
        input: format!("a swirled density in a cube of 128 mm, f32, up to {size}³ voxels"),
        truth: "the density behind the inverse map",
        measure: "difference of the values, root mean square",
        unit: "of 1",
        counted: None,
        voxel_mm: None,
        work: ("voxels", (size * size * size) as f64),
        settings: settings?,
    })
}

/// Waves under a bell.
fn density(p: Vector3<f64>) -> f64 {
    let waves = (p.x / 9.0).sin() * (p.y / 11.0).cos() * (p.z / 8.0).cos();
    (0.5 + 0.5 * waves) * (-p.norm_squared() / (2.0 * 30.0 * 30.0)).exp()
}

/// From deformed to rest (mm): a swirl about z that dies away towards the sides.
fn shift(p: Vector3<f64>) -> Vector3<f64> {
    let angle = 0.3 * (-p.norm_squared() / (2.0 * 25.0 * 25.0)).exp();
    let (sin, cos) = angle.sin_cos();
    Vector3::new(cos * p.x - sin * p.y - p.x, sin * p.x + cos * p.y - p.y, 0.0)
}

fn place(grid: &Grid, voxel: [usize; 3]) -> Vector3<f64> {
    grid.world(VoxelCoord::from(VoxelIndex(voxel))).0
}

/// The swirl as a displacement; its forward direction isn't needed to warp.
fn swirl(grid: &Grid) -> Result<Displacement, Problem> {
    let dims = grid.dims();
    let bricks = dims.map(|n| n.div_ceil(FieldBricks::SIDE));
    let count: usize = bricks.iter().product();
    let side = FieldBricks::SIDE;
    let mut vectors = Vec::with_capacity(count * FieldBricks::VOXELS);
    for b in 0..count {
        let first = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]].map(|c| c * side);
        for v in 0..FieldBricks::VOXELS {
            let voxel = [first[0] + v % side, first[1] + v / side % side, first[2] + v / side / side];
            let inside = (0..3).all(|a| voxel[a] < dims[a]);
            let vector = if inside { shift(place(grid, voxel)) } else { Vector3::zeros() };
            vectors.push([vector.x as f32, vector.y as f32, vector.z as f32]);
        }
    }
    let inverse = FieldBricks::new(dims, (0..count as u32).collect(), vectors.into())?;
    Ok(Displacement::new(grid.clone(), FieldBricks::zero(dims), inverse)?)
}

/// Difference from the truth at the voxels (of 1), root mean square, a tenth of the cube away from its sides.
fn difference(found: &Volume) -> f64 {
    let grid = found.grid();
    let within = |p: &Vector3<f64>| p.amax() < 0.4 * EDGE_MM;
    let places = (0..grid.len()).map(|i| grid.index(i)).map(|at| (at, place(grid, at.0)));
    root_mean_square(
        places.filter(|(_, p)| within(p)).map(|(at, p)| (found.value(at) - density(p + shift(p))).powi(2)),
    )
}
