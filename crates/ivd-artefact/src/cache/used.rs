use std::fs;
use std::path::Path;
use std::time::SystemTime;

/// Sets an entry's time to now, so that pruning keeps it longest. A read-only cache works without.
pub(super) fn mark_used(path: &Path) {
    if let Ok(file) = fs::File::options().append(true).open(path) {
        let _ = file.set_modified(SystemTime::now());
    }
}
