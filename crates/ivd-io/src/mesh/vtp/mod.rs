//! VTK's polygon data in XML.

mod array;
mod read;
mod write;
mod xml;

pub(super) use read::read;
pub(super) use write::{check, write};
