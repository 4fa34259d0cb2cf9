//! Lattice deformation, displacement mapping, inverse and warp.
#![forbid(unsafe_code)]

mod error;
pub mod spring;

pub use error::Error;
