//! Segmentation: every voxel gets the class that its value belongs to.
//!
//! - [`kmvs`] (k-means volume segmentation) finds the K classes of least inertia. On intensity alone this has an exact
//!   answer, and this crate gives it: the **global** optimum, not what some start happened to reach.
//!   With a weight for places, [`kmvs_spatial`] also tells parts of one value apart by where they lie (Lloyd's algorithm,
//!   exactly, over bricks of like voxels).
//! - [`msvs`] (mean-shift volume segmentation) finds the modes of the density of the values, or of places and values, and with
//!   them how many classes there are; [`msvs_kmvs`] lets `kmvs` make that many, or fewer.
//! - [`emvs`] (expectation-maximisation volume segmentation) fits a mixture of normal densities, on request with coupled
//!   neighbours, a bias field, or over places too.
//! - [`region_tree`] (hierarchical volume segmentation) grows a tree of merges of neighbouring parts, and [`cut`] makes any number
//!   of classes of it without growing it again.
//! - [`threshold`] cuts at given values. [`tidy`] removes specks, whatever found them.
//!
//! All give a [`Segmentation`]: labels (0 is no data, 1…K in the order of the class means, or of their sizes by [`tidy`]) with the classes' means,
//! spreads, sizes and the values where neighbouring classes meet.
//!
//! How `kmvs` works: an 8 or 16 bit volume is counted into a histogram, in parallel; the optimal cuts of the histogram come
//! from dynamic programming with divide and conquer, in exact integers; a look-up table labels the voxels. Each voxel is
//! touched twice. Other types are sorted, and only the places where an optimal cut can still lie are looked at more closely,
//! until none is left (see the `kmvs` module).
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, Voxels};
//! use ivd_segment::{KmvsParams, kmvs};
//!
//! let grid = Grid::with_spacing([3, 2, 1], [1.0; 3]).unwrap();
//! let volume = Volume::new(grid, Voxels::from(vec![0_u8, 1, 100, 103, 2, 101])).unwrap();
//! let found = kmvs(&volume, None, &KmvsParams { k: 2, ..KmvsParams::default() }, &Exec::default()).unwrap();
//! assert_eq!(found.labels.ids(), [1, 1, 2, 2, 1, 2]);
//! assert_eq!(found.labels.classes()[0].mean, 1.0);
//! assert_eq!(found.gap, 0.0);
//! ```
#![forbid(unsafe_code)]

mod classes;
mod emvs;
mod figures;
mod groups;
mod histogram;
mod hvs;
mod kmvs;
mod labelling;
mod moments;
mod msvs;
pub mod plan;
mod segmentation;
mod selection;
mod stage;
mod threshold;
mod tidy;
mod wide;

pub use classes::measured;
pub use emvs::{BiasField, BicPoint, Covariance, Emvs, EmvsParams, Mixture, emvs, emvs_with_posteriors};
pub use figures::{
    AnyFigures, ClassFigures, CommonFigures, CutFigures, Figures, MixtureFigures, MixturePoint, ModesFigures,
    NoFigures, ProposalFigures, SpatialFigures, TreeFigures,
};
pub use hvs::{CutParams, Dendrogram, Hvs, HvsParams, Leaf, Ranking, cut, dendrogram, region_tree};
pub use ivd_core::Error;
pub use ivd_core::Linkage;
pub use kmvs::{KmvsParams, SpatialKmvs, kmvs, kmvs_spatial};
pub use msvs::chain::{Chain, ChainParams, ChainPoint, ChainTimes, msvs_kmvs};
pub use msvs::{Kernel, Mode, Msvs, MsvsParams, msvs};
pub use segmentation::Segmentation;
pub use selection::Within;
pub use stage::{Find, Grown, Hierarchy, STAGE, Scanned, Tidied};
pub use threshold::{ThresholdParams, threshold};
pub use tidy::{Order, TidyParams, tidy};
