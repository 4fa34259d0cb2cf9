//! Isolation of one part of a scanned volume.
//!
//! [`component`] takes the voxels of a class (or those at or above a value), keeps one connected piece of them, the largest,
//! one that encloses that, or the one at a seed, closes its inner holes, and gives it as a [`Mask`](ivd_core::Mask): what the lattice is cut from.
//!
//! Connectivity: the part and its outside are connected through voxel faces (6 neighbours). A pocket that leaks to the outside only
//! through an edge or a corner is a hole: the lattice closes its surface there, and a part of one piece without holes gives a lattice of
//! one.
//!
//! [`active_surface`] finds the boundary of what it starts in, [`compete`](compete()) and [`part_of_seeds`] what seeds reach before others do,
//! [`active_contour`] a contour on a slice, and [`edit`] makes parts of parts.
//!
//! ```
//! use ivd_boundary::{ComponentParams, component};
//! use ivd_core::{Exec, Grid, Volume, Voxels};
//!
//! // A ring of nines round a one, and a nine on its own.
//! let grid = Grid::with_spacing([6, 5, 3], [1.0; 3]).unwrap();
//! let mut voxels = vec![0_u8; 90];
//! for z in 0..3 { for y in 1..4 { for x in 1..4 { voxels[x + 6 * (y + 5 * z)] = 9; } } }
//! voxels[2 + 6 * (2 + 5)] = 1;
//! voxels[5] = 9;
//! let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
//! let params = ComponentParams { above: Some(5.0), ..ComponentParams::default() };
//! let part = component(&volume, None, &params, &Exec::default()).unwrap();
//! assert_eq!((part.voxels, part.filled, part.components), (27, 1, 2));
//! ```
#![deny(unsafe_code)]

mod axes;
mod compete;
mod component;
mod contour;
mod edit;
mod error;
mod params;
mod part;
mod runs;
mod stage;
mod surface;

pub use compete::{CompeteParams, Seed, SeedInputs, Won, compete, part_of_seeds};
pub use component::{Component, component};
pub use contour::{Contour, ContourEnergy, ContourParams, SliceAxis, active_contour};
pub use edit::{EditInputs, EditParams, Edited, SetOperation, edit};
pub use error::Error;
pub use params::ComponentParams;
pub use stage::{BoundaryFigures, ContourInputs, Inputs, STAGE, SurfaceInputs};
pub use surface::{AreaMeasure, DataTerm, Distribution, StartShape, Surface, SurfaceParams, active_surface};
