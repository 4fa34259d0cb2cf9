//! The sections of a scene, in the order in which data flows. Every parameter of a stage has a key in its section.

mod deform;
mod input;
mod output;
mod rigid;
mod shape;

pub use deform::{CourseChoice, DeformSection, FixSection, HandleSection, MaterialSection, Solver};
pub use input::{InputSection, RawSection};
pub use output::{OutputSection, Picture};
pub use rigid::RigidSection;
pub use shape::{ShapeKind, ShapeSection};
