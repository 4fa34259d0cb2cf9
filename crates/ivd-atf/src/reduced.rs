use ivd_core::{Exec, Labels, Scalar, Volume, parallel, with_voxels};

use crate::Error;

/// Most voxels along an axis that are looked at: finer volumes are looked at by every second voxel, every third, and so on.
const MOST_ALONG: usize = 256;
/// Level of the greatest value.
pub(crate) const TOP: u16 = 65_534;
/// Level of a voxel without data.
pub(crate) const MISSING: u16 = u16::MAX;

/// A volume's values in 65,535 levels of its range, on every `stride`-th voxel: what is asked of a scan's structure doesn't hang on the
/// type of its voxels, and takes no longer on finer ones.
pub(crate) struct Reduced<'a> {
    pub(crate) dims: [usize; 3],
    pub(crate) stride: [usize; 3],
    /// Level of every voxel that is looked at, x fastest.
    pub(crate) levels: Vec<u16>,
    /// Range of the real values: level 0 and [`TOP`].
    pub(crate) range: [f64; 2],
    ids: &'a [u16],
    full: [usize; 3],
    /// Place of each label in the order of means.
    rank: Vec<u16>,
}

impl<'a> Reduced<'a> {
    /// `rank`: place of each label in the order of means, 65,536 of them.
    pub(crate) fn new(
        volume: &Volume,
        labels: &'a Labels,
        rank: Vec<u16>,
        range: [f64; 2],
        exec: &Exec,
    ) -> Result<Self, Error> {
        let full = volume.grid().dims();
        let stride = full.map(|n| n.div_ceil(MOST_ALONG));
        let dims: [usize; 3] = std::array::from_fn(|a| full[a].div_ceil(stride[a]));
        exec.check_memory("levels of the values", 2 * dims.iter().product::<usize>() as u64)?;
        let mut levels = vec![MISSING; dims.iter().product()];
        let scale = if range[1] > range[0] { f64::from(TOP) / (range[1] - range[0]) } else { 0.0 };
        let (slope, shift) = (volume.slope() * scale, (volume.intercept() - range[0]) * scale);
        with_voxels!(volume.voxels(), stored => {
            parallel::try_for_each_piece_mut(&mut levels, dims[0] * dims[1], &|z, layer: &mut [u16]| {
                exec.check_cancelled()?;
                for (y, row) in layer.chunks_exact_mut(dims[0]).enumerate() {
                    let start = full[0] * (y * stride[1] + full[1] * z * stride[2]);
                    for (x, level) in row.iter_mut().enumerate() {
                        let value = stored[start + x * stride[0]];
                        if value.is_data() {
                            *level = (value.to_f64() * slope + shift + 0.5).clamp(0.0, f64::from(TOP)) as u16;
                        }
                    }
                }
                Ok::<_, Error>(())
            })?;
        });
        Ok(Self { dims, stride, levels, range, ids: labels.ids(), full, rank })
    }

    /// Real value of a level.
    pub(crate) fn real(&self, level: f64) -> f64 {
        self.range[0] + self.step() * level
    }

    /// Real values between two levels.
    pub(crate) fn step(&self) -> f64 {
        (self.range[1] - self.range[0]) / f64::from(TOP)
    }

    /// Place of the class of a voxel in the order of means.
    #[inline]
    pub(crate) fn rank(&self, [x, y, z]: [usize; 3]) -> u16 {
        let [sx, sy, sz] = self.stride;
        let i = x * sx + self.full[0] * (y * sy + self.full[1] * z * sz);
        self.rank[usize::from(self.ids[i])]
    }

    /// The same of a row along x.
    pub(crate) fn ranks(&self, y: usize, z: usize, out: &mut [u16]) {
        for (x, rank) in out.iter_mut().enumerate() {
            *rank = self.rank([x, y, z]);
        }
    }

    /// Levels of a row along x.
    pub(crate) fn row(&self, y: usize, z: usize) -> &[u16] {
        &self.levels[self.dims[0] * (y + self.dims[1] * z)..][..self.dims[0]]
    }
}
