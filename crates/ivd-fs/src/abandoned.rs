use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::Path;
use std::time::Duration;

use crate::UNFINISHED;

/// Where a file system knows no locks, an unfinished file older than this belongs to a process that was killed.
const STALE: Duration = Duration::from_hours(1);

/// Whether a file's name is that of an unfinished one.
pub fn is_unfinished(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(UNFINISHED))
}

/// Removes an unfinished file that has no writer any more. Returns whether it did: it doesn't touch any other file.
pub fn remove_abandoned(path: &Path) -> bool {
    // The lock is held until the file is gone: a writer that waits for it then sees that it needs another.
    lock_abandoned(path).is_some_and(|_locked| std::fs::remove_file(path).is_ok())
}

/// Removes what killed processes left in a folder. What can't be listed or removed is passed over: no write depends
/// on it.
pub fn sweep(folder: &Path) {
    let Ok(listing) = folder.read_dir() else { return };
    for entry in listing.filter_map(Result::ok) {
        remove_abandoned(&entry.path());
    }
}

/// The file, locked where it can be, if it is an unfinished one without a writer.
fn lock_abandoned(path: &Path) -> Option<File> {
    if !is_unfinished(path) || !path.symlink_metadata().ok()?.is_file() {
        return None;
    }
    let file = open(path).ok()?;
    let abandoned = match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock) => false,
        // Where a lock fails for another reason nothing is known.
        Err(TryLockError::Error(e)) if e.kind() != ErrorKind::Unsupported => false,
        Err(TryLockError::Error(_)) => file.metadata().ok()?.modified().ok()?.elapsed().ok()? > STALE,
    };
    abandoned.then_some(file)
}

/// Some network file systems lock only what is open for writing; a file that got a read-only mode before its writer was
/// killed opens for reading alone.
fn open(path: &Path) -> io::Result<File> {
    match File::options().append(true).open(path) {
        Err(e) if e.kind() == ErrorKind::PermissionDenied => File::open(path),
        answer => answer,
    }
}
