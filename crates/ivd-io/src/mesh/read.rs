//! Mesh files of any program, read.

use std::io;
use std::path::{Path, PathBuf};

use ivd_core::Mesh;

use super::format::{Format, format_of};
use super::parse::{Budget, Failure};
use super::{glb, obj, ply, stl, vtp};
use crate::FileError;
use crate::mesh::Error;

/// Reads a mesh file in the format of its ending.
///
/// Any bytes give a mesh or an error. Memory stays within 64 MiB and four times the file's size, whatever the file says of
/// itself, and within `limit_bytes`.
///
/// - `limit_bytes`: most bytes that the file and its mesh may take together; `u64::MAX` for no limit.
///
/// # Errors
/// [`Error::Format`] for an ending that isn't known, [`FileError::Io`] where reading failed, [`FileError::Unreadable`] with the
/// line, byte or part where the file is wrong, [`ivd_core::Error::MemoryLimit`] beyond `limit_bytes`.
pub fn read(path: &Path, limit_bytes: u64) -> Result<Mesh, Error> {
    let format = format_of(path)?;
    let failed = |source| Error::from(FileError::io("read", path, source));
    let meta = std::fs::metadata(path).map_err(failed)?;
    if !meta.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")));
    }
    if meta.len() > limit_bytes {
        let what = "reading the file of a mesh".to_owned();
        return Err(ivd_core::Error::MemoryLimit { what, needed: meta.len(), limit: limit_bytes }.into());
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    parse(format, &bytes, limit_bytes).map_err(|failure| failure.of(path))
}

/// Reads a mesh from the bytes of a file; errors call it `bytes.ply` and so on.
///
/// # Errors
/// As [`read()`], without [`Error::Format`] and [`FileError::Io`].
pub fn read_bytes(format: Format, bytes: &[u8], limit_bytes: u64) -> Result<Mesh, Error> {
    parse(format, bytes, limit_bytes)
        .map_err(|failure| failure.of(&PathBuf::from(format!("bytes.{}", format.ending()))))
}

fn parse(format: Format, bytes: &[u8], limit: u64) -> Result<Mesh, Failure> {
    let mut budget = Budget::new(bytes.len(), limit)?;
    match format {
        Format::Ply => ply::read(bytes, &mut budget),
        Format::Obj => obj::read(bytes, &mut budget),
        Format::Stl => stl::read(bytes, &mut budget),
        Format::Glb => glb::read(bytes, &mut budget),
        Format::Vtp => vtp::read(bytes, &mut budget),
    }
}
