//! `report.html`: one self-contained page with pictures, histogram, classes, lattice figures, displacement and stages.
//!
//! What it shows is chosen here; [`ivd_report`] draws it.

mod deformation;
mod page;
mod segmentation;

use std::collections::BTreeMap;
use std::sync::Arc;

use ivd_artefact::Artefact;
use ivd_core::{Image, Labels, Motion, TransferFunction, srgb};
use ivd_field::class_volume::ClassVolume;
use nalgebra::Vector3;

use crate::Error;
use crate::control::Decisions;

pub(crate) use page::html;

/// Raised whenever the same data gives another page.
pub(crate) const REVISION: u32 = 6;

/// What the report shows beyond the stages' records.
#[derive(Debug, Default)]
pub(crate) struct ReportData {
    /// Pictures by name; packed once the page is made.
    pub(crate) pictures: BTreeMap<String, Arc<Artefact>>,
    /// The transfer function, for the histogram.
    pub(crate) transfer: Option<TransferFunction>,
    /// The volume at rest, for the histogram.
    pub(crate) volume: Option<Arc<Artefact>>,
    /// Its middle slices, coloured by class.
    pub(crate) class_slices: Vec<Image>,
    /// What was decided while the scene ran.
    pub(crate) decisions: Decisions,
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

/// The middle slices of a labelling, coloured.
///
/// # Errors
/// Those of a picture's constructor.
pub(crate) fn class_slices(labels: &Labels) -> Result<Vec<Image>, Error> {
    Ok(ivd_report::class_slices(labels, class_rgb)?)
}

/// Colour of a class, by its place in the order of the means.
fn class_rgb(rank: usize) -> [u8; 3] {
    ivd_atf::class_colour(rank).map(srgb::byte)
}

/// The same as CSS.
fn class_colour(rank: usize) -> String {
    ivd_report::html::css_colour(class_rgb(rank))
}
