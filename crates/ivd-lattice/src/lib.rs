//! Model-fitting lattices: the closed triangle mesh around a part of a volume, at full and at reduced resolution.
//!
//! - [`extract`] cuts a [`Lattice`](ivd_core::Lattice) out of a volume: marching cubes whose result is a closed
//!   2-manifold for any field.
//! - [`refine`] keeps a subset of its vertices.
//! - [`repair`] removes small components and slivers of it.
//! - [`figures`] counts what can be counted about a mesh: edges, components, Euler characteristic, defects.
//! - [`foreign`] turns another program's mesh into a lattice.
#![forbid(unsafe_code)]

mod error;
pub mod extract;
pub mod figures;
pub mod foreign;
pub mod refine;
pub mod repair;

pub use error::Error;
