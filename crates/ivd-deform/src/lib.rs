//! Deformation: a lattice that moves, the voxels that follow, and the volume that comes of it.
//!
//! 1. [`spring::ring`] moves a lattice by its handles and gives a [`Motion`](ivd_core::Motion); so does
//!    [`mass_spring::solve`], as masses on springs. [`freeform::lattice`] does so without physics, or goes on from there.
//!    [`rigid`] keeps parts of it rigid, bones among soft tissue.
//! 2. [`map::octree`], [`map::biharmonic`] or [`map::fem`] carries the motion to the voxels, inside the lattice and round it, and gives a
//!    [`Displacement`](ivd_core::Displacement): forward and inverse, proven free of folds by [`certificate`].
//! 3. [`warp::volume`], [`warp::labels`] and [`warp::mask`] carry data through it. Only bricks that moved are visited.
//!
//! [`space`] displaces voxels without a lattice, or goes on from a displacement: deflectors, spatial transfer functions, chain mail, cuts.
//! [`combine`] combines deformed things, or things at rest: union, intersection, difference. [`clip`] throws a part of one away.
//!
//! [`class_volume::by_class`] tells what every class gains or loses.
//!
//! [`inverse::invert`] and [`certificate::certify`] also serve fields from elsewhere.
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, VoxelCoord, VoxelIndex, Voxels};
//! use ivd_deform::{map, spring, warp};
//! use ivd_lattice::extract::{ExtractParams, Iso, extract};
//!
//! // A ball of 10 mm, 100 inside and 0 outside.
//! let exec = Exec::default();
//! let grid = Grid::with_spacing([32; 3], [1.0; 3])?;
//! let inside = |i| VoxelCoord::from(grid.index(i)).0.add_scalar(-15.5).norm() < 10.0;
//! let voxels: Vec<u8> = (0..grid.len()).map(|i| if inside(i) { 100 } else { 0 }).collect();
//! let volume = Volume::new(grid, Voxels::from(voxels))?;
//! let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(50.0) }, &exec)?.lattice;
//!
//! // Its top is pulled up by 3 mm; the surface within 24 mm follows.
//! let handle = spring::Handle {
//!     at: spring::HandleAt::Pick([15.5, 15.5, 25.5]),
//!     action: spring::Action::Move([0.0, 0.0, 3.0]),
//!     radius: 24.0,
//! };
//! let solved = spring::ring(&lattice, &[handle], &[], &spring::RingParams::default(), &exec)?;
//! let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec)?;
//! let mapped = map::octree(&lattice, &octree, &solved.motion, 0, &map::OctreeParams::default(), &exec)?;
//! assert!(mapped.figures.min_det_j > 0.0);
//!
//! let warped = warp::volume(&volume, &mapped.displacement, &warp::WarpParams::default(), &exec)?;
//! let above = VoxelIndex([15, 15, 27]);
//! assert_eq!((volume.value(above), warped.output.value(above)), (0.0, 100.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![deny(unsafe_code)]

pub mod certificate;
pub mod class_volume;
pub mod clip;
pub mod combine;
pub mod deform;
mod direction;
mod error;
pub mod freeform;
pub mod inverse;
pub mod map;
pub mod mass_spring;
pub mod rigid;
mod sampler;
mod simd;
pub mod space;
pub mod spring;
pub mod warp;

#[cfg(test)]
mod fixtures;

pub use error::Error;
