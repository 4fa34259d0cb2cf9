//! The field between the nodes, and its values at the voxels.

use ivd_core::{Error, Exec, FieldBricks, Grid, VoxelCoord, VoxelIndex};
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
        let dims = self.grid.dims();
        let Some(before) = before else {
            return sampled("map", dims, bricks, exec, |voxel, of_brick| self.at_voxel(voxel, of_brick));
        };
        let sampler = Sampler::new(before, self.grid);
        let linear = self.grid.linear_part();
        sampled("map", dims, bricks, exec, |voxel, near| {
            let voxel = VoxelCoord::from(voxel).0;
            let so_far = sampler.at(voxel);
            linear * so_far + self.at(voxel + so_far, near)
        })
    }

    /// As [`Field::at`], of the voxels of one brick after another. `of_brick`: what the nodes say there; empty at first.
    fn at_voxel(&self, voxel: VoxelIndex, of_brick: &mut Vec<Vector3<f64>>) -> Vector3<f64> {
        let place = self.grid.linear_part() * VoxelCoord::from(voxel).0;
        let cut = self.region.weight(place);
        if cut == 0.0 {
            return Vector3::zeros();
        }
        let mut motion = self.affine.map_or_else(Vector3::zeros, |a| a.at(place, cut));
        if !self.nodes.is_empty() {
            const SIDE: usize = FieldBricks::SIDE;
            if of_brick.is_empty() {
                *of_brick = self.cells.interpolate_brick(self.nodes, voxel.0.map(|at| at - at % SIDE));
            }
            let [x, y, z] = voxel.0.map(|at| at % SIDE);
            motion += of_brick[x + SIDE * (y + SIDE * z)] * cut;
        }
        motion
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::dented;
    use crate::{Band, BiharmonicParams};

    #[test]
    fn a_brick_at_once_is_each_of_its_voxels_bit_for_bit() {
        let scene = dented(1.0, 3.0);
        for (cell, margin) in [(None, None), (Some(2), Some(9.0)), (Some(1), Some(5.0))] {
            let params = BiharmonicParams {
                cell,
                band: Band { margin, ..Band::default() },
                ..BiharmonicParams::default()
            };
            let (region, system) = scene.system(&params);
            let found = system.solve(&scene.motions(), None, 1e-8, |_, _| false, &Exec::default()).unwrap();
            let grid = scene.lattice.grid();
            let field =
                Field { grid, region: &region, cells: &system.cells, affine: None, nodes: &found.values };
            let bricks = region.bricks(grid);
            let sampled_at_once = field.sample(None, &bricks, &Exec::default()).unwrap();
            let one_by_one = sampled("map", grid.dims(), &bricks, &Exec::default(), |voxel, near| {
                field.at(VoxelCoord::from(voxel).0, near)
            });
            assert!(sampled_at_once.iter().any(|v| *v != [0.0; 3]));
            assert!(sampled_at_once == one_by_one.unwrap(), "{cell:?}");
        }
    }
}
