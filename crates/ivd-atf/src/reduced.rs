use ivd_core::{Exec, Labels, Scalar, Volume, parallel, with_voxels};

use crate::Error;

/// Level of the greatest value of the table's range.
pub(crate) const MAX_LEVEL: u16 = 65_534;
/// Level of a voxel without data.
pub(crate) const MISSING: u16 = u16::MAX;

/// The index that stands for sample `i` of `samples` along an axis of `n` indices: the first for the first, the last for the last, evenly
/// between. As many samples as indices give each its own.
#[inline]
pub(crate) fn evenly(i: usize, samples: usize, n: usize) -> usize {
    if samples < 2 { 0 } else { (2 * i * (n - 1) + samples - 1) / (2 * (samples - 1)) }
}

/// A volume's values in 65,535 levels of the table's range, and its classes: at every voxel, and held in memory for an even choice of at most
/// so many along each axis. What is asked of a scan's structure doesn't depend on the type of its voxels.
pub(crate) struct Reduced<'a> {
    /// Samples along each axis.
    pub(crate) dims: [usize; 3],
    /// Voxels along each axis of the volume.
    pub(crate) full: [usize; 3],
    /// Distance of samples (mm).
    pub(crate) spacing: [f64; 3],
    /// Distance of voxels (mm).
    pub(crate) voxel_spacing: [f64; 3],
    /// Level of every sample, x fastest.
    pub(crate) levels: Vec<u16>,
    /// Place of each sample's class in the order of means; none are held where every voxel is a sample.
    ranks: Vec<u16>,
    /// Range of the real values: level 0 and [`MAX_LEVEL`].
    pub(crate) range: [f64; 2],
    volume: &'a Volume,
    ids: &'a [u16],
    rank_of_label: Vec<u16>,
}

impl<'a> Reduced<'a> {
    /// - `rank_of_label`: place of each label in the order of means, 65,536 of them.
    /// - `most`: samples along an axis at most.
    pub(crate) fn new(
        volume: &'a Volume,
        labels: &'a Labels,
        rank_of_label: Vec<u16>,
        range: [f64; 2],
        most: usize,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let full = volume.grid().dims();
        let dims = full.map(|n| n.min(most));
        let voxel_spacing = volume.grid().spacing();
        let spacing = std::array::from_fn(|a| voxel_spacing[a] * full[a] as f64 / dims[a] as f64);
        let samples = dims.iter().product::<usize>();
        let ranked = if dims == full { 0 } else { samples };
        exec.check_memory("levels and classes of the voxels", 2 * (samples + ranked) as u64)?;
        let ids = labels.ids();
        let mut reduced = Self {
            dims,
            full,
            spacing,
            voxel_spacing,
            levels: Vec::new(),
            ranks: Vec::new(),
            range,
            volume,
            ids,
            rank_of_label,
        };
        let place = |i: usize, a: usize| evenly(i, dims[a], full[a]);
        (reduced.levels, reduced.ranks) = reduced.gathered(dims, ranked > 0, place, exec)?;
        Ok(reduced)
    }

    /// Every so many voxels along each axis, all of them held, as if there were no others.
    pub(crate) fn strided(&self, stride: usize, exec: &Exec) -> Result<Self, Error> {
        let dims = self.full.map(|n| n.div_ceil(stride));
        exec.check_memory("voxels apart from each other", 4 * dims.iter().product::<usize>() as u64)?;
        let (levels, ranks) = self.gathered(dims, true, |i, _| i * stride, exec)?;
        let spacing = self.voxel_spacing.map(|mm| mm * stride as f64);
        let rank_of_label = self.rank_of_label.clone();
        Ok(Self { dims, full: dims, spacing, voxel_spacing: spacing, levels, ranks, rank_of_label, ..*self })
    }

    /// Levels of samples, and the places of their classes where these are wanted.
    ///
    /// - `place`: which of the voxels along an axis a sample stands for, by its place along it and the axis.
    fn gathered(
        &self,
        dims: [usize; 3],
        with_ranks: bool,
        place: impl Fn(usize, usize) -> usize + Sync,
        exec: &Exec,
    ) -> Result<(Vec<u16>, Vec<u16>), Error> {
        let (layer, samples) = (dims[0] * dims[1], dims.iter().product());
        let start = |y: usize, z: usize| self.full[0] * (place(y, 1) + self.full[1] * place(z, 2));
        let rows = |layer: &mut [u16], z: usize, fill: &dyn Fn(&mut [u16], usize)| {
            exec.check_cancelled()?;
            layer.chunks_exact_mut(dims[0]).enumerate().for_each(|(y, row)| fill(row, start(y, z)));
            Ok::<_, Error>(())
        };
        let mut levels = vec![MISSING; samples];
        parallel::try_for_each_piece_mut(&mut levels, layer, &|z, layer: &mut [u16]| {
            rows(layer, z, &|row, start| self.fill(row, |x| start + place(x, 0)))
        })?;
        let mut ranks = vec![0; if with_ranks { samples } else { 0 }];
        parallel::try_for_each_piece_mut(&mut ranks, layer, &|z, layer: &mut [u16]| {
            rows(layer, z, &|row, start| {
                row.iter_mut().enumerate().for_each(|(x, rank)| *rank = self.rank_at(start + place(x, 0)));
            })
        })?;
        Ok((levels, ranks))
    }

    /// Voxels on the volume's sides across each axis; none across one of one or two voxels.
    pub(crate) fn sides(&self) -> [u64; 3] {
        let [nx, ny, nz] = self.full.map(|n| n as u64);
        let across = |n: u64, layer: u64| if n > 2 { 2 * layer } else { 0 };
        [across(nx, ny * nz), across(ny, nx * nz), across(nz, nx * ny)]
    }

    /// Levels of the voxels that `voxel` names.
    fn fill(&self, out: &mut [u16], voxel: impl Fn(usize) -> usize) {
        let step = self.step();
        let scale = if step > 0.0 { 1.0 / step } else { 0.0 };
        let (slope, shift) = (self.volume.slope() * scale, (self.volume.intercept() - self.range[0]) * scale);
        with_voxels!(self.volume.voxels(), stored => {
            for (x, level) in out.iter_mut().enumerate() {
                let value = stored[voxel(x)];
                *level = if value.is_data() {
                    (value.to_f64() * slope + shift + 0.5).clamp(0.0, f64::from(MAX_LEVEL)) as u16
                } else {
                    MISSING
                };
            }
        });
    }

    /// Real value of a level.
    pub(crate) fn real(&self, level: f64) -> f64 {
        self.range[0] + self.step() * level
    }

    /// Real values between two levels.
    pub(crate) fn step(&self) -> f64 {
        (self.range[1] - self.range[0]) / f64::from(MAX_LEVEL)
    }

    /// Place of the class of a sample in the order of means.
    #[inline]
    pub(crate) fn rank(&self, [x, y, z]: [usize; 3]) -> u16 {
        let sample = x + self.dims[0] * (y + self.dims[1] * z);
        if self.ranks.is_empty() { self.rank_at(sample) } else { self.ranks[sample] }
    }

    /// The same of a row of samples along x.
    pub(crate) fn ranks(&self, y: usize, z: usize) -> impl Iterator<Item = u16> {
        (0..self.dims[0]).map(move |x| self.rank([x, y, z]))
    }

    /// Levels of a row of samples along x.
    pub(crate) fn row(&self, y: usize, z: usize) -> &[u16] {
        &self.levels[self.dims[0] * (y + self.dims[1] * z)..][..self.dims[0]]
    }

    fn rank_at(&self, voxel: usize) -> u16 {
        self.rank_of_label[usize::from(self.ids[voxel])]
    }

    /// Levels of a row of voxels along x, whether they are held or not; `space` is where they are put if not.
    pub(crate) fn voxel_levels<'b>(&'b self, y: usize, z: usize, space: &'b mut Vec<u16>) -> &'b [u16] {
        if self.dims == self.full {
            return self.row(y, z);
        }
        let start = self.full[0] * (y + self.full[1] * z);
        space.resize(self.full[0], MISSING);
        self.fill(space, |x| start + x);
        space
    }

    /// Places of the classes of a row of voxels along x; `space` is where they are put.
    pub(crate) fn voxel_ranks<'b>(&'b self, y: usize, z: usize, space: &'b mut Vec<u16>) -> &'b [u16] {
        space.clear();
        if self.dims == self.full {
            space.extend(self.ranks(y, z));
            return space;
        }
        let start = self.full[0] * (y + self.full[1] * z);
        space.extend((start..start + self.full[0]).map(|voxel| self.rank_at(voxel)));
        space
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_even_and_reach_from_the_first_to_the_last() {
        let along = |samples, n| (0..samples).map(|i| evenly(i, samples, n)).collect::<Vec<_>>();
        assert_eq!(along(5, 5), [0, 1, 2, 3, 4]);
        assert_eq!(along(4, 5), [0, 1, 3, 4]);
        assert_eq!(along(3, 9), [0, 4, 8]);
        assert_eq!(along(1, 7), [0]);
        let one_more = along(256, 257);
        assert!(one_more.windows(2).all(|w| w[1] - w[0] == 1 || w[1] - w[0] == 2) && one_more[255] == 256);
    }
}
