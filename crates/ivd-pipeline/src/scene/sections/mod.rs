//! The sections of a scene, in the order in which data flows. Every parameter of a stage has a key in its section.

mod boundary;
mod input;
mod lattice;
mod map;
mod output;
mod picture;
mod segment;

pub use boundary::{BoundarySection, ClassChoice, ClassWord};
pub use input::{InputSection, RawSection};
pub use lattice::{FixSection, IsoChoice, IsoWord, LatticeSection, RefineMethod, RefineSection};
pub use map::{WarpOrder, WarpSection};
pub use output::{OutputSection, Picture};
pub use picture::{AtfSection, Projection, RenderMode, RenderSection};
pub use segment::{
    AutoWord, ClassCount, ClassOrder, CovarianceChoice, KernelChoice, LinkageChoice, RankingChoice,
    SegmentMethod, SegmentSection,
};
