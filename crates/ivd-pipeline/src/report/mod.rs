//! `report.html`: one self-contained page with pictures, histogram, classes, lattice figures, displacement and stages.

mod chart;
mod curve;
mod page;
mod slices;
mod tables;
mod tree;

use std::collections::BTreeMap;
use std::sync::Arc;

use ivd_artefact::Artefact;
use ivd_core::{Image, Motion, TransferFunction};
use ivd_field::class_volume::ClassVolume;
use nalgebra::Vector3;

pub(crate) use page::html;
pub(crate) use slices::class_slices;

/// Raised whenever the same material gives another page.
pub(crate) const REVISION: u32 = 6;

/// What the report shows beyond the stages' records.
#[derive(Debug, Default)]
pub(crate) struct Material {
    /// Pictures by name; packed once the page is made.
    pub(crate) pictures: BTreeMap<String, Arc<Artefact>>,
    /// The transfer function, for the histogram.
    pub(crate) transfer: Option<TransferFunction>,
    /// The volume at rest, for the histogram.
    pub(crate) volume: Option<Arc<Artefact>>,
    /// Its middle slices, coloured by class.
    pub(crate) class_slices: Vec<Image>,
    /// What the budget chose, a line each.
    pub(crate) budget: Vec<String>,
    /// What each class of voxels gains or loses.
    pub(crate) class_volumes: Vec<ClassVolume>,
    /// Length of each moved vertex's displacement (mm).
    pub(crate) displacements: Vec<f64>,
}

/// Displacement (mm) of the vertices that move, in the last frame.
pub(crate) fn motion_lengths(motion: &Motion) -> Vec<f64> {
    let last = motion.frames().last();
    let lengths = last.into_iter().flat_map(|f| &f.displacement[..]).map(|&d| Vector3::from(d).norm());
    lengths.filter(|length| *length > 0.0).collect()
}
