//! Model-fitting lattices: the closed triangle mesh around a part of a volume, at full and at reduced resolution.
//!
//! - [`extract`] cuts a [`Lattice`](ivd_core::Lattice) out of a volume: marching cubes whose result is a closed
//!   2-manifold for any field.
//! - [`refine`] keeps a subset of its vertices.
//! - [`repair`] removes small components and slivers of it.
//! - [`figures`] counts what can be counted about a mesh: edges, components, Euler characteristic, defects.
//! - [`import`] turns another program's mesh into a lattice.
#![forbid(unsafe_code)]

mod error;
pub mod extract;
pub mod figures;
pub mod import;
pub mod refine;

pub use error::Error;
pub use refine::repair;
