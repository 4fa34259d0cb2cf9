//! The passes over all voxels as plain data: for backends other than the processor.

pub use crate::histogram::{Counted, Counting};
pub use crate::labelling::{Labelled, Labelling};
