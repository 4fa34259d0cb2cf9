use std::sync::Arc;

use ivd_core::{Displacement, Exec, Lattice, VoxelIndex};
use ivd_deform::map::{MapParams, octree};
use ivd_deform::spring::{RingParams, ring};
use ivd_lattice::refine::{RefineParams, Target, collapse};

use super::deform::handle;
use super::inputs::{ball, judged, root_mean_square};
use crate::experiment::{Experiment, Problem, Setting};

/// How coarse the lattice is that carries the voxels against what the whole one gives: solver and map on each level.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let whole = ball(size / 2, exec)?;
    let input = format!("a ball of 40 mm in {}³ voxels, pulled by 6 mm", size / 2);
    let mut lattices = Vec::new();
    for level in 0..=5_u8 {
        let params = RefineParams { target: Target::Level(level), ..RefineParams::default() };
        let lattice = if level == 0 { whole.clone() } else { collapse(&whole, &params, exec)?.lattice };
        lattices.push((level, Arc::new(lattice)));
    }
    let finest = Arc::new(mapped(&whole, exec)?.0);
    let settings = lattices.into_iter().map(|(level, lattice)| {
        let finest = finest.clone();
        let default = Target::Level(level) == Target::default();
        Setting::new([("refine.level", level.to_string())], default, move |exec| {
            let (found, voxels) = mapped(&lattice, exec)?;
            let (finest, triangles) = (finest.clone(), lattice.triangles.len() as f64);
            Ok(Box::new(move || {
                Ok(judged(
                    apart(&found, &finest),
                    [("triangles", triangles), ("voxels_moved", voxels as f64)],
                ))
            }))
        })
    });
    Ok(Experiment {
        stage: "map",
        input,
        truth: "the unrefined lattice",
        measure: "difference of the voxels' displacements where one moves, root mean square",
        unit: "mm",
        settings: settings.collect(),
    })
}

fn mapped(lattice: &Lattice, exec: &Exec) -> Result<(Displacement, u64), Problem> {
    let solved = ring(lattice, &[handle()], &[], &RingParams::default(), exec)?;
    let tree = ivd_octree::build(lattice, &ivd_octree::Params::default(), exec)?;
    let mapped = octree(lattice, &tree, &solved.motion, 0, &MapParams::default(), exec)?;
    Ok((mapped.displacement, mapped.voxels_moved))
}

fn apart(a: &Displacement, b: &Displacement) -> f64 {
    let [nx, ny, nz] = a.grid.dims();
    let places = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| VoxelIndex([x, y, z]))));
    let pairs = places.map(|at| (a.forward.at(at), b.forward.at(at)));
    root_mean_square(
        pairs
            .filter(|(a, b)| a.iter().chain(b).any(|&c| c != 0.0))
            .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum()),
    )
}
