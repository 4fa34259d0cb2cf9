//! Lattices that move: by springs, as rigid parts, or by shapes.
//!
//! - [`handles`] says which vertices are moved, pulled or held.
//! - [`ring::solve`] moves a lattice by them and gives a [`Motion`](ivd_core::Motion); so does [`mass_spring::solve`], as masses on
//!   springs.
//! - [`elastic::solve`] moves the space round a lattice with it, as elastic matter.
//! - [`rigid`] keeps parts of a lattice rigid, bones among soft tissue.
//! - [`freeform::lattice`] moves one without physics, or goes on from where a solver took it.
//! - [`deform`] is the stage that scenes and commands know.
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, VoxelCoord, Voxels};
//! use ivd_lattice::extract::{ExtractParams, Iso, extract};
//! use ivd_motion::handles::{Action, Handle, Anchor};
//! use ivd_motion::ring::{self, RingParams};
//!
//! // A ball of 10 mm, 100 inside and 0 outside.
//! let exec = Exec::default();
//! let grid = Grid::with_spacing([32; 3], [1.0; 3])?;
//! let inside = |i| VoxelCoord::from(grid.index(i)).0.add_scalar(-15.5).norm() < 10.0;
//! let voxels: Vec<u8> = (0..grid.len()).map(|i| if inside(i) { 100 } else { 0 }).collect();
//! let volume = Volume::new(grid, Voxels::from(voxels))?;
//! let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(50.0) }, &exec)?.lattice;
//!
//! // Its top is pulled up by 3 mm; the surface within 8 mm follows, and nothing beyond.
//! let top = Anchor::NearestTo([15.5, 15.5, 25.5]);
//! let handle = Handle { at: top, action: Action::Move([0.0, 0.0, 3.0]), radius: 8.0 };
//! let solved = ring::solve(&lattice, &[handle], &[], &RingParams::default(), &exec)?;
//! assert_eq!(solved.max_displacement_mm, 3.0);
//! assert!(solved.vertices_moved < lattice.keys().len() / 4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![deny(unsafe_code)]

mod carried;
pub mod deform;
pub mod elastic;
pub mod freeform;
pub mod handles;
pub mod mass_spring;
pub mod rigid;
pub mod ring;

/// What can go wrong here is what any stage can meet.
pub use ivd_core::Error;
