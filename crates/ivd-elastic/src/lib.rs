//! Elastic material on the cells of an octree, and the displacement at which its forces are in equilibrium.
//!
//! ```text
//! u minimises  ∫ W(x, I + ∇u) + pulls and loads,   u as prescribed where it is prescribed,   u = 0 on the border of Ω
//! ```
//!
//! - `W` is the compressible neo-Hookean energy of [`Lame`], so rotations cost no energy.
//! - [`Cells`] cut Ω, a union of balls, into hexahedra: the leaves of a 2:1 balanced octree, fine where it is asked and at borders between
//!   kinds of matter. Nodes that hang on a coarser cell take its values, so that the field is continuous ([`Mesh`]). Every node lies at a
//!   voxel's centre.
//! - A [`Body`] has eight Gauss points in a cell, Lamé's constants at each the mean over its octant. Cells that aren't wholly in Ω are left
//!   out and their nodes held; the end of the grid has natural boundary conditions.
//! - [`Body::balance`] is Newton's method with a line search that keeps `J > 0` at the Gauss points.
//!
//! Trilinear displacements lock as ν → 1/2, hence ν ≤ 0.45.
//!
//! Sources: Bonet & Wood 2008 (the law); Nocedal & Wright 2006 (Newton's method with conjugate gradients).
//!
//! ```
//! use ivd_core::{Exec, Grid, VoxelIndex};
//! use ivd_elastic::{Body, Cells, Hexahedron, Lame, Medium};
//! use nalgebra::Vector3;
//!
//! struct Gel;
//! impl Medium for Gel {
//!     fn at(&self, _: Vector3<f64>) -> Lame {
//!         Lame::new(1.0, 0.4)
//!     }
//!     fn kind(&self, _: VoxelIndex) -> Option<u16> {
//!         None
//!     }
//!     fn has_kinds(&self) -> bool {
//!         false
//!     }
//! }
//!
//! // A ball of gel in which one node is moved by 0.5 mm and held there.
//! let exec = Exec::default();
//! let grid = Grid::with_spacing([33; 3], [1.0; 3])?;
//! let cells = Cells::new(&grid, vec![(Vector3::repeat(16.0), 14.0)], Some(2), 8.0);
//! let mesh = cells.mesh(&[Vector3::repeat(16.0)], &Gel, &exec)?;
//! let matter = cells.matter(&mesh, &Gel);
//! let mut body = Body::new(mesh, Hexahedron::new(&cells.edges()), matter, vec![]);
//! let node = body.mesh.nodes.iter().position(|n| cells.voxel(n.map(f64::from)) == Vector3::repeat(16.0)).unwrap();
//! body.mesh.held[node] = true;
//! let mut u = vec![[0.0; 3]; body.mesh.nodes.len()];
//! u[node] = [0.5, 0.0, 0.0];
//! assert!(body.balance(&mut u, 1e-6, 20, &exec)?.reached);
//! # Ok::<(), ivd_core::Error>(())
//! ```

#![deny(unsafe_code)]

mod cells;
mod conjugate;
mod course;
mod material;
mod mesh;
mod newton;
mod relax;
mod slopes;
mod system;
mod tangent;
#[cfg(test)]
mod tests;
mod tissue;
mod tree;
mod vectors;

pub use cells::{Cells, Medium};
pub use course::{Arrival, Course};
pub use material::{Hexahedron, Lame, Matter};
pub use mesh::{Mesh, weights};
pub use newton::Balance;
pub use slopes::Corners;
pub use system::{Body, Pull};
pub use tissue::{FLESH, Tissue};
pub use tree::Cell;
pub use vectors::Triple;
