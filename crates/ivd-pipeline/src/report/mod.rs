//! `report.html`: one self-contained page with pictures, histogram, classes, lattice figures, displacement and stages.
//!
//! What it shows is chosen here; [`ivd_report`] draws it.

mod asked;
mod colours;
mod data;
mod deformation;
mod page;
mod plain;
mod recorded;
mod segmentation;
mod summary;

use ivd_core::{Displacement, Image, Labels, Lattice, Motion, TransferFunction, Volume};
use ivd_lattice::repair::small_components;
use nalgebra::Vector3;

use crate::Error;
use crate::scene::Scene;
use colours::class_rgb;

pub(crate) use data::ReportData;
pub(crate) use page::html;
pub(crate) use summary::{input, remark};

/// Raised whenever the same data gives another page.
pub(crate) const REVISION: u32 = 12;

/// Displacement (mm) of the vertices that move, in the last frame.
pub(crate) fn motion_lengths(motion: &Motion) -> Vec<f64> {
    let last = motion.frames().last();
    let lengths = last.into_iter().flat_map(|f| &f.displacement[..]).map(|&d| Vector3::from(d).norm());
    lengths.filter(|length| *length > 0.0).collect()
}

/// Share of the largest part's volume below which others are told as small.
const SMALL: f64 = 0.01;

/// Small parts of a lattice with a vertex in a voxel that moves.
pub(crate) fn specks_moved(lattice: &Lattice, displacement: &Displacement) -> u64 {
    let (grid, field) = (displacement.grid(), displacement.forward());
    let moves = |vertex: usize| {
        let voxel = grid.nearest_voxel(grid.voxel(lattice.world(vertex)).0);
        voxel.is_some_and(|voxel| field.at(voxel) != [0.0; 3])
    };
    small_components(lattice, SMALL, moves)
}

/// Values that are black and white in slices: those that the scene says windows show, else those of soft tissue, where a volume has it in Hounsfield units.
pub(crate) fn slice_window(scene: &Scene, volume: &Volume) -> Option<[f64; 2]> {
    let said = scene.window.as_ref().and_then(|window| window.values);
    said.or_else(|| ivd_atf::soft_tissue_window(volume))
}

/// The middle slices of a labelling, coloured as in pictures by a transfer function.
///
/// # Errors
/// Those of a picture's constructor.
pub(crate) fn class_slices(
    labels: &Labels,
    transfer: Option<&TransferFunction>,
) -> Result<Vec<Image>, Error> {
    Ok(ivd_report::class_slices(labels, colour_of(labels, transfer))?)
}

/// The colour of a class by its place in the list of labels, as in pictures by a transfer function.
pub(crate) fn colour_of<'a>(
    labels: &'a Labels,
    transfer: Option<&'a TransferFunction>,
) -> impl Fn(usize) -> [u8; 3] + 'a {
    move |rank| class_rgb(rank, labels.classes()[rank].id, transfer)
}
