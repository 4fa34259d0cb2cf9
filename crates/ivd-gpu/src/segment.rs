//! The kernels `segment/histogram` and `segment/label`.

use ivd_core::{Answer, DeviceForm, Exec, Kernel as _, Mask, NO_DATA, SpillVec};
use ivd_segment::plan::{Counted, Counting, Labelled, Labelling};

use crate::buffers::Room;
use crate::pass::{Part, Pass};
use crate::shared::{Opened, RESULT, answer};
use crate::stored::{is_byte, rank};
use crate::{Error, SharedGpu};

/// Lanes of a workgroup.
const LANES: usize = 256;
/// Quads of voxels that a lane counts, of bytes and of 16 bits.
const QUADS: [usize; 2] = [32, 256];
/// Values of 16 bits that are counted at once: a workgroup has room for so many.
const PAGE: usize = 4096;
/// Quads whose labels are read at once, at most.
const READ_QUADS: usize = 1 << 23;

impl DeviceForm<Counting> for SharedGpu {
    fn run(&self, args: &Counted<'_>, exec: &Exec) -> Result<Answer<Vec<u64>>, ivd_core::Error> {
        answer(Counting::NAME, self.attempt(|opened| opened.count(args, exec)))
    }
}

impl DeviceForm<Labelling> for SharedGpu {
    fn run(&self, args: &Labelled<'_>, exec: &Exec) -> Result<Answer<SpillVec<u16>>, ivd_core::Error> {
        answer(Labelling::NAME, self.attempt(|opened| opened.label(args, exec)))
    }
}

impl Opened {
    fn mask(&self, mask: Option<&Mask>) -> Result<Option<Room>, Error> {
        mask.map(|mask| self.gpu.upload("the mask", mask.inside())).transpose()
    }

    fn count(&mut self, args: &Counted<'_>, exec: &Exec) -> Result<Vec<u64>, Error> {
        let mut names = self.bring_stored(args.voxels)?;
        names.extend(args.mask.map(|_| "MASKED"));
        let pipeline = self.pipeline("segment/histogram.wgsl", &names)?;
        let mask = self.mask(args.mask)?;
        if is_byte(args.voxels) {
            return self.count_into(&pipeline, args, mask.as_ref(), (1 << 8, QUADS[0], &[0]), exec);
        }
        // Those pages alone that hold any value are looked through.
        names.push("PAGES");
        let coarse = self.pipeline("segment/histogram.wgsl", &names)?;
        let pages =
            self.count_into(&coarse, args, mask.as_ref(), ((1 << 16) / PAGE, QUADS[1], &[0]), exec)?;
        let pages: Vec<usize> = (0..pages.len()).filter(|page| pages[*page] > 0).collect();
        self.count_into(&pipeline, args, mask.as_ref(), (1 << 16, QUADS[1], &pages), exec)
    }

    /// Counts so many different things, with so many quads a lane, in these pages.
    fn count_into(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        args: &Counted<'_>,
        mask: Option<&Room>,
        (values, quads, pages): (usize, usize, &[usize]),
        exec: &Exec,
    ) -> Result<Vec<u64>, Error> {
        let bytes = 4 * values as u64;
        let counts = self.gpu.room("the counts", bytes, RESULT)?;
        let voxels = args.voxels.len();
        let mut found: Vec<u64> = Vec::new();
        for [first, end] in self.pieces(voxels.div_ceil(4)) {
            let pass = |page: &usize| Pass {
                pipeline,
                numbers: [voxels, first, end, *page].map(|n| n as u32).to_vec(),
                rooms: self.volume.iter().map(|kept| &kept.room).chain([&counts]).chain(mask).collect(),
                groups: (end - first).div_ceil(LANES * quads),
            };
            let passes: Vec<Pass<'_>> = pages.iter().map(pass).collect();
            let part = Part { room: &counts, from: 0, bytes };
            self.desk.make(&self.gpu, "counts", &passes, &[part], exec, |read| {
                let counts = read.chunks_exact(4).map(|n| u64::from(bytemuck::pod_read_unaligned::<u32>(n)));
                found = counts.collect();
            })?;
        }
        found.resize(values, 0);
        Ok(found)
    }

    fn label(&mut self, args: &Labelled<'_>, exec: &Exec) -> Result<SpillVec<u16>, Error> {
        let mut names = self.bring_stored(args.voxels)?;
        names.extend(args.mask.map(|_| "MASKED"));
        let pipeline = self.pipeline("segment/label.wgsl", &names)?;
        let mask = self.mask(args.mask)?;
        let table = match args.table() {
            Some(table) => self.gpu.upload("the table of labels", bytemuck::cast_slice(&table))?,
            None => self.gpu.upload("the cuts", bytemuck::cast_slice(&cuts(args)))?,
        };
        let mut labels = exec.bulk("the labels", args.voxels.len())?;
        let quads = args.voxels.len().div_ceil(4);
        let parts: Vec<[usize; 2]> = self.pieces(quads).into_iter().flat_map(smaller).collect();
        let most = parts.iter().map(|[first, end]| end - first).max().unwrap_or(1);
        let made = self.gpu.room("the labels", 8 * most as u64, RESULT)?;
        for [first, end] in parts {
            let pass = Pass {
                pipeline: &pipeline,
                numbers: vec![first as u32, (end - first) as u32, args.cuts.len() as u32, u32::from(NO_DATA)],
                rooms: self
                    .volume
                    .iter()
                    .map(|kept| &kept.room)
                    .chain([&table, &made])
                    .chain(&mask)
                    .collect(),
                groups: (end - first).div_ceil(LANES),
            };
            let part = Part { room: &made, from: 0, bytes: 8 * (end - first) as u64 };
            let to = 4 * first..labels.len().min(4 * end);
            self.desk.make(&self.gpu, "labels", &[pass], &[part], exec, |read| {
                let to: &mut [u8] = bytemuck::cast_slice_mut(&mut labels[to]);
                to.copy_from_slice(&read[..to.len()]);
            })?;
        }
        Ok(labels)
    }
}

/// A part in parts that are read at once.
fn smaller([first, end]: [usize; 2]) -> Vec<[usize; 2]> {
    (first..end).step_by(READ_QUADS).map(|first| [first, end.min(first + READ_QUADS)]).collect()
}

/// Of floats the ranks of the cuts, and the labels. A number is at or above a cut where it is at or above the least number of its type that is.
fn cuts(args: &Labelled<'_>) -> Vec<u32> {
    let least = |cut: f64| {
        let near = cut as f32;
        if f64::from(near) < cut { near.next_up() } else { near }
    };
    let ranks = args.cuts.iter().map(|cut| rank(args.voxels.voxel_type(), f64::from(least(*cut))));
    let mut words: Vec<u32> = ranks.chain(args.ids.iter().map(|id| u32::from(*id))).collect();
    // A label more than there are cuts.
    words.resize(2 * args.cuts.len() + 1, u32::from(NO_DATA));
    words
}
