//! The grid of cells over space and value, and how many voxels each of them holds.

use ivd_core::{Error, Exec, Mask, ParamError, Scalar, Volume, parallel, with_voxels};

use super::bandwidth::{Bandwidths, real};
use super::params::{Kernel, MsvsParams};
use super::range_axis::RangeAxis;
use crate::histogram::{Tabled, with_tabled};

/// Most cells of a grid: 1.6 GB while it is worked on. A constant, and no matter of the memory there is, because the number
/// of cells shows in the labels.
const MOST_CELLS: usize = 1 << 26;
/// Bytes that a cell takes, at most: its count, height, basin, and place in the order of heights.
const BYTES: usize = 24;
/// How much finer the cells are where there is only one axis of them.
const FINER: f64 = 4.0;
/// Least bandwidth in space, in shortest edges of a voxel: below, no window reaches a neighbour, and its weights have no numbers.
const LEAST_SPATIAL: f64 = 1e-3;
/// How far the Gaussian reaches, in bandwidths; what lies beyond is less than 1e-4 of it.
pub(super) const REACH: f64 = 4.0;
/// No cell: the voxel is no data.
pub(super) const NOWHERE: u32 = u32::MAX;

/// A grid of cells, linear: the value fastest, then x, y, z.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cells {
    /// Cells along x, y, z and the value.
    pub(super) dims: [usize; 4],
    /// Voxels along each edge of a cell.
    pub(super) edge: [usize; 3],
    /// Bandwidth along each axis (cells); 0 along an axis of a single cell.
    pub(super) sigma: [f64; 4],
    pub(super) range: RangeAxis,
    /// Bandwidth in space (mm).
    pub(super) spatial_bandwidth: f64,
    /// Voxels along x, y, z.
    voxels: [usize; 3],
}

impl Cells {
    /// The grid for some bandwidths, with as many cells across them as the parameters ask for, or as many as fit.
    pub(super) fn new(
        volume: &Volume,
        mask: Option<&Mask>,
        params: &MsvsParams,
        bandwidths: &Bandwidths,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let least = LEAST_SPATIAL * volume.grid().shortest_edge();
        if bandwidths.spatial > 0.0 && bandwidths.spatial < least {
            let problem = format!("{} mm, far less than a voxel", bandwidths.spatial);
            let remedy = format!("use {least} mm at least, or 0 to leave places out");
            return Err(ParamError::new("spatial_bandwidth", problem, remedy).into());
        }
        let mut per_bandwidth = params.cells_per_bandwidth;
        loop {
            exec.check_cancelled()?;
            let cells = Self::with(volume, mask, params.kernel, bandwidths, per_bandwidth, exec)?;
            let len = cells.dims.iter().try_fold(1_usize, |n, d| n.checked_mul(*d));
            if let Some(len) = len.filter(|n| *n <= MOST_CELLS) {
                let what = "the cells of mean shift (a larger spatial_bandwidth or range_bandwidth, or a smaller \
                            cells_per_bandwidth, needs fewer)";
                exec.check_memory(what, (len * BYTES) as u64)?;
                return Ok(cells);
            }
            if per_bandwidth <= 1.0 {
                return Err(too_many(bandwidths, &cells).into());
            }
            // An eighth fewer along each axis: about half as many cells.
            per_bandwidth = (per_bandwidth * 0.875).max(1.0);
        }
    }

    fn with(
        volume: &Volume,
        mask: Option<&Mask>,
        kernel: Kernel,
        bandwidths: &Bandwidths,
        per_bandwidth: f64,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let voxels = volume.grid().dims();
        let spatial = bandwidths.spatial > 0.0;
        let (mut edge, mut dims, mut sigma) = (voxels, [1; 4], [0.0; 4]);
        for axis in (0..3).filter(|_| spatial) {
            let bandwidth = bandwidths.spatial / volume.grid().spacing()[axis];
            edge[axis] = ((bandwidth / per_bandwidth) as usize).clamp(1, voxels[axis]);
            dims[axis] = voxels[axis].div_ceil(edge[axis]);
            sigma[axis] = if dims[axis] > 1 { bandwidth / edge[axis] as f64 } else { 0.0 };
        }
        sigma[3] = if spatial { per_bandwidth } else { FINER * per_bandwidth };
        let reach = match kernel {
            Kernel::Gaussian => REACH * sigma[3],
            Kernel::Flat => sigma[3],
        };
        let width = bandwidths.range / sigma[3];
        let range = RangeAxis::new(volume, mask, bandwidths.values, width, reach.ceil() as usize, exec)?;
        dims[3] = range.len;
        Ok(Self { dims, edge, sigma, range, spatial_bandwidth: bandwidths.spatial, voxels })
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// Cells from one to the next along each axis.
    pub(super) fn strides(&self) -> [usize; 4] {
        let [nx, ny, _, range] = self.dims;
        [range, range * nx, range * nx * ny, 1]
    }

    /// Place along the voxel axes (mm) of a place among the cells.
    pub(super) fn position(&self, place: &[f64; 4], volume: &Volume) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let edge = self.edge[axis] as f64;
            // The last cell may hold fewer voxels than the others.
            let voxel = (place[axis] * edge + (edge - 1.0) / 2.0).min((self.voxels[axis] - 1) as f64);
            voxel * volume.grid().spacing()[axis]
        })
    }

    /// Number of voxels in each cell.
    pub(super) fn count(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Result<Vec<u32>, Error> {
        with_tabled!(volume.voxels(), slice => {
            let table = self.table(volume, slice);
            self.count_by(slice, mask, exec, |v| table[v.slot()])
        }, else with_voxels!(volume.voxels(), slice => {
            self.count_by(slice, mask, exec, |v| self.place(volume, v))
        }))
    }

    /// The cell along the value of each stored value of a type of 8 or 16 bits.
    pub(super) fn table<T: Tabled>(&self, volume: &Volume, _: &[T]) -> Vec<u32> {
        let cell = |slot: usize| {
            let value = volume.real((T::LOWEST + slot as i64) as f64).clamp(f64::MIN, f64::MAX);
            // Values that don't occur have a place only within the axis.
            let cell = if value < self.lowest() { 0 } else { self.range.cell(value).min(self.dims[3] - 1) };
            cell as u32
        };
        (0..T::VALUES).map(cell).collect()
    }

    fn lowest(&self) -> f64 {
        self.range.low
    }

    /// The cell along the value of a voxel.
    #[inline]
    pub(super) fn place<T: Scalar>(&self, volume: &Volume, voxel: T) -> u32 {
        if voxel.is_data() { self.range.cell(real(volume, voxel)) as u32 } else { NOWHERE }
    }

    fn count_by<T: Scalar>(
        &self,
        voxels: &[T],
        mask: Option<&Mask>,
        exec: &Exec,
        place: impl Fn(T) -> u32 + Sync,
    ) -> Result<Vec<u32>, Error> {
        let mut counts = vec![0_u32; self.len()];
        let [nx, ny, ..] = self.dims;
        if nx * ny * self.dims[2] == 1 {
            return self.count_together(voxels, mask, exec, place);
        }
        let row = nx * self.dims[3];
        parallel::try_for_each_piece_mut(&mut counts, row, &|i, counts| {
            exec.check_cancelled()?;
            let (y, z) = (i % ny, i / ny);
            for z in z * self.edge[2]..((z + 1) * self.edge[2]).min(self.voxels[2]) {
                for y in y * self.edge[1]..((y + 1) * self.edge[1]).min(self.voxels[1]) {
                    let start = self.voxels[0] * (y + self.voxels[1] * z);
                    let inside = mask.map(|m| &m.inside()[start..][..self.voxels[0]]);
                    self.count_row(&voxels[start..][..self.voxels[0]], inside, counts, &place);
                }
            }
            Ok::<_, Error>(())
        })?;
        Ok(counts)
    }

    #[inline]
    fn count_row<T: Scalar>(
        &self,
        voxels: &[T],
        inside: Option<&[u8]>,
        counts: &mut [u32],
        place: &(impl Fn(T) -> u32 + Sync),
    ) {
        let edge = self.edge[0];
        for (x, (counts, voxels)) in counts.chunks_mut(self.dims[3]).zip(voxels.chunks(edge)).enumerate() {
            let inside = inside.map(|m| &m[x * edge..][..voxels.len()]);
            for (i, v) in voxels.iter().enumerate() {
                let cell = place(*v) as usize;
                if cell < counts.len() && inside.is_none_or(|m| m[i] != 0) {
                    counts[cell] += 1;
                }
            }
        }
    }

    /// Counts of a single row of cells, from all over the volume.
    fn count_together<T: Scalar>(
        &self,
        voxels: &[T],
        mask: Option<&Mask>,
        exec: &Exec,
        place: impl Fn(T) -> u32 + Sync,
    ) -> Result<Vec<u32>, Error> {
        let chunk = (1 << 20).max(16 * self.dims[3]);
        let empty = || vec![0_u32; self.dims[3]];
        let pieces = parallel::pieces(voxels.len(), chunk);
        let tables = parallel::try_gather(pieces, &empty, &|counts, i| {
            exec.check_cancelled()?;
            for j in parallel::piece(voxels.len(), chunk, i) {
                let cell = place(voxels[j]) as usize;
                if cell < counts.len() && mask.is_none_or(|m| m.inside()[j] != 0) {
                    counts[cell] += 1;
                }
            }
            Ok::<_, Error>(())
        })?;
        let mut counts = empty();
        for part in &tables {
            counts.iter_mut().zip(part).for_each(|(sum, n)| *sum += n);
        }
        Ok(counts)
    }
}

fn too_many(bandwidths: &Bandwidths, cells: &Cells) -> ParamError {
    let [x, y, z, range] = cells.dims;
    let problem = |bandwidth: f64| {
        format!(
            "{bandwidth} asks for {x} × {y} × {z} × {range} cells, more than the {MOST_CELLS} that are kept"
        )
    };
    if bandwidths.spatial > 0.0 && range < 1 << 12 {
        let remedy = "use a larger bandwidth, or 0 to look at values alone";
        ParamError::new("spatial_bandwidth", problem(bandwidths.spatial), remedy)
    } else {
        ParamError::new("range_bandwidth", problem(bandwidths.range), "use a larger bandwidth")
    }
}
