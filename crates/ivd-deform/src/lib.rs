//! Lattice deformation, displacement mapping, inverse and warp.
#![forbid(unsafe_code)]

pub mod certificate;
mod error;
pub mod inverse;
pub mod map;
mod sampler;
pub mod spring;
pub mod warp;

#[cfg(test)]
mod fixtures;

pub use error::Error;
