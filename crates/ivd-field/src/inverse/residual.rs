use ivd_core::VoxelIndex;

/// The vectors of a brick, and the worst residual in it.
pub(crate) type SolvedBrick = (Box<[[f32; 3]]>, Worst);

/// The largest residual so far; of equals the first voxel in memory order wins.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Worst {
    pub(crate) residual: f64,
    pub(crate) voxel: Option<VoxelIndex>,
}

impl Worst {
    pub(crate) fn take(&mut self, residual: f64, voxel: VoxelIndex) {
        if self.voxel.is_none() || residual > self.residual {
            *self = Self { residual, voxel: Some(voxel) };
        }
    }

    pub(crate) fn merge(&mut self, other: Self) {
        if let Some(voxel) = other.voxel {
            self.take(other.residual, voxel);
        }
    }
}
