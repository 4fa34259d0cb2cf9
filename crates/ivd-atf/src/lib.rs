//! A transfer function made from a segmentation, with nothing to tune by hand.
//!
//! A volume picture needs to know which values are seen, in which colour and how densely. [`transfer`] reads that from
//! the classes of a segmentation (thesis 4.2.2): each class gives one entry, whose
//!
//! - **hue** follows the order of the class means through a palette that colour-blind readers can tell apart,
//! - **edges** lie where its Gaussian posterior meets that of its neighbours in intensity, softened by the spread; as the
//!   posterior weighs a class by its voxel count, a class of many voxels is *wider*,
//! - **opacity** grows with the strength of its border (mean gradient at the border voxels) and falls with its size,
//! - and the class that is air is clear.
//!
//! A table over the value alone can't split two classes of equal value, so that the result has the class label as its
//! second axis: one row for each class, and row 0, the union of all, for pictures without labels.
//!
//! - `statistics`: one pass over labels and values: count, mean, spread, border strength, contact with the volume's sides.
//! - `edges`: posterior crossings and the soft windows between them.
//! - `palette`: colours.
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
//! assert_eq!(built.entries, 2);
//! let ball = built.transfer.row(2);
//! assert!(built.transfer.sample(ball, 200.0)[3] > 0.1, "the ball is seen");
//! assert_eq!(built.transfer.sample(0, 10.0)[3], 0.0, "air is clear");
//! # Ok::<(), ivd_core::Error>(())
//! ```
#![forbid(unsafe_code)]

mod build;
mod edges;
mod error;
mod isovalue;
mod palette;
mod params;
mod statistics;

pub use build::{Built, transfer};
pub use error::Error;
pub use isovalue::from_isovalue;
pub use palette::colour as class_colour;
pub use params::{Figures, Inputs, Params, STAGE};
