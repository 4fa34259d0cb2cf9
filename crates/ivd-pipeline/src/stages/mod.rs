//! The adapters: each stage crate's function behind the [`Stage`](crate::Stage) trait.

mod clip;
mod combine;
mod foreign;
mod import;
mod parts;

pub use clip::Clip;
pub use combine::Combine;
pub use foreign::ForeignLattice;
pub use import::{Import, ImportLabels, ImportSource};
pub use parts::part_lattices;

use serde::Serialize;
use serde_json::Value;

/// Parameters as JSON; plain structs always serialise.
fn json(params: &impl Serialize) -> Value {
    serde_json::to_value(params).expect("plain parameter structs serialise to JSON")
}
