//! The sections of a scene, in the order in which data flows. Every parameter of a stage has a key in its section.

mod input;
mod output;

pub use input::{InputSection, RawSection};
pub use output::{MeshSpace, OutputSection, Picture};
