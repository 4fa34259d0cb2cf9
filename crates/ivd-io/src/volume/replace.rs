use std::io::Write;
use std::path::Path;

use crate::volume::Error;

/// What became of a written file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// False where the file already held the same bytes and was left alone, modification time included.
    pub touched: bool,
}

impl Written {
    /// What became of two files that are one volume.
    pub(crate) fn and(self, other: Self) -> Self {
        Self { touched: self.touched || other.touched }
    }
}

/// Writes a file through `content` so that a reader sees the old file, the new one, or none. A file that already holds
/// the same bytes isn't touched.
pub(crate) fn replace(
    path: &Path,
    content: impl FnOnce(&mut ivd_fs::Sink) -> Result<(), Error>,
) -> Result<Written, Error> {
    let touched = ivd_fs::replace(path, |action, source| Error::io(path, action, source), content)?;
    Ok(Written { touched })
}

/// Writes all bytes.
pub(crate) fn put(to: &mut dyn Write, path: &Path, bytes: &[u8]) -> Result<(), Error> {
    to.write_all(bytes).map_err(|e| Error::io(path, "write", e))
}
