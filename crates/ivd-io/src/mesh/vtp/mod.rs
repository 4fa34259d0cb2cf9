//! VTK's polygon data in XML.

mod array;
mod document;
mod read;
mod write;

pub(super) use read::read;
pub(super) use write::{check, write};
