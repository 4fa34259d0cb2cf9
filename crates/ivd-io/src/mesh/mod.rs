//! Mesh files: lattices for other programs, and meshes from them. PLY, OBJ, STL, GLB, VTP, by the file's ending.
//!
//! | ending | coordinates | notes |
//! |---|---|---|
//! | `.ply` | f64, world mm, RAS | each vertex carries its address: `voxel_x voxel_y voxel_z` and `element` |
//! | `.obj` | decimal, world mm, RAS | as many digits as an f64 needs to come back |
//! | `.stl` | f32, world mm, RAS | no shared vertices; far from the origin f32 rounds, see [`Written::rounding_mm`] |
//! | `.glb` | f32 relative to a node, mm; the root node turns to metres, y up | far origins lose nothing |
//! | `.vtp` | f64, world mm, LPS, where VTK and ITK have the volume | each vertex carries its address: `voxel` and `element`; the field `SPACE` says LPS |
//!
//! [`read()`] takes files of these formats from any program, in any of their encodings; what a format doesn't say (its unit,
//! which way its axes run) is taken as `docs/methods/mesh-files.md` tells. A [`Mesh`] becomes a lattice by
//! `ivd_lattice::foreign::lattice`.
//!
//! [`write_motion`] writes a lattice with its motion: `.glb` as morph targets with an animation, `.pvd` as a series of `.vtp`.
//!
//! A file is written beside its target and renamed; where the bytes would not change the target isn't touched.

mod error;
mod glb;
mod motion;
mod obj;
mod parse;
mod ply;
mod read;
mod stl;
mod vtp;

pub use error::Error;
pub use ivd_core::{Mesh, MeshAddress};
pub use motion::write_motion;
pub use read::{read, read_bytes};

use std::io::{self, Write};
use std::path::Path;

use ivd_core::{Frame, Lattice};
use nalgebra::Vector3;

/// What became of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Written {
    /// Whether the file is new or changed; `false` where it held the same bytes already.
    pub touched: bool,
    /// Largest difference between a coordinate and what the format holds of it (mm).
    pub rounding_mm: f64,
}

/// Mesh formats, by the file's ending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Stanford polygon file, binary little endian.
    Ply,
    /// Wavefront object, text.
    Obj,
    /// Stereolithography, binary.
    Stl,
    /// glTF 2.0, binary container.
    Glb,
    /// VTK's XML polygon data, appended raw.
    Vtp,
}

impl Format {
    /// Every format, in the order in which messages list them.
    pub const ALL: [Self; 5] = [Self::Ply, Self::Obj, Self::Stl, Self::Glb, Self::Vtp];

    /// The ending, without its dot.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Stl => "stl",
            Self::Glb => "glb",
            Self::Vtp => "vtp",
        }
    }

    /// The format of a file's name, in upper or lower case; `None` where the ending is another's.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.ending() == ending)
    }
}

/// Vertices and triangles on their way into a file.
struct Placed<'a> {
    lattice: &'a Lattice,
    /// World positions (mm), RAS.
    positions: Vec<Vector3<f64>>,
    /// How they move from there; only formats with an animation hold it.
    frames: &'a [Frame],
}

/// Writes a lattice at rest in the format of the file's ending.
///
/// # Errors
/// [`Error::Format`] for an ending that isn't known, [`Error::Unwritable`] where the format can't hold the lattice,
/// [`Error::Io`] where writing failed. The target is then as it was.
pub fn write(path: &Path, lattice: &Lattice) -> Result<Written, Error> {
    write_mesh(path, &Placed { lattice, positions: lattice.positions(), frames: &[] })
}

/// Writes a lattice whose vertices are displaced.
///
/// - `displacement`: of each vertex (mm), RAS, shape `[vertex_count, 3]`.
///
/// # Errors
/// As [`write()`]; [`ivd_core::Error::Inconsistent`] where the displacement's length isn't the lattice's or a vector
/// isn't finite.
pub fn write_deformed(path: &Path, lattice: &Lattice, displacement: &[[f64; 3]]) -> Result<Written, Error> {
    write_mesh(path, &Placed { lattice, positions: deformed(lattice, displacement)?, frames: &[] })
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

/// The format of a file's ending.
fn format_of(path: &Path) -> Result<Format, Error> {
    Format::of(path).ok_or_else(|| Error::Format {
        path: path.to_owned(),
        problem: path.extension().map_or_else(
            || "the name has no ending".to_owned(),
            |ending| format!("the ending .{} isn't a mesh format's", ending.to_string_lossy()),
        ),
    })
}

fn write_mesh(path: &Path, mesh: &Placed) -> Result<Written, Error> {
    let format = format_of(path)?;
    let rounding_mm = match format {
        Format::Ply => ply::check(mesh)?,
        Format::Obj => 0.0,
        Format::Stl => stl::check(mesh)?,
        Format::Glb => glb::check(mesh)?,
        Format::Vtp => vtp::check(mesh)?,
    };
    let failed = |action, source| Error::Io { action, path: path.to_owned(), source };
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

/// Refuses a grid whose voxels 32-bit numbers can't name; else nothing is rounded.
fn voxels_fit(mesh: &Placed, format: &'static str) -> Result<f64, Error> {
    let dims = mesh.lattice.grid().dims();
    if dims.iter().any(|&n| n >= i32::MAX as usize) {
        let problem = format!("its integers have 32 bits, and the grid has {dims:?} voxels");
        return Err(Error::Unwritable { format, problem });
    }
    Ok(0.0)
}

/// Writes an array of numbers as its little-endian bytes.
fn put<const N: usize, const B: usize, T: Copy>(
    file: &mut dyn Write,
    values: [T; N],
    bytes: impl Fn(T) -> [u8; B],
) -> io::Result<()> {
    file.write_all(values.map(bytes).as_flattened())
}

/// Largest change (mm) of a coordinate by rounding it to f32.
fn f32_rounding<'a>(positions: impl Iterator<Item = &'a Vector3<f64>>) -> f64 {
    positions.flat_map(|p| p.iter()).map(|&c| (f64::from(c as f32) - c).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
