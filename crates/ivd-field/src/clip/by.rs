use ivd_core::op::{Failure, Fill, Values, unfit};
use ivd_core::{Displacement, Kind, Labels, Mask, Value as _};

/// What tags voxels.
#[derive(Debug, Clone, Copy)]
pub enum Tag<'a> {
    /// Those inside.
    Mask(&'a Mask),
    /// Those of [`ClipParams::class`](super::ClipParams::class), or of any label but 0.
    Labels(&'a Labels),
}

impl<'a> Fill<'a> for Tag<'a> {
    const KINDS: &'static [Kind] = &[Kind::Mask, Kind::Labels];

    fn fill(values: &Values<'a>, slot: &'static str) -> Result<Self, Failure> {
        let found = values.get(slot);
        let labels = || found.and_then(Labels::of).map(Self::Labels);
        let tag = found.and_then(Mask::of).map(Self::Mask).or_else(labels);
        tag.ok_or_else(|| unfit(slot, Self::KINDS, found))
    }
}

/// What a clip reads beside the data.
#[derive(Debug, Clone, Copy, Default)]
pub struct By<'a> {
    /// What tags voxels, on any grid.
    pub tag: Option<Tag<'a>>,
    /// What deformed the data, on their grid, where the part is one of rest space.
    pub displacement: Option<&'a Displacement>,
}
