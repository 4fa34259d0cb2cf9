//! A lattice that moves.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use ivd_core::{Lattice, Motion};

use super::format::Format;
use super::placed::times;
use super::{Written, write_deformed, write_mesh};
use crate::mesh::Error;
use crate::{FileError, Space};

/// Writes a lattice with its motion, in the format of the file's ending.
///
/// - `.glb`: the lattice at rest with a morph target for every frame, and an animation that goes from one to the next.
/// - `.pvd`: ParaView's collection, with a `.vtp` beside it for the lattice at rest and one for every frame, named after it:
///   `name_0000.vtp`, `name_0001.vtp` and so on. The collection is written last.
/// - the other mesh formats: the lattice as the last frame has it.
///
/// - `space`: as for [`write()`](super::write()).
///
/// Times are the frames'; where these don't grow from above 0, frames are a second apart.
///
/// # Errors
/// As [`write()`](super::write()); [`ivd_core::Error::Inconsistent`] where the motion is of another lattice.
pub fn write_motion(
    path: &Path,
    lattice: &Lattice,
    motion: &Motion,
    space: Option<Space>,
) -> Result<Written, Error> {
    if !lattice.grid().matches(motion.grid()) || lattice.keys().len() != motion.vertex_count() {
        return Err(Error::from(ivd_core::Error::Inconsistent {
            what: "motion of a lattice",
            problem: format!(
                "it moves {} vertices on {:?} voxels, the lattice has {} on {:?}",
                motion.vertex_count(),
                motion.grid().dims(),
                lattice.keys().len(),
                lattice.grid().dims()
            ),
        }));
    }
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pvd")) {
        return write_series(path, lattice, motion, space);
    }
    match (Format::of(path), motion.frames().last()) {
        (Some(Format::Glb), _) | (_, None) => {
            write_mesh(path, lattice, lattice.positions(), motion.frames(), space)
        }
        (_, Some(last)) => write_deformed(path, lattice, &last.displacement, space),
    }
}

fn write_series(
    path: &Path,
    lattice: &Lattice,
    motion: &Motion,
    space: Option<Space>,
) -> Result<Written, Error> {
    let mut written = super::write(&member(path, 0), lattice, space)?;
    for (i, frame) in motion.frames().iter().enumerate() {
        let one = write_deformed(&member(path, i + 1), lattice, &frame.displacement, space)?;
        written.touched |= one.touched;
        written.rounding_mm = written.rounding_mm.max(one.rounding_mm);
    }
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n  <Collection>\n",
    );
    for (i, time) in times(motion.frames()).into_iter().enumerate() {
        let file = member(path, i);
        let file = escaped(&file.file_name().unwrap_or_default().to_string_lossy());
        let _ = writeln!(text, "    <DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>");
    }
    text.push_str("  </Collection>\n</VTKFile>\n");
    let failed = |action, source| Error::from(FileError::io(action, path, source));
    written.touched |= ivd_fs::replace(path, failed, |file| {
        file.write_all(text.as_bytes()).map_err(|source| failed("write", source))
    })?;
    Ok(written)
}

/// The files of a collection that [`write_motion`] wrote: those beside it that its frames and the rest lie in.
///
/// # Errors
/// The system's.
pub fn members(path: &Path) -> std::io::Result<Vec<PathBuf>> {
    let count = std::fs::read_to_string(path)?.matches("<DataSet ").count();
    Ok((0..count).map(|i| member(path, i)).collect())
}

/// A frame's file, 0 that of the lattice at rest.
fn member(path: &Path, i: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{i:04}.vtp"))
}

/// A name as XML has it between quotes.
fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
