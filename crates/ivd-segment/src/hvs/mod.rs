//! Hierarchical clustering: a tree of merges of neighbouring parts, and its cuts.

mod agglomerate;
mod cells;
mod cut;
mod dendrogram;
mod field;
mod figures;
mod forest;
mod graph;
mod grown;
mod merges;
mod single;
#[cfg(test)]
mod tests;
mod ward;

use ivd_core::op::Op as _;
use ivd_core::{Error, Exec, Linkage, Mask, Tree, Volume};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::moments::{Frame, Moments};
use crate::{Segmentation, Within};
pub use cut::{CutParams, Ranking, cut};
pub use dendrogram::{Dendrogram, Leaf, dendrogram};
use figures::Figures;
use grown::Grown;

/// Most voxels: an edge of the grid has a number of 32 bits.
const MOST_VOXELS: usize = u32::MAX as usize / 3;

/// How a tree of merged regions is grown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct HvsParams {
    /// How unlike two neighbouring parts are taken to be.
    pub linkage: Linkage,
    /// Neighbouring voxels whose values differ by at most this are one leaf, and so are those that a chain of such
    /// neighbours connects (quasi-flat zones). Without it: equal neighbours for single linkage; for Ward's
    /// criterion as many of its own cheapest merges as `max_regions` asks for.
    #[schemars(range(min = 0.0), extend("x-unit" = "real units", "x-knob" = "accuracy"))]
    pub alpha: Option<f64>,
    /// Most leaves for Ward's criterion. Each block of 16³ voxels keeps one at least. On a noisy head of 64³ voxels a
    /// tenth as many leaves as voxels cost 2 % more inertia at 50 classes than no cap, a fifth 1 %, and neither any at 6.
    #[schemars(range(min = 1), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub max_regions: usize,
    /// Which values count.
    #[serde(flatten)]
    pub within: Within,
}

impl Default for HvsParams {
    fn default() -> Self {
        Self { linkage: Linkage::Ward, alpha: None, max_regions: 200_000, within: Within::default() }
    }
}

/// A tree, and what it cost to grow it.
#[derive(Debug, Clone, PartialEq)]
pub struct Hvs {
    /// The merges; [`cut`] makes labels of them.
    pub tree: Tree,
    /// Leaves of the tree.
    pub regions: usize,
    /// The sum of squared deviations within the leaves as a share of that of all voxels, 0…1: what no cut can resolve.
    pub excess: f64,
    /// Merges that were cheaper than one before them: Ward's criterion among neighbours only can do that, and joining parts
    /// that touch nowhere. Their heights are those of the dearest merge before them.
    pub inversions: u64,
}

/// Grows the tree of merges of neighbouring parts of a volume, from single voxels up to the whole (agglomerative clustering
/// constrained to the grid's six neighbours). Distances weigh nothing: spacing plays no role, only who touches whom.
///
/// - [`Linkage::Single`]: the height of a merge is the smallest difference across its border, so the tree is the binary
///   partition tree of a minimum spanning forest (Najman, Cousty & Perret 2013). Exact; O(N α(N)) after sorting. Edges are
///   thinned out and sorted in parallel.
/// - [`Linkage::Ward`]: the height is what the merge adds to the sum of squared deviations (Ward 1963). Exact where zones of
///   equal neighbours are at most [`HvsParams::max_regions`], counted in blocks of 16³ voxels: a zone that reaches into
///   several counts in each, and is a leaf in each. Else the cheapest merges are found block by block first;
///   [`Hvs::excess`] says what they cost.
///
/// Ties go to the part that comes first in a fixed order of the voxels, so the tree doesn't depend on the number of
/// threads. Voxels that are no data, or outside `mask` or the range, belong to no leaf. Parts that touch nowhere are
/// merged last, as if the next in the order of their means touched.
///
/// # Errors
/// [`Error`]: a bad parameter, a mask on another grid, more than 1.4 · 10⁹ voxels, quasi-flat zones beyond
/// `max_regions` where `alpha` is given for Ward's criterion, the memory limit, or cancelled.
pub fn region_tree(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &HvsParams,
    exec: &Exec,
) -> Result<Hvs, Error> {
    params.check()?;
    check_size(volume)?;
    exec.run(|| Grown::of(volume, mask, params, exec)?.into_hvs(volume, exec))
}

/// Grows the tree of a volume and cuts it, without making the tree whole: what only a tree that is kept needs of its leaves is never held
/// beside its merges. The same as [`cut`] and [`dendrogram`] of [`region_tree`]; also the number of leaves.
///
/// # Errors
/// Those of [`region_tree`] and [`cut`].
pub(crate) fn classes(
    (volume, mask): (&Volume, Option<&Mask>),
    params: &HvsParams,
    at: &CutParams,
    most: usize,
    exec: &Exec,
) -> Result<(Segmentation, Option<Dendrogram>, usize), Error> {
    params.check()?;
    at.check()?;
    check_size(volume)?;
    exec.run(|| Grown::of(volume, mask, params, exec)?.cut(volume, at, most, exec))
}

/// As [`cut`] and [`dendrogram`] of a tree, the classes found once.
///
/// # Errors
/// Those of [`cut`].
pub(crate) fn drawn(
    tree: &Tree,
    params: &CutParams,
    most: usize,
    exec: &Exec,
) -> Result<(Segmentation, Option<Dendrogram>), Error> {
    exec.run(|| {
        let found = cut::classes_of(tree, params, exec)?;
        let dendrogram = dendrogram::of(&found, most);
        Ok((found.segment(&tree.grid, &tree.leaves, exec)?, dendrogram))
    })
}

fn check_size(volume: &Volume) -> Result<(), Error> {
    if volume.grid().len() <= MOST_VOXELS {
        return Ok(());
    }
    let problem =
        format!("{} voxels, a tree takes at most {MOST_VOXELS}; crop or resample it", volume.grid().len());
    Err(Error::Inconsistent { what: "volume", problem })
}

/// The share of the sum of squared deviations that lies within the leaves.
fn excess(figures: &Figures) -> f64 {
    let Some(squares) = &figures.squares else { return 0.0 };
    let means = (0..figures.counts.len()).map(|leaf| figures.means.get(leaf));
    let frame = frame(means.fold([f64::INFINITY, f64::NEG_INFINITY], |r, m| [r[0].min(m), r[1].max(m)]));
    let (mut whole, mut within) = (Moments::default(), Moments::default());
    for leaf in 0..figures.counts.len() {
        let (mean, count) = (figures.means.get(leaf), u64::from(figures.counts[leaf]));
        whole.add_spread(mean, count, squares[leaf], &frame);
        within.add_spread(frame.centre(), count, squares[leaf], &frame);
    }
    let share = within.inertia(&frame) / whole.inertia(&frame);
    if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
}

/// The frame of means between these two.
fn frame([low, high]: [f64; 2]) -> Frame {
    Frame::between(if low <= high { [low, high] } else { [0.0; 2] })
}
