//! A part that moves alone, in a layer of its own.

use ivd_core::{FieldBricks, Mask};
use ivd_field::sampler::{brick_at, brick_voxels};
use rayon::prelude::*;

use crate::Error;

/// Layer round a part that moves alone in which its motion continues (voxels): one for the corners of the cells at its
/// surface, one so that repair doesn't reach the layer's end.
const LAYER: usize = 2;

/// The field of a part that moves alone: 0 beyond a layer round it.
pub(super) fn cut(field: FieldBricks, alone: Option<&Mask>) -> Result<FieldBricks, Error> {
    let Some(inside) = alone else { return Ok(field) };
    let dims = field.dims();
    let near = |voxel: [usize; 3]| {
        let range = |a: usize| voxel[a].saturating_sub(LAYER)..(voxel[a] + LAYER + 1).min(dims[a]);
        range(2).any(|z| {
            range(1).any(|y| {
                let row = dims[0] * (y + dims[1] * z);
                inside.inside()[row + range(0).start..row + range(0).end].iter().any(|i| *i != 0)
            })
        })
    };
    let stored: Vec<usize> = (0..field.table().len()).filter(|&b| field.brick(b).is_some()).collect();
    let bricks: Vec<Box<[[f32; 3]]>> = stored
        .par_iter()
        .map(|&brick| {
            let mut out: Box<[[f32; 3]]> = field.brick(brick).expect("the brick is stored").into();
            for (slot, voxel) in brick_voxels(dims, brick_at(field.brick_dims(), brick)) {
                if out[slot] != [0.0; 3] && !near(voxel.0) {
                    out[slot] = [0.0; 3];
                }
            }
            out
        })
        .collect();
    Ok(FieldBricks::new(dims, field.table().to_vec(), bricks.concat().into())?)
}
