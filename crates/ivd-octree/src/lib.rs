//! The octree of a lattice: what lies inside, and which lattice point is nearest.
//!
//! - [`inside`] tells for every voxel whether its centre lies inside the closed lattice, exactly.
//! - [`build`] makes the linear Morton [`Octree`](ivd_core::Octree): homogeneous leaves inside and outside, and small
//!   leaves that list the triangles which meet their box.
//! - [`prepare`] makes a [`NearestIndex`] of both, which finds the nearest lattice point of any place, exactly and in
//!   world millimetres, whatever the spacing and direction of the grid.
//!
//! ```
//! use ivd_core::{ElementKey, Exec, Grid, Lattice};
//! use nalgebra::Vector3;
//!
//! // An octahedron round the middle voxel of 3 × 3 × 3, its corners on the middle of six grid edges.
//! let dims = [3, 3, 3];
//! let mut corners = vec![];
//! for axis in 0..3 {
//!     for far in 0..2 {
//!         let (mut padded, mut place) = ([2, 2, 2], [0.0; 3]);
//!         padded[axis] -= 1 - far;
//!         place[axis] = 0.5;
//!         corners.push((ElementKey::new(dims, padded, axis as u8), place, 2 * axis + far));
//!     }
//! }
//! corners.sort_by_key(|c| c.0);
//! let at = |corner| corners.iter().position(|c| c.2 == corner).unwrap() as u32;
//! let triangles = (0..8).map(|o: usize| {
//!     let (x, y, z) = (at(o & 1), at(2 + (o >> 1 & 1)), at(4 + (o >> 2)));
//!     if o.count_ones() % 2 == 1 { [x, y, z] } else { [x, z, y] }
//! });
//! let (keys, places) = (corners.iter().map(|c| c.0).collect(), corners.iter().map(|c| c.1).collect());
//! let grid = Grid::with_spacing(dims, [1.0, 1.0, 2.0])?;
//! let lattice = Lattice::new(grid, keys, places, triangles.collect())?;
//!
//! let exec = Exec::default();
//! assert_eq!(ivd_octree::inside(&lattice, &exec)?.count(), 1);
//! let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec)?;
//! let index = ivd_octree::prepare(&lattice, &octree)?;
//! let nearest = index.nearest(Vector3::new(1.0, 1.0, 9.0), f64::INFINITY).unwrap();
//! assert_eq!((nearest.point, nearest.distance_mm), (Vector3::new(1.0, 1.0, 3.0), 6.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod build;
mod error;
mod inside;
mod nearest;
mod params;
mod stage;

pub use build::build;
pub use error::Error;
pub use inside::{inside, inside_box};
pub use nearest::{Nearest, NearestIndex, prepare, prepare_parts};
pub use params::Params;
pub use stage::{Figures, Inputs, STAGE};
