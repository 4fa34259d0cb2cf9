//! The adapters: each stage crate's function behind the [`Stage`](crate::Stage) trait.

mod clip;
mod combine;
mod drawn;
mod grid_of;
mod import;
mod import_field;
mod imported_lattice;
mod labels_of;
mod lattice_parts;
mod onto;
mod operand;

use ivd_artefact::Kind;
use ivd_core::op::{Slot, schema_of};
use ivd_lattice::extract::{self, LatticeFigures};

use crate::Facts;

pub use clip::Clip;
pub use combine::Combine;
pub use drawn::ImportDrawn;
pub use grid_of::GridTaken;
pub use import::{
    IMPORT, Import, ImportFigures, ImportLabels, ImportLabelsFigures, ImportMask, ImportMaskFigures,
    ImportSource, ImportTransfer, ImportTransferFigures,
};
pub use import_field::{ImportField, ImportFieldFigures};
pub use imported_lattice::ImportedLattice;
pub use ivd_field::clip::ClipFigures;
pub use ivd_field::combine::CombineFigures;
pub use labels_of::{ImportLabelsOf, LabelsOfFigures};
pub use lattice_parts::part_lattices;
pub use onto::{PutOnto, PutOntoFigures};
pub use operand::ImportOperand;

/// Facts of what gives a lattice in place of the stage that cuts one, with a revision of its own.
fn lattice_facts(revision: u32, inputs: &'static [Slot]) -> Facts {
    Facts {
        name: extract::STAGE.name,
        revision,
        inputs,
        output: Some(Kind::Lattice),
        figures: schema_of::<LatticeFigures>,
    }
}
