//! From a file to a value: its head, then the sections, each verified before it is used.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use crate::head::{Head, Info};
use crate::map::Map;
use crate::opened::{Loaded, Opened};
use crate::prelude::MAGIC;
use crate::{Error, Kind};

/// Whether a file begins like an artefact. A file that can't be read doesn't.
pub fn is_artefact(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    let mut magic = [0; 4];
    // Opening a pipe would wait for its writer.
    path.is_file()
        && File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok()
        && magic == MAGIC
}

/// Reads prelude and metadata and verifies their hash; the payload isn't touched, only its length is checked.
///
/// # Errors
/// [`Error`] names the part that is damaged, cut, unknown or newer than this program.
pub fn peek(path: impl AsRef<Path>) -> Result<Info, Error> {
    let path = path.as_ref();
    let (_, head) = Head::read(path)?;
    Ok(head.info)
}

/// Reads an artefact, mapped, every section verified in parallel on the calling rayon pool.
///
/// # Errors
/// [`Error`] names the part that is damaged, cut, unknown or newer than this program, or what the value's own check
/// found.
pub fn read(path: impl AsRef<Path>) -> Result<Loaded, Error> {
    let opened = open(path)?;
    opened.verify()?;
    Arc::new(opened).load()
}

/// As [`read`], but a volume's voxels are verified when they are touched ([`ivd_core::Volume::layers`]), 4 MiB at a time,
/// and what nobody touches is never read. Whoever uses the value asks [`Opened::damage`] of [`Loaded::file`] before
/// trusting what came of it.
///
/// # Errors
/// As [`read`], of what is verified at once.
pub fn read_lazily(path: impl AsRef<Path>) -> Result<Loaded, Error> {
    let opened = open(path)?;
    opened.verify_but(if opened.info().kind == Kind::Volume { LAZY } else { "" })?;
    Arc::new(opened).load()
}

/// The section of a volume that is verified as it is touched.
const LAZY: &str = "voxels";

/// Opens an artefact without reading its payload: sections are verified as they are touched.
///
/// # Errors
/// As [`peek`].
pub fn open(path: impl AsRef<Path>) -> Result<Opened, Error> {
    let path = path.as_ref();
    let (file, head) = Head::read(path)?;
    let map = Map::new(&file).map_err(Error::io(path, "map"))?;
    // The length may have changed between the check and the mapping.
    head.check_length(path, map.bytes().len() as u64)?;
    Ok(Opened::new(path, map, head))
}
