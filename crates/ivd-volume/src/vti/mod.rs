//! VTK image data in XML: `.vti`.

use std::path::Path;

use ivd_core::{Exec, Volume};

use crate::{Error, Written};

/// Reads a `.vti` file.
///
/// # Errors
/// VTI isn't read yet.
pub fn read(path: &Path, exec: &Exec) -> Result<Volume, Error> {
    let _ = exec;
    Err(Error::unsupported(path, "VTI", "convert the file to NRRD"))
}

/// Writes a `.vti` file; through `crate::write::replace`, which is atomic and leaves equal files alone.
///
/// # Errors
/// VTI isn't written yet.
pub fn write(path: &Path, volume: &Volume) -> Result<Written, Error> {
    let _ = volume;
    Err(Error::unsupported(path, "VTI", "write NRRD"))
}
