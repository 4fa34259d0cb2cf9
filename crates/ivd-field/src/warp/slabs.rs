//! Deformed voxels a slab at a time, for who has no use for all of them at once.

use ivd_core::{Displacement, FieldBricks, Scalar, VoxelIndex};

use super::row::Rows;
use super::sample::Source;
use super::{Order, linear_slab, moved_slice, sided};

/// What a warp makes of voxels, slab by slab: eight slices each, the layers of the displacement's bricks.
pub(crate) struct Slabs<'a, T> {
    pub(crate) voxels: &'a [T],
    /// On the voxels' grid.
    pub(crate) displacement: &'a Displacement,
    pub(crate) order: Order,
    pub(crate) background: T,
    pub(crate) simd: bool,
}

impl<T: Scalar> Slabs<'_, T> {
    /// Slab `bz`: to the last bit what the whole warp has there.
    pub(crate) fn slab(&self, bz: usize) -> Vec<T> {
        let grid = self.displacement.grid();
        let [nx, ny, nz] = grid.dims();
        let source = Source { voxels: self.voxels, dims: grid.dims() };
        let value = |voxel: VoxelIndex, place: Option<[f64; 3]>| match place {
            Some(x) => sided::sample(&source, self.displacement, voxel, x, self.order)
                .map_or(self.background, T::from_f64),
            None => self.background,
        };
        let first = FieldBricks::SIDE * bz;
        let slices = first..(first + FieldBricks::SIDE).min(nz);
        let mut out = self.voxels[nx * ny * slices.start..nx * ny * slices.end].to_vec();
        if self.order == Order::Linear && !self.displacement.has_cut() {
            let voxels = &self.voxels[nx * ny * slices.start..nx * ny * slices.end];
            let rows = Rows::new(&source, grid, self.simd);
            linear_slab(&rows, self.displacement, None, bz, voxels, &mut out, &value);
        } else {
            for (z, slice) in slices.zip(out.chunks_mut(nx * ny)) {
                moved_slice(grid, self.displacement, z, slice, &value);
            }
        }
        out
    }
}
