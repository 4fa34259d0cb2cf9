//! DICOM: a series in a folder, or one file.

use std::path::Path;

use ivd_core::{Exec, Volume};

use crate::Error;

/// Reads one series of a folder.
///
/// # Errors
/// DICOM isn't read yet.
pub fn read_folder(dir: &Path, series: Option<&str>, exec: &Exec) -> Result<Volume, Error> {
    let _ = (series, exec);
    Err(Error::unsupported(dir, "DICOM", "convert the series to NIfTI"))
}

/// Reads one file.
///
/// # Errors
/// DICOM isn't read yet.
pub fn read_file(path: &Path, exec: &Exec) -> Result<Volume, Error> {
    let _ = exec;
    Err(Error::unsupported(path, "DICOM", "convert the series to NIfTI"))
}
