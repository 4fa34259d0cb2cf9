use std::path::{Path, PathBuf};

use ivd_core::{Exec, Volume};
use serde::{Deserialize, Serialize};

use crate::{Error, RawLayout};

/// What the file alone doesn't tell.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReadOptions {
    /// Layout of a file, or of the slices of a folder, without a header.
    pub raw: Option<RawLayout>,
    /// Which frame of a file with several, from 0.
    pub frame: Option<usize>,
    /// Which DICOM series of a folder with several: its UID, or the start of it, or its number.
    pub series: Option<String>,
    /// Spacing [mm] in place of the file's, for formats without one: slices, TIFF, PNG.
    pub spacing: Option<[f64; 3]>,
}

/// Reads a volume.
///
/// # Errors
/// Not yet.
pub fn read(path: &Path, options: &ReadOptions, exec: &Exec) -> Result<Volume, Error> {
    let _ = (options, exec);
    Err(Error::unsupported(path, "any format", "wait"))
}

/// Files of a volume.
///
/// # Errors
/// Not yet.
pub fn sources(path: &Path, options: &ReadOptions) -> Result<Vec<PathBuf>, Error> {
    let _ = options;
    Ok(vec![path.to_owned()])
}
