//! Volume files in and out.
//!
//! [`read`] takes any volume that scanners, simulations and research tools write and gives a
//! [`Volume`](ivd_core::Volume): the stored voxels as they are, slope and intercept beside them, and the grid that
//! places them in the world (millimetres, RAS). [`write()`] is its counterpart, by the file's ending.
//! [`sources`] lists the files that a volume is made of, for whoever wants to know whether they changed.

mod axes;
mod bounded;
mod components;
mod data;
pub mod dicom;
mod error;
mod field;
mod foreign;
mod frames;
mod given_field;
mod metaimage;
mod nifti;
mod nrrd;
mod orientation;
mod raw;
mod read;
mod replace;
pub mod stack;
mod stored;
mod suspect_order;
mod text_header;
mod values;
pub mod vti;
mod write;

pub use crate::order::ByteOrder;
pub use axes::VoxelAxes;
pub use error::{Error, Offer, OfferedSeries};
pub use field::{FieldDirection, write_field};
pub use given_field::{GivenField, read_field};
pub use raw::RawLayout;
pub use read::{ReadOptions, read, sources};
pub use replace::Written;
pub use write::write;
