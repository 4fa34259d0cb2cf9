//! What only some systems can do: permissions of a new file, syncing a folder.

use std::path::Path;

use tempfile::NamedTempFile;

/// A temporary file in `folder` with the permissions that any new file of the user gets.
#[cfg(unix)]
pub(crate) fn temporary(folder: &Path) -> std::io::Result<NamedTempFile> {
    use std::os::unix::fs::PermissionsExt;
    // The user's mask takes its bits off, as for any file.
    let permissions = std::fs::Permissions::from_mode(0o666);
    tempfile::Builder::new().prefix(crate::write::TEMPORARY).permissions(permissions).tempfile_in(folder)
}

/// A temporary file in `folder`.
#[cfg(not(unix))]
pub(crate) fn temporary(folder: &Path) -> std::io::Result<NamedTempFile> {
    tempfile::Builder::new().prefix(crate::write::TEMPORARY).tempfile_in(folder)
}

/// Makes a rename within `folder` last through a loss of power.
#[cfg(unix)]
pub(crate) fn sync_folder(folder: &Path) -> std::io::Result<()> {
    std::fs::File::open(folder)?.sync_all()
}

/// Elsewhere a folder can't be opened; the rename is as lasting as the system makes it.
#[cfg(not(unix))]
pub(crate) fn sync_folder(_folder: &Path) -> std::io::Result<()> {
    Ok(())
}
