//! A deformed volume that is kept while its displacement changes.

use ivd_core::op::Op as _;
use ivd_core::{
    Displacement, Exec, FieldBricks, Grid, Scalar, Volume, VoxelCoord, VoxelIndex, Voxels, parallel,
    with_voxels,
};
use nalgebra::Vector3;

use super::row::{LANES, Rows};
use super::sample::Source;
use super::{Order, WarpParams, check_grid, for_each_row, linear_row, sided};
use crate::Error;
use crate::sampler::brick_at;

/// What [`volume`](super::volume) makes of a volume, made anew brick by brick where its displacement changed.
///
/// Memory: one copy of the voxels. Whoever keeps a clone of [`Deformed::output`] while it is updated makes it copy them again, and no
/// memory limit is asked about that. Once the ranges of its bricks are known, they are kept, and found anew for what changes alone.
#[derive(Debug, Clone)]
pub struct Deformed {
    output: Volume,
    params: WarpParams,
    /// As a stored value.
    background: f64,
}

impl Deformed {
    /// A volume at rest.
    ///
    /// # Errors
    /// Parameters out of their domain; the memory limit.
    pub fn new(volume: &Volume, params: WarpParams, exec: &Exec) -> Result<Self, Error> {
        params.check()?;
        exec.check_memory("the deformed volume", volume.voxels().as_bytes().len() as u64)?;
        // A copy of its own, now and not at the first drag.
        let output = with_voxels!(volume.voxels(), slice => {
            let copy = Scalar::wrap(slice.to_vec().into());
            Volume::with_scale(volume.grid().clone(), copy, volume.slope(), volume.intercept())?
        });
        let lowest = || volume.range().map(|range| range[0]);
        let background = params.background.or_else(lowest).map_or(0.0, |value| volume.stored(value));
        Ok(Self { output, params, background })
    }

    /// The deformed volume.
    pub fn output(&self) -> &Volume {
        &self.output
    }

    /// How values between voxels are found, and what comes where there are none.
    pub fn params(&self) -> &WarpParams {
        &self.params
    }

    /// Makes bricks (linear indices of [`FieldBricks::table`], ascending) anew, as they are under a displacement. All others must
    /// be as they were made before. Gives the number of voxels that were computed; the rest of the bricks' is copied.
    ///
    /// - `volume`: the one it was made of.
    ///
    /// # Errors
    /// A volume or a displacement on another grid, a volume of another type; cancellation, before anything is changed.
    pub fn update(
        &mut self,
        volume: &Volume,
        displacement: &Displacement,
        bricks: &[usize],
        exec: &Exec,
    ) -> Result<u64, Error> {
        check_grid(volume.grid(), displacement, "volume")?;
        check_grid(self.output.grid(), displacement, "deformed volume")?;
        exec.check_cancelled()?;
        let job = Job {
            displacement,
            bricks,
            order: self.params.order,
            background: self.background,
            simd: exec.simd,
        };
        let types = [volume.voxel_type(), self.output.voxel_type()];
        let remake = |output: &mut Voxels| {
            of_one_type!(volume.voxels(), output, from, to => Ok(job.run(from, to.make_mut())))
                .unwrap_or_else(|| {
                    Err(Error::Mismatch {
                        what: "volume",
                        problem: format!("its voxels are {:?}, the deformed ones {:?}", types[0], types[1]),
                        remedy: "update with the volume that it was made of",
                    })
                })
        };
        exec.run(|| self.output.change_blocks(bricks, remake))
    }
}

/// Bricks to be made.
pub(super) struct Job<'a> {
    pub(super) displacement: &'a Displacement,
    pub(super) bricks: &'a [usize],
    pub(super) order: Order,
    pub(super) background: f64,
    pub(super) simd: bool,
}

impl Job<'_> {
    /// Makes them of the voxels at rest; how many voxels were computed.
    pub(super) fn run<T: Scalar>(&self, voxels: &[T], out: &mut [T]) -> u64 {
        let grid = self.displacement.grid();
        let ([nx, ny, _], brick_dims) = (grid.dims(), self.displacement.inverse().brick_dims());
        let source = Source { voxels, dims: grid.dims() };
        let rows = Rows::new(&source, grid, self.simd);
        let layer = brick_dims[0] * brick_dims[1];
        let slab = FieldBricks::SIDE * nx * ny;
        let counts = parallel::map_pieces_mut(out, slab, &|bz, out| {
            let voxels = &voxels[slab * bz..][..out.len()];
            let first = self.bricks.partition_point(|b| *b < layer * bz);
            let end = self.bricks.partition_point(|b| *b < layer * (bz + 1));
            let bricks = self.bricks[first..end].iter();
            bricks.map(|&brick| self.brick(&rows, &source, grid, brick, voxels, out)).sum::<u64>()
        });
        counts.iter().sum()
    }

    /// Whether some of these voxels comes from a side of a cut, where its neighbours may not count.
    fn is_sided(&self, first: usize, count: usize) -> bool {
        let sides = self.displacement.sides().get(first..first + count).unwrap_or_default();
        sides.iter().any(|side| side >> 2 != 0)
    }

    /// One brick of a slab; how many of its voxels were computed.
    fn brick<T: Scalar>(
        &self,
        rows: &Rows<'_, T>,
        source: &Source<'_, T>,
        grid: &Grid,
        brick: usize,
        voxels: &[T],
        out: &mut [T],
    ) -> u64 {
        let background = T::from_f64(self.background);
        let value = |voxel: VoxelIndex, place: Option<[f64; 3]>| match place {
            Some(x) => {
                sided::sample(source, self.displacement, voxel, x, self.order).map_or(background, T::from_f64)
            }
            None => background,
        };
        let field = self.displacement.inverse();
        let vectors = field.brick(brick);
        let to_voxel = grid.inverse_linear_part();
        let mut count = 0;
        for_each_row(grid.dims(), brick_at(field.brick_dims(), brick), |start, row, range| {
            let to = &mut out[range.clone()];
            let at = |i: usize| VoxelIndex([start[0] + i, start[1], start[2]]);
            match vectors {
                Some(vectors)
                    if self.order == Order::Linear && !self.is_sided(grid.linear(at(0)), to.len()) =>
                {
                    let (row, _) = vectors[row..].split_first_chunk::<LANES>().expect("a brick's row");
                    count += linear_row(rows, (start, row, None), &voxels[range], to, &value);
                }
                Some(vectors) => {
                    to.copy_from_slice(&voxels[range]);
                    for (i, to) in to.iter_mut().enumerate().filter(|(i, _)| vectors[row + i] != [0.0; 3]) {
                        let from = VoxelCoord::from(at(i)).0
                            + to_voxel * Vector3::from(vectors[row + i]).map(f64::from);
                        *to = value(at(i), Some(from.into()));
                        count += 1;
                    }
                }
                None => to.copy_from_slice(&voxels[range]),
            }
            let flags = self.displacement.vacated().get(grid.linear(at(0))..).unwrap_or_default();
            for (i, to) in to.iter_mut().enumerate().filter(|(i, _)| flags.get(*i).is_some_and(|f| *f != 0)) {
                *to = background;
                count += u64::from(vectors.is_none_or(|vectors| vectors[row + i] == [0.0; 3]));
            }
        });
        count
    }
}

#[cfg(test)]
mod tests;
