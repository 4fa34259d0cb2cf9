//! The kernel `volume/ranges`.

use ivd_core::{Answer, BrickIndex, BrickRanges, DeviceForm, Exec, Grid, Kernel as _, Voxels};

use crate::kept::Kept;
use crate::pass::{Part, Pass};
use crate::shared::{Opened, RESULT, answer, names_of};
use crate::stored::value;
use crate::{Error, SharedGpu};

/// Bricks of a workgroup.
const BRICKS: usize = 8;

impl DeviceForm<BrickRanges> for SharedGpu {
    fn run(
        &self,
        (grid, voxels): &(&Grid, &Voxels),
        exec: &Exec,
    ) -> Result<Answer<BrickIndex>, ivd_core::Error> {
        answer(BrickRanges::NAME, self.attempt(|opened| opened.ranges(grid, voxels, exec)))
    }
}

impl Opened {
    fn ranges(&mut self, grid: &Grid, voxels: &Voxels, exec: &Exec) -> Result<BrickIndex, Error> {
        let names = names_of(voxels)?;
        // Bricks are found once, before a volume lies where it stays: only one that is here already is kept.
        let brought = match &self.volume {
            Some(kept) if kept.is_of(voxels) => None,
            _ => Some(Kept::upload_voxels(&self.gpu, voxels)?),
        };
        let pipeline = self.pipeline("volume/ranges.wgsl", &names)?;
        let dims = BrickIndex::dims_for(grid.dims());
        let bricks = dims.iter().product::<usize>();
        let bytes = 12 * bricks as u64;
        let ranges = self.gpu.room("the bricks' ranges", bytes, RESULT)?;
        let [nx, ny, nz] = grid.dims().map(|n| n as u32);
        let pass = Pass {
            pipeline: &pipeline,
            numbers: vec![nx, ny, nz, dims[0] as u32, dims[1] as u32, bricks as u32],
            rooms: brought
                .as_ref()
                .or(self.volume.as_ref().map(|kept| &kept.room))
                .into_iter()
                .chain([&ranges])
                .collect(),
            groups: bricks.div_ceil(BRICKS),
        };
        let (mut min, mut max, mut missing) = (Vec::new(), Vec::new(), Vec::new());
        let part = Part { room: &ranges, from: 0, bytes };
        self.desk.make(&self.gpu, "ranges", &[pass], &[part], exec, |read| {
            for brick in read.chunks_exact(12) {
                let [least, most, gap]: [u32; 3] = bytemuck::pod_read_unaligned(brick);
                let of = voxels.voxel_type();
                let any = least <= most;
                min.push(if any { value(of, least) } else { f32::INFINITY });
                max.push(if any { value(of, most) } else { f32::NEG_INFINITY });
                missing.push(gap as u8);
            }
        })?;
        BrickIndex::from_parts(dims, min.into(), max.into(), missing.into()).ok_or(Error::NotWritten)
    }
}
