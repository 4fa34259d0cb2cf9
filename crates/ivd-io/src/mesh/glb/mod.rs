//! glTF 2.0 in its binary container (Khronos 2017).

mod json;
mod read;
mod write;

pub(super) use read::read;
pub(super) use write::{check, write};

/// Name of the node that turns what we wrote to metres with y up.
const ROOT: &str = "mm, RAS";
/// What `asset.generator` says in our files.
const GENERATOR: &str = "ivd";
