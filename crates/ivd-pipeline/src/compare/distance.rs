//! Distance of two lattices, both ways, by exact nearest points through the octree.

use ivd_core::{Exec, Lattice, VoxelCoord};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::Error;

/// Largest and mean distance (mm) of vertices and triangle centres from the other surface, and the larger of both
/// directions (a sampled Hausdorff distance: a lower bound of the true one).
pub(super) fn lattices(a: &Lattice, b: &Lattice, exec: &Exec) -> Result<Value, Error> {
    if a.triangles().is_empty() || b.triangles().is_empty() {
        return Err(Error::usage("compare", "an empty lattice has no distance from another"));
    }
    let (forth, back) = (one_way(a, b, exec)?, one_way(b, a, exec)?);
    Ok(json!({
        "unit": "mm",
        "a_to_b": { "max": forth.0, "mean": forth.1 },
        "b_to_a": { "max": back.0, "mean": back.1 },
        "hausdorff": forth.0.max(back.0),
        "mean": forth.1.max(back.1),
    }))
}

fn one_way(from: &Lattice, to: &Lattice, exec: &Exec) -> Result<(f64, f64), Error> {
    let octree =
        ivd_octree::build(to, &ivd_octree::Params::default(), exec).map_err(Error::in_stage("compare"))?;
    let index = ivd_octree::prepare(to, &octree).map_err(Error::in_stage("compare"))?;
    // Into the other lattice's local space: the same where both were cut from one grid.
    let (linear, shift) = (to.grid().linear_part(), to.grid().clone());
    let local = |voxel: Vector3<f64>| {
        if from.grid() == to.grid() {
            linear * voxel
        } else {
            linear * shift.voxel(from.grid().world(VoxelCoord(voxel))).0
        }
    };
    let vertices: Vec<Vector3<f64>> = (0..from.keys().len()).map(|i| from.voxel(i).0).collect();
    let centres =
        from.triangles().iter().map(|t| t.iter().map(|&v| vertices[v as usize]).sum::<Vector3<f64>>() / 3.0);
    let points: Vec<Vector3<f64>> = vertices.iter().copied().chain(centres).map(local).collect();
    let distances: Vec<f64> = points
        .par_iter()
        .map(|p| index.nearest(*p, f64::INFINITY).map_or(f64::INFINITY, |n| n.distance_mm))
        .collect();
    let max = distances.iter().copied().fold(0.0, f64::max);
    Ok((max, distances.iter().sum::<f64>() / distances.len() as f64))
}
