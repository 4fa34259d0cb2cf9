//! A transfer function made from a segmentation, with nothing to tune by hand.
//!
//! A volume picture needs to know which values are visible, in which colour and how opaque. [`transfer`] reads that from
//! the classes of a segmentation (thesis 4.2.2): each class gives one entry, whose
//!
//! - **role** is background (transparent), material, or transition between two materials (with no colour or opacity of its own),
//! - **colour** looks like tissue, is one of eight that any eye tells apart, or goes by value,
//! - **edges** lie where its Gaussian posterior meets that of its neighbours in intensity, softened by the spread; as the
//!   posterior weighs a class by its voxel count, a class of many voxels is *wider*,
//! - **opacity** makes every material visible by what it would cover alone and how much of it lies in front.
//!
//! A table over the value alone can't split two classes of equal value, so the result has the class label as its
//! second axis: one row for each class, and row 0, the union of all, for pictures without labels. Where values tell all classes apart the
//! rows are the same.
//!
//! - `statistics`: one pass over labels and values: count, mean, spread, border strength, contact with the volume's sides.
//! - `range`: the values that the table is spread over.
//! - `reduced`, `structure`, `joined`: the volume in levels, in at most 256 samples an axis; faces between classes, slopes, noise; what is
//!   joined to the outside.
//! - `roles`: background, materials, transitions.
//! - `edges`, `mix`: posterior crossings, the soft windows between them, and which materials show at a value in a row.
//! - `bins`, `empty`, `rays`, `visibility`: kinds of samples, what rays meet, and the opacities that follow.
//! - `colour`: palettes, and how different colours look.
//! - `table`, `build`: the table and its entries; all of it together.
//! - `slopes`, `gradient`: a table by value and gradient, with the arcs of the boundaries found from the data.
//! - `params`, `figures`, `stage`: what is asked, what is reported, and the stage that scenes and commands see.
//!
//! A volume of which only an isovalue is known gets its transfer function from [`from_isovalue`].
//!
//! ```
//! use ivd_core::{Class, Exec, Grid, Labels, Volume, Voxels};
//!
//! // A bright ball in air.
//! let grid = Grid::with_spacing([16, 16, 16], [1.0; 3])?;
//! let inside = |i: usize| {
//!     let [x, y, z] = grid.index(i).0.map(|c| c as f64 - 7.5);
//!     x * x + y * y + z * z < 25.0
//! };
//! let voxels: Vec<u8> = (0..grid.len()).map(|i| if inside(i) { 200 } else { 10 }).collect();
//! let ids: Vec<u16> = (0..grid.len()).map(|i| if inside(i) { 2 } else { 1 }).collect();
//! let volume = Volume::new(grid.clone(), Voxels::from(voxels))?;
//! let labels = Labels::new(grid, ids.into(), vec![])?;
//!
//! let built = ivd_atf::transfer(&volume, &labels, &ivd_atf::Params::default(), &Exec::default()).unwrap();
//! assert_eq!(built.figures.entries, 2);
//! let ball = built.transfer.row(2);
//! assert!(built.transfer.sample(ball, 200.0)[3] > 0.1, "the ball is seen");
//! assert_eq!(built.transfer.sample(0, 10.0)[3], 0.0, "air is clear");
//! # Ok::<(), ivd_core::Error>(())
//! ```
#![forbid(unsafe_code)]

mod bins;
mod build;
mod built;
mod colour;
mod edges;
mod empty;
mod error;
mod figures;
mod gradient;
mod isovalue;
mod joined;
mod mix;
mod params;
mod range;
mod rays;
mod reduced;
mod roles;
mod slopes;
mod stage;
mod statistics;
mod structure;
mod table;
mod visibility;

pub use build::transfer;
pub use built::Built;
pub use colour::class_colour;
pub use error::Error;
pub use figures::{Boundary, ClosePair, Figures, MaterialVisibility};
pub use isovalue::from_isovalue;
pub use params::{Axes, Inputs, OpacityRule, Palette, Params, ValueScale};
pub use roles::{is_computed_tomography, matter_of_hounsfield, soft_tissue_window};
pub use stage::STAGE;
