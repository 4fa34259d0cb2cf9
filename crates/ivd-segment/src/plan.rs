//! The passes over all voxels as plain data: for backends other than the processor.

use ivd_core::{Error, Exec, Kernel, Mask, SpillVec, VoxelType, Voxels, with_voxels};

use crate::histogram::{self, Tabled, with_tabled};
use crate::labelling;

/// The pass that counts how often each stored value of 8 or 16 bits occurs, ascending by value.
pub struct Counting;

/// What is counted.
#[derive(Clone, Copy)]
pub struct Counted<'a> {
    /// Voxels of 8 or 16 bits.
    pub voxels: &'a Voxels,
    /// Those that count, where not all do.
    pub mask: Option<&'a Mask>,
}

impl<'a> Counted<'a> {
    /// Voxels that can be counted so; `None` of wider types.
    pub fn new(voxels: &'a Voxels, mask: Option<&'a Mask>) -> Option<Self> {
        let kind = voxels.voxel_type();
        (kind.is_integer() && kind.bytes() <= 2).then_some(Self { voxels, mask })
    }
}

impl Kernel for Counting {
    const NAME: &'static str = "segment/histogram";
    type Args<'a> = Counted<'a>;
    type Out = Vec<u64>;
    type Error = Error;

    fn on_processor(args: &Counted<'_>, exec: &Exec) -> Result<Vec<u64>, Error> {
        with_tabled!(args.voxels, slice => histogram::count(slice, args.mask, exec), else Ok(Vec::new()))
    }
}

/// The pass that gives each voxel its label by its value.
pub struct Labelling;

/// What is labelled: a value with `g` of the ascending `cuts` at or below it gets `ids[g]`; what is no data or outside the mask gets
/// [`NO_DATA`](ivd_core::NO_DATA).
#[derive(Clone, Copy)]
pub struct Labelled<'a> {
    /// Voxels.
    pub voxels: &'a Voxels,
    /// Those that get a label, where not all do.
    pub mask: Option<&'a Mask>,
    /// Stored values, ascending.
    pub cuts: &'a [f64],
    /// A label more than there are cuts.
    pub ids: &'a [u16],
}

impl Labelled<'_> {
    /// The label of each value of a type of 8 or 16 bits, ascending; `None` of wider types.
    pub fn table(&self) -> Option<Vec<u16>> {
        let all = |count: usize, lowest: i64| {
            (0..count)
                .map(|slot| labelling::id_of((lowest + slot as i64) as f64, self.cuts, self.ids))
                .collect()
        };
        match self.voxels.voxel_type() {
            VoxelType::U8 => Some(all(u8::VALUES, u8::LOWEST)),
            VoxelType::I8 => Some(all(i8::VALUES, i8::LOWEST)),
            VoxelType::U16 => Some(all(u16::VALUES, u16::LOWEST)),
            VoxelType::I16 => Some(all(i16::VALUES, i16::LOWEST)),
            _ => None,
        }
    }
}

impl Kernel for Labelling {
    const NAME: &'static str = "segment/label";
    type Args<'a> = Labelled<'a>;
    type Out = SpillVec<u16>;
    type Error = Error;

    fn on_processor(args: &Labelled<'_>, exec: &Exec) -> Result<SpillVec<u16>, Error> {
        let mut labels = exec.bulk("the labels", args.voxels.len())?;
        if let Some(table) = args.table() {
            with_tabled!(args.voxels, slice => labelling::by_table(slice, args.mask, &table, &mut labels), else {});
        } else {
            with_voxels!(args.voxels, slice => labelling::by_cuts(slice, args, &mut labels));
        }
        Ok(labels)
    }
}
