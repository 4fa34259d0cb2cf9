use std::sync::Arc;

use ivd_core::Lattice;
use ivd_lattice::extract::{ExtractParams, Iso, extract};

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::{EDGE_MM, RADIUS_MM, grid, judged, root_mean_square, sampled, sizes_up_to};

/// The voxel's size against the surface's distance from the ball. Marching cubes has no knob of its own: its accuracy is the grid's.
pub(super) fn experiment(size: usize) -> Result<Experiment, Problem> {
    let settings: Result<Vec<Setting>, Problem> = sizes_up_to(size)
        .map(|n| {
            let volume = Arc::new(sampled(&grid(n)?, |p| RADIUS_MM - p.norm())?);
            let voxel = format!("{:.3} mm", EDGE_MM / n as f64);
            Ok(Setting::new([("voxel", voxel)], false, move |exec| {
                let found = extract(&volume, None, &ExtractParams { iso: Iso::Value(0.0) }, exec)?;
                Ok(Box::new(move || {
                    let bricks = found.bricks_active as f64;
                    let lattice = &found.lattice;
                    Ok(judged(
                        distance(lattice),
                        [("triangles", lattice.triangles().len() as f64), ("bricks", bricks)],
                    ))
                }))
            }))
        })
        .collect();
    Ok(Experiment {
        stage: "lattice",
        input: format!("a ball of 40 mm in a cube of 128 mm, f32, up to {size}³ voxels"),
        truth: "the ball",
        measure: "distance of the triangles' middles from the ball, root mean square",
        unit: "mm",
        counted: None,
        voxel_mm: Some(EDGE_MM / size as f64),
        work: ("voxels", (size * size * size) as f64),
        settings: settings?,
    })
}

/// Distance of the middles of triangles from the ball (mm), root mean square.
pub(super) fn distance(lattice: &Lattice) -> f64 {
    let positions = lattice.positions();
    root_mean_square(lattice.triangles().iter().map(|t| {
        let middle = t.iter().map(|&c| positions[c as usize]).sum::<nalgebra::Vector3<f64>>() / 3.0;
        (middle.norm() - RADIUS_MM).powi(2)
    }))
}
