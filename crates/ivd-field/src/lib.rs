//! Displacement fields: proofs that they don't fold, their inverses, and what is carried through them.
//!
//! - [`certificate::certify`] proves that a field is free of folds; [`inverse::invert`] finds where every voxel came from.
//! - [`warp::volume`], [`warp::labels`] and [`warp::mask`] carry data through a [`Displacement`](ivd_core::Displacement). Only bricks
//!   that moved are visited.
//! - [`given::displacement`] makes a displacement of one field, such as another program's.
//! - [`place::moved`] and [`place::at_rest`] take single places there and back.
//! - [`onto::labels`] and [`onto::mask`] put what was drawn on another grid onto that of a volume.
//! - [`combine`] combines deformed things, or things at rest: union, intersection, difference. [`clip`] throws a part of one away.
//! - [`class_volume::by_class`] tells what every class gains or loses.
//! - [`shape`] has the changes of space within a ball that move lattices and voxels alike.
//! - [`sampler`], [`vectors`], [`falloff`] and [`param`] are what makers of fields work with.
//!
//! ```
//! use ivd_core::{Displacement, Exec, FieldBricks, Grid, Volume, VoxelIndex, Voxels};
//! use ivd_field::{certificate, inverse, warp};
//!
//! // Everything moves along x by half a voxel more for each voxel: the left end stays.
//! let exec = Exec::default();
//! let grid = Grid::with_spacing([8; 3], [1.0; 3])?;
//! let vectors: Vec<[f32; 3]> = (0..512).map(|i| [0.5 * (i % 8) as f32, 0.0, 0.0]).collect();
//! let forward = FieldBricks::new([8; 3], vec![0], vectors.into())?;
//! let proof = certificate::certify(&forward, &grid, certificate::THIN, |_| true, &exec)?;
//! assert!(proof.holds() && proof.folded.is_empty());
//!
//! let inverse = inverse::invert(&forward, &grid, &exec)?;
//! assert_eq!(inverse.field.at(VoxelIndex([6, 4, 4])), [-2.0, 0.0, 0.0]);
//! let displacement = Displacement::new(grid.clone(), forward, inverse.field)?;
//! let ramp: Vec<f32> = (0..512).map(|i| (i % 8) as f32).collect();
//! let volume = Volume::new(grid, Voxels::from(ramp))?;
//! let stretched = warp::volume(&volume, &displacement, &warp::WarpParams::default(), &exec)?;
//! assert_eq!(stretched.output.value(VoxelIndex([6, 4, 4])), 4.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![deny(unsafe_code)]

#[macro_use]
mod one_type;

pub mod certificate;
pub mod class_volume;
pub mod clip;
pub mod combine;
pub mod falloff;
#[cfg(any(test, feature = "fixtures"))]
pub mod fixtures;
pub mod given;
pub mod inverse;
pub mod lies;
pub mod onto;
pub mod param;
pub mod place;
pub mod sampler;
pub mod shape;
mod simd;
pub mod vectors;
pub mod warp;

/// What can go wrong here is what any stage can meet.
pub use ivd_core::Error;
