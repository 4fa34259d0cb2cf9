//! Files of other programs: volumes ([`volume`]) and meshes ([`mesh`]), read and written.
#![forbid(unsafe_code)]

pub mod mesh;
#[cfg(test)]
#[path = "../tests/notes.rs"]
mod notes;
pub mod volume;
mod vtk;
