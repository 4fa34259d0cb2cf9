//! The field between the nodes, and its values at the voxels.

use ivd_core::{Error, Exec, FieldBricks, Grid, VoxelCoord};
use ivd_field::sampler::Sampler;
use ivd_field::vectors::sampled;
use nalgebra::Vector3;

use super::super::region::Region;
use super::affine::Affine;
use super::matrix::Triple;
use super::nodes::{Cells, Near};

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
    ) -> Result<Vec<[f32; 3]>, Error> {
        let sampler = before.map(|b| Sampler::new(b, self.grid));
        let linear = self.grid.linear_part();
        sampled("map", self.grid.dims(), bricks, exec, |voxel, near| {
            let voxel = VoxelCoord::from(voxel).0;
            let so_far = sampler.as_ref().map_or_else(Vector3::zeros, |s| s.at(voxel));
            linear * so_far + self.at(voxel + so_far, near)
        })
    }
}
