//! Volumes as slices: a TIFF with several pages, a folder of PNG or TIFF pictures, a folder of raw slices.

use std::path::Path;

use ivd_core::{Exec, Volume};

use crate::{Error, RawLayout};

/// Reads a TIFF stack.
///
/// # Errors
/// TIFF isn't read yet.
pub fn read_tiff(path: &Path, exec: &Exec) -> Result<Volume, Error> {
    let _ = exec;
    Err(Error::unsupported(path, "TIFF", "convert the stack to NRRD"))
}

/// Reads the slices of a folder.
///
/// # Errors
/// Folders of slices aren't read yet.
pub fn read_folder(dir: &Path, raw: Option<&RawLayout>, exec: &Exec) -> Result<Volume, Error> {
    let _ = (raw, exec);
    Err(Error::unsupported(dir, "a folder of slices", "convert the slices to NRRD"))
}
