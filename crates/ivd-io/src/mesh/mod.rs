//! Mesh files: lattices for other programs, and meshes from them. PLY, OBJ, STL, GLB, VTP, by the file's ending.
//!
//! | ending | coordinates | axes | notes |
//! |---|---|---|---|
//! | `.ply` | f64, mm | RAS, or LPS on request; a comment says `SPACE=RAS` | each vertex carries its address: `voxel_x voxel_y voxel_z` and `element` |
//! | `.obj` | decimal, mm | the same | as many digits as an f64 needs to come back |
//! | `.stl` | f32, mm | the same, in its first 80 bytes | no shared vertices; far from the origin f32 rounds, see [`Written::rounding_mm`] |
//! | `.glb` | f32 relative to a node, mm; the root node turns to metres, y up, glTF's own | none to choose | far origins lose nothing |
//! | `.vtp` | f64, mm | LPS, where VTK and ITK have the volume, or RAS on request; the field `SPACE` says which | each vertex carries its address: `voxel` and `element` |
//!
//! 3D Slicer reads the words `SPACE=RAS` and `SPACE=LPS`, and takes a file without them for LPS.
//!
//! [`read()`] takes files of these formats from any program, in any of their encodings; what a format doesn't say (its unit,
//! which way its axes run) is taken as `docs/methods/mesh-files.md` tells. A [`Mesh`] becomes a lattice by
//! `ivd_lattice::import::lattice`.
//!
//! [`write_motion`] writes a lattice with its motion: `.glb` as morph targets with an animation, `.pvd` as a series of `.vtp`.
//!
//! A file is written beside its target and renamed; where the bytes would not change the target isn't touched.

mod error;
mod format;
mod glb;
mod motion;
mod obj;
mod parse;
mod placed;
mod ply;
mod read;
mod stl;
mod vtp;

pub use error::Error;
pub use format::Format;
pub use ivd_core::{Mesh, MeshAddress};
pub use motion::{members, write_motion};
pub use read::{read, read_bytes};

use std::path::Path;

use ivd_core::{Frame, Lattice};
use nalgebra::Vector3;

use format::format_of;
use placed::Placed;

use crate::{FileError, Space};

/// What became of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Written {
    /// Whether the file is new or changed; `false` where it held the same bytes already.
    pub touched: bool,
    /// Largest difference between a coordinate and what the format holds of it (mm).
    pub rounding_mm: f64,
}

/// Writes a lattice at rest in the format of the file's ending.
///
/// - `space`: the file's axes; the format's own where none are given.
///
/// # Errors
/// [`Error::Format`] for an ending that isn't known, [`Error::Unwritable`] where the format can't hold the lattice,
/// [`FileError::Unwritable`] for axes of a format that lays them down (`.glb`), [`FileError::Io`] where writing failed. The target is
/// then as it was.
pub fn write(path: &Path, lattice: &Lattice, space: Option<Space>) -> Result<Written, Error> {
    write_mesh(path, lattice, lattice.positions(), &[], space)
}

/// Writes a lattice whose vertices are displaced.
///
/// - `displacement`: of each vertex (mm), RAS, shape `[vertex_count, 3]`.
/// - `space`: as for [`write()`].
///
/// # Errors
/// As [`write()`]; [`ivd_core::Error::Inconsistent`] where the displacement's length isn't the lattice's or a vector
/// isn't finite.
pub fn write_deformed(
    path: &Path,
    lattice: &Lattice,
    displacement: &[[f64; 3]],
    space: Option<Space>,
) -> Result<Written, Error> {
    write_mesh(path, lattice, deformed(lattice, displacement)?, &[], space)
}

/// Where the vertices are after a displacement (mm), RAS.
fn deformed(lattice: &Lattice, displacement: &[[f64; 3]]) -> Result<Vec<Vector3<f64>>, Error> {
    let bad =
        |problem| Error::from(ivd_core::Error::Inconsistent { what: "displacement of a lattice", problem });
    if displacement.len() != lattice.keys().len() {
        return Err(bad(format!("{} vectors for {} vertices", displacement.len(), lattice.keys().len())));
    }
    if let Some(at) = displacement.iter().position(|d| !d.iter().all(|c| c.is_finite())) {
        return Err(bad(format!("the vector of vertex {at} is not finite")));
    }
    let moved = |(position, d): (Vector3<f64>, &[f64; 3])| position + Vector3::from(*d);
    Ok(lattice.positions().into_iter().zip(displacement).map(moved).collect())
}

/// Writes a lattice with its vertices at `positions` (mm), RAS, moving by `frames` from there.
fn write_mesh(
    path: &Path,
    lattice: &Lattice,
    mut positions: Vec<Vector3<f64>>,
    frames: &[Frame],
    space: Option<Space>,
) -> Result<Written, Error> {
    let format = format_of(path)?;
    let space = format.space(path, space)?;
    for p in &mut positions {
        *p = space.turn((*p).into()).into();
    }
    let mesh = &Placed { lattice, positions, space, frames };
    let rounding_mm = match format {
        Format::Ply => ply::check(mesh)?,
        Format::Obj => 0.0,
        Format::Stl => stl::check(mesh)?,
        Format::Glb => glb::check(mesh)?,
        Format::Vtp => vtp::check(mesh)?,
    };
    let failed = |action, source| Error::from(FileError::io(action, path, source));
    let touched = ivd_fs::replace(path, failed, |file| {
        match format {
            Format::Ply => ply::write(file, mesh),
            Format::Obj => obj::write(file, mesh),
            Format::Stl => stl::write(file, mesh),
            Format::Glb => glb::write(file, mesh),
            Format::Vtp => vtp::write(file, mesh),
        }
        .map_err(|source| failed("write", source))
    })?;
    Ok(Written { touched, rounding_mm })
}

#[cfg(test)]
mod tests;
