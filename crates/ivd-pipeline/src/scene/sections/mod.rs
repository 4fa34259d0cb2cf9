//! The sections of a scene, in the order in which data flows. Every parameter of a stage has a key in its section.

mod boundary;
mod deform;
mod input;
mod lattice;
mod map;
mod output;
mod picture;
mod rigid;
mod shape;
mod space;

pub use boundary::{BoundarySection, ClassChoice, ClassWord};
pub use deform::{CourseChoice, DeformSection, FixSection, HandleSection, MaterialSection, Solver};
pub use input::{InputSection, RawSection};
pub use lattice::{IsoChoice, IsoWord, LatticeSection, RefineMethod, RefineSection};
pub use map::{WarpOrder, WarpSection};
pub use output::{OutputSection, Picture};
pub use picture::{AtfSection, Projection, RenderMode, RenderSection};
pub use rigid::RigidSection;
pub use shape::{ShapeKind, ShapeSection};
pub use space::{CurveOver, CurveWay, LinkSection, SpaceSection, StepKind, StepSection};
