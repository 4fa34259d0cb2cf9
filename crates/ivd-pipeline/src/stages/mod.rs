//! The adapters: each stage crate's function behind the [`Stage`](crate::Stage) trait.

mod clip;
mod combine;
mod foreign;
mod import;
mod lattice_parts;

pub use clip::{Clip, ClipFigures};
pub use combine::{Combine, CombineFigures};
pub use foreign::ForeignLattice;
pub use import::{IMPORT, Import, ImportFigures, ImportLabels, ImportLabelsFigures, ImportSource};
pub use lattice_parts::part_lattices;
