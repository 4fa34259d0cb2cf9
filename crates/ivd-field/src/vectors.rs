//! The vectors of a field: how large they may be, how they are sampled, and how long they are.

use ivd_core::{Exec, FieldBricks, VoxelIndex};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;
use crate::certificate::Histogram;
use crate::sampler::{brick_at, brick_voxels};

/// Largest motion that is mapped (mm): sums of a few such vectors still are finite in `f32`.
pub const FARTHEST: f64 = 1e37;

/// Vectors (mm) at the voxels of bricks, one brick after another; `at` may keep what it likes from voxel to voxel of a brick.
///
/// # Errors
/// Cancellation.
pub fn sampled<T: Default>(
    stage: &'static str,
    dims: [usize; 3],
    bricks: &[usize],
    exec: &Exec,
    at: impl Fn(VoxelIndex, &mut T) -> Vector3<f64> + Sync,
) -> Result<Vec<[f32; 3]>, Error> {
    let observer = exec.observer();
    observer.begin(stage, bricks.len() as u64);
    let mut vectors = vec![[0.0; 3]; FieldBricks::VOXELS * bricks.len()];
    let all = bricks.par_iter().zip(vectors.par_chunks_exact_mut(FieldBricks::VOXELS));
    let sampled = all.try_for_each(|(&brick, out)| {
        exec.check_cancelled()?;
        let mut kept = T::default();
        for (slot, voxel) in brick_voxels(dims, brick_at(dims.map(|n| n.div_ceil(8)), brick)) {
            out[slot] = at(voxel, &mut kept).map(|c| c as f32).into();
        }
        observer.advance(stage, 1);
        Ok(())
    });
    observer.end(stage);
    sampled.map(|()| vectors)
}

/// Number of vectors that aren't 0, and a histogram of their lengths.
pub fn lengths(field: &FieldBricks) -> (u64, Histogram) {
    let length = |v: &[f32; 3]| Vector3::from(*v).map(f64::from).norm();
    let most = field.vectors().iter().map(length).fold(0.0, f64::max);
    let mut histogram = Histogram::new(0.0, if most > 0.0 { most } else { 1.0 }, 40);
    let mut moved = 0;
    for v in field.vectors().iter().filter(|v| **v != [0.0; 3]) {
        moved += 1;
        histogram.add(length(v));
    }
    (moved, histogram)
}
