//! The field between the nodes, and its values at the voxels.

use ivd_core::{Exec, FieldBricks, Grid, VoxelCoord};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::super::region::Region;
use super::affine::Affine;
use super::matrix::Triple;
use super::nodes::{Cells, Near};
use crate::Error;
use crate::sampler::{Sampler, brick_at, brick_voxels};

/// A continuous motion: the affine part in its share, and what the nodes say under the window.
pub(super) struct Field<'a> {
    pub(super) grid: &'a Grid,
    pub(super) region: &'a Region,
    pub(super) cells: &'a Cells,
    pub(super) affine: Option<&'a Affine>,
    /// Values of the free nodes (mm); empty where the affine part is all.
    pub(super) nodes: &'a [Triple],
}

impl Field<'_> {
    /// Motion (mm) at a voxel coordinate, exactly 0 beyond Ω.
    fn at(&self, voxel: Vector3<f64>, near: &mut Near) -> Vector3<f64> {
        let place = self.grid.linear_part() * voxel;
        let cut = self.region.weight(place);
        if cut == 0.0 {
            return Vector3::zeros();
        }
        let mut motion = self.affine.map_or_else(Vector3::zeros, |a| a.at(place, cut));
        if !self.nodes.is_empty() {
            motion += self.cells.interpolate(self.nodes, voxel, near) * cut;
        }
        motion
    }

    /// The motion at the voxels of bricks; after `before`, where that is given.
    pub(super) fn sample(
        &self,
        before: Option<&FieldBricks>,
        bricks: &[usize],
        exec: &Exec,
    ) -> Result<Vec<Box<[[f32; 3]]>>, Error> {
        let dims = self.grid.dims();
        let sampler = before.map(|b| Sampler::new(b, self.grid));
        let (linear, observer) = (self.grid.linear_part(), exec.observer());
        observer.begin("map", bricks.len() as u64);
        let out = bricks
            .par_iter()
            .map(|&brick| {
                exec.check_cancelled()?;
                let mut out = vec![[0.0_f32; 3]; FieldBricks::VOXELS].into_boxed_slice();
                let mut near = Near::default();
                for (slot, voxel) in brick_voxels(dims, brick_at(dims.map(|n| n.div_ceil(8)), brick)) {
                    let voxel = VoxelCoord::from(voxel).0;
                    let so_far = sampler.as_ref().map_or_else(Vector3::zeros, |s| s.at(voxel));
                    let motion = linear * so_far + self.at(voxel + so_far, &mut near);
                    out[slot] = motion.map(|c| c as f32).into();
                }
                observer.advance("map", 1);
                Ok(out)
            })
            .collect();
        observer.end("map");
        out
    }
}
