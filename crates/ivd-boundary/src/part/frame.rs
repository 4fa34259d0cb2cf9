//! A box about a set.

use super::bounds;

/// A box about a set of a volume's voxels, with a margin that may reach beyond the volume. Along an axis of one voxel nothing lies beyond.
pub(crate) struct Frame {
    dims: [usize; 3],
    /// The box's lowest voxel is this much below the volume's `low`.
    low: [usize; 3],
    margin: [usize; 3],
    /// Voxels of the box.
    pub(crate) size: [usize; 3],
}

impl Frame {
    /// The box of a set and `margin` voxels to either side.
    pub(crate) fn about(inside: &[u8], dims: [usize; 3], margin: [usize; 3]) -> Self {
        let [low, high] = bounds(inside, dims);
        let margin: [usize; 3] = std::array::from_fn(|a| if dims[a] > 1 { margin[a] } else { 0 });
        let size = std::array::from_fn(|a| high[a].saturating_sub(low[a]) + 2 * margin[a]);
        Self { dims, low, margin, size }
    }

    /// Number of voxels.
    pub(crate) fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// The volume's voxel (its linear index) at a voxel of the box; `None` beyond the volume.
    pub(crate) fn voxel(&self, i: usize) -> Option<usize> {
        let at = self.place(i);
        let mut voxel = [0; 3];
        for a in 0..3 {
            voxel[a] = (self.low[a] + at[a]).checked_sub(self.margin[a]).filter(|v| *v < self.dims[a])?;
        }
        Some(voxel[0] + self.dims[0] * (voxel[1] + self.dims[1] * voxel[2]))
    }

    /// Where a voxel of the box lies in it.
    pub(super) fn place(&self, i: usize) -> [usize; 3] {
        [i % self.size[0], i / self.size[0] % self.size[1], i / self.size[0] / self.size[1]]
    }
}
