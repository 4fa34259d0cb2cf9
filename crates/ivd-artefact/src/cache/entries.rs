//! What lies in a cache: listing, pruning, clearing.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::Cache;
use crate::{Error, Info, peek};

/// An entry of a cache.
#[derive(Debug)]
pub struct Entry {
    /// Its file.
    pub path: PathBuf,
    /// Bytes of the file.
    pub bytes: u64,
    /// When it was last used.
    pub used: SystemTime,
    /// What it says about itself; `None` where it can't be read.
    pub info: Option<Info>,
}

impl Cache {
    /// The entries, most recently used first; none for a disabled cache.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder can't be read.
    pub fn entries(&self) -> Result<Vec<Entry>, Error> {
        let mut entries: Vec<Entry> = self
            .files()?
            .into_iter()
            .filter(|file| !file.unfinished && file.path.extension().is_some_and(|e| e == "ivd"))
            .map(|file| Entry {
                info: peek(&file.path).ok(),
                path: file.path,
                bytes: file.bytes,
                used: file.used,
            })
            .collect();
        entries.sort_by(|a, b| b.used.cmp(&a.used).then_with(|| a.path.cmp(&b.path)));
        Ok(entries)
    }

    /// Removes the entries that were not used for longest, until at most `max_bytes` are left, and what killed
    /// processes left behind. Returns the bytes that were freed.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder can't be read. An entry that can't be removed is passed over.
    pub fn prune(&self, max_bytes: u64) -> Result<u64, Error> {
        let mut files = self.files()?;
        files.sort_by(|a, b| a.used.cmp(&b.used).then_with(|| a.path.cmp(&b.path)));
        let mut left: u64 = files.iter().filter(|f| !f.unfinished).map(|f| f.bytes).sum();
        let mut freed = 0;
        for file in files {
            let dropped = if file.unfinished {
                ivd_fs::remove_abandoned(&file.path)
            } else {
                left > max_bytes && fs::remove_file(&file.path).is_ok()
            };
            if dropped {
                freed += file.bytes;
                left -= if file.unfinished { 0 } else { file.bytes };
            }
        }
        Ok(freed)
    }

    /// Removes every entry of this version. Returns the bytes that were freed.
    ///
    /// # Errors
    /// As [`Cache::prune`].
    pub fn clear(&self) -> Result<u64, Error> {
        self.prune(0)
    }

    /// Removes what killed processes left. What can't be listed is passed over.
    pub(super) fn remove_abandoned(&self) {
        for group in self.folder().and_then(|folder| list(folder).ok()).into_iter().flatten() {
            ivd_fs::sweep(&group);
        }
    }

    fn files(&self) -> Result<Vec<Listed>, Error> {
        let Some(folder) = self.folder() else { return Ok(Vec::new()) };
        let mut files = Vec::new();
        for group in list(folder)? {
            if group.is_dir() {
                files.extend(list(&group)?.into_iter().filter_map(Listed::new));
            }
        }
        Ok(files)
    }
}

/// A file of the cache.
struct Listed {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
    unfinished: bool,
}

impl Listed {
    /// `None` for what is no file of ours, or is gone by now.
    fn new(path: PathBuf) -> Option<Self> {
        let stat = fs::metadata(&path).ok().filter(fs::Metadata::is_file)?;
        let unfinished = ivd_fs::is_unfinished(&path);
        let ours = unfinished || path.extension().is_some_and(|e| e == "ivd" || e == "json");
        ours.then_some(Self { bytes: stat.len(), used: stat.modified().ok()?, unfinished, path })
    }
}

fn list(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let listing = match fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        listing => listing.map_err(Error::io(folder, "list"))?,
    };
    Ok(listing.filter_map(|item| item.ok().map(|item| item.path())).collect())
}
