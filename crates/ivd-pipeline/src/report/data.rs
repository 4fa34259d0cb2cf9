use std::collections::BTreeMap;
use std::sync::Arc;

use ivd_artefact::Artefact;
use ivd_core::{Image, TransferFunction};
use ivd_field::class_volume::ClassVolume;
use ivd_report::{MovedSlices, ResultSlices};

use crate::control::Decisions;

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
    /// Slices where something moves.
    pub(crate) moved: Option<MovedSlices>,
    /// Slices of what was clipped or combined, beside those of what it was made from.
    pub(crate) result: Option<ResultSlices>,
    /// What was decided while the scene ran.
    pub(crate) decisions: Decisions,
    /// What each class of voxels gains or loses.
    pub(crate) class_volumes: Vec<ClassVolume>,
    /// Small parts of the lattice that lie where something moves; `None` where nothing does, or no lattice is there.
    pub(crate) specks_moved: Option<u64>,
    /// Length of each moved vertex's displacement (mm).
    pub(crate) displacements: Vec<f64>,
}
