//! The sections of a scene, in the order in which data flows. Every parameter of a stage has a key in its section.

mod input;
mod output;
mod window;

pub use input::{InputFiles, InputSection, RawSection};
pub use output::{MeshSpace, OutputSection, Picture};
pub(crate) use output::{OF_FRAMES, PICTURES, REPORT, SERIES, SIDE_BY_SIDE, WIPE, picture_file};
pub use window::{Body, Inside, Over, RulerSection, WindowSection};
