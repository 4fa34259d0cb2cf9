//! The adapters: each stage crate's function behind the [`Stage`](crate::Stage) trait.

mod atf;
mod boundary;
mod clip;
mod combine;
mod foreign;
mod import;
mod lattice;
mod parts;
mod refine;
mod render;
mod segment;
mod warp;

pub use atf::Atf;
pub use boundary::Boundary;
pub use clip::Clip;
pub use combine::Combine;
pub use foreign::ForeignLattice;
pub use import::{Import, ImportLabels, ImportSource};
pub use lattice::Lattice;
pub use parts::PartLattice;
pub use refine::Refine;
pub use render::{Difference, Render};
pub use segment::{KeepPosteriors, Method, Posteriors, Segment, SegmentTree};
pub use warp::Warp;

use serde::Serialize;
use serde_json::Value;

/// Parameters as JSON; plain structs always serialise.
fn json(params: &impl Serialize) -> Value {
    serde_json::to_value(params).expect("plain parameter structs serialise to JSON")
}

#[cfg(test)]
mod tests;
