//! Stanford's polygon file format (Turk 1994).

mod header;
mod read;
mod write;

pub(super) use read::read;
pub(super) use write::{check, write};
