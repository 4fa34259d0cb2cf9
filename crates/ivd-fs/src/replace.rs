use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

use crate::{UNFINISHED, sweep};

/// Where the bytes of a new file go; [`Write`] and [`Seek`].
pub type Sink<'a> = BufWriter<&'a mut File>;

/// Bytes that are gathered before they are written, and compared at once.
const PIECE: usize = 1 << 18;

/// Writes a file through `content` so that a reader sees the old file, the new one, or none. Returns whether the target
/// was touched: it isn't, modification time included, where its bytes are the same already.
///
/// The bytes go to a new file in the target's folder, which is synced and renamed, and the folder is synced. A link to
/// a file stays, and the file that it leads to is replaced; a link that leads nowhere is itself replaced. The file has
/// the mode of the one that it replaces, or else what the user's mask gives to any new file; what will replace a file
/// is its user's alone while it is written. Where `content` fails the target stays as it was and nothing else is left.
/// What killed processes left in the folder is removed.
///
/// - `failed`: makes the caller's error of what was tried (`"create it"`, `"write"`, `"replace"`) and the
///   system's answer.
///
/// # Errors
/// That of `content`, or what `failed` makes of the system's; a target that exists and is no regular file is refused.
/// Where only the folder's sync fails the new content is in its place already, and may get lost with the power.
pub fn replace<E>(
    path: &Path,
    failed: impl Fn(&'static str, io::Error) -> E,
    content: impl FnOnce(&mut Sink) -> Result<(), E>,
) -> Result<bool, E> {
    let old = path.metadata().ok();
    let real;
    let path = if old.is_some() && path.is_symlink() {
        real = path.canonicalize().map_err(|e| failed("replace", e))?;
        &real
    } else {
        path
    };
    let folder = folder_of(path);
    sweep(folder);
    if old.as_ref().is_some_and(|old| !old.is_file()) {
        return Err(failed("replace", io::Error::other("it is no regular file")));
    }
    let mut fresh = beside(folder, old.is_some()).map_err(|e| failed("create it", named(folder, e)))?;
    let mut sink = BufWriter::with_capacity(PIECE, fresh.as_file_mut());
    content(&mut sink)?;
    sink.flush().map_err(|e| failed("write", e))?;
    drop(sink);
    if same_bytes(fresh.as_file_mut(), path).unwrap_or(false) {
        return Ok(false);
    }
    if let Some(old) = old {
        fresh.as_file().set_permissions(old.permissions()).map_err(|e| failed("write", e))?;
    }
    fresh.as_file().sync_all().map_err(|e| failed("write", e))?;
    fresh.persist(path).map_err(|e| failed("replace", e.error))?;
    sync(folder).map_err(|e| failed("replace", e))?;
    Ok(true)
}

/// The folder that a file lies in; `.` for a bare name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A new file in a folder, locked; `private` as [`create`] has it.
fn beside(folder: &Path, private: bool) -> io::Result<NamedTempFile> {
    loop {
        let fresh = create(folder, private)?;
        let locked = locked(|| fresh.as_file().lock())?;
        // Between creation and lock it looked abandoned, and another process may have swept it.
        if !locked || fresh.path().try_exists()? {
            return Ok(fresh);
        }
    }
}

/// Whether `lock` could lock; `false` where the file system knows no locks, and a file's age tells whether it was
/// abandoned. A lock that fails for another reason is an error: others' locks may work, and the file be swept.
fn locked(lock: impl Fn() -> io::Result<()>) -> io::Result<bool> {
    loop {
        match lock() {
            Ok(()) => return Ok(true),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) if e.kind() == io::ErrorKind::Unsupported => return Ok(false),
            Err(e) => return Err(e),
        }
    }
}

/// What the system says, with the folder's name where that is what is missing.
fn named(folder: &Path, error: io::Error) -> io::Error {
    if error.kind() == io::ErrorKind::NotFound && !folder.exists() {
        return io::Error::new(error.kind(), format!("there is no folder {}", folder.display()));
    }
    error
}

/// A new file in a folder. `private`: for its user alone, until it gets the mode of the file that it replaces.
#[cfg(unix)]
fn create(folder: &Path, private: bool) -> io::Result<NamedTempFile> {
    use std::os::unix::fs::PermissionsExt;
    // The user's mask takes its bits off, as for any new file.
    let mode = if private { 0o600 } else { 0o666 };
    let permissions = std::fs::Permissions::from_mode(mode);
    Builder::new().prefix(UNFINISHED).permissions(permissions).tempfile_in(folder)
}

#[cfg(not(unix))]
fn create(folder: &Path, _private: bool) -> io::Result<NamedTempFile> {
    Builder::new().prefix(UNFINISHED).tempfile_in(folder)
}

/// Makes a rename within a folder last through a loss of power.
#[cfg(unix)]
fn sync(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

/// Elsewhere a folder can't be opened; the rename is as lasting as the system makes it.
#[cfg(not(unix))]
#[allow(clippy::unnecessary_wraps, reason = "only some systems can sync a folder")]
fn sync(_folder: &Path) -> io::Result<()> {
    Ok(())
}

/// Whether the file at `path` holds the bytes of `fresh`, which is read through its own handle: its lock may shut out
/// others.
fn same_bytes(fresh: &mut File, path: &Path) -> io::Result<bool> {
    let old = File::open(path)?;
    let length = old.metadata()?.len();
    if fresh.metadata()?.len() != length {
        return Ok(false);
    }
    fresh.rewind()?;
    let mut old = BufReader::with_capacity(PIECE, old);
    let (mut a, mut b) = (vec![0; PIECE], vec![0; PIECE]);
    let mut left = length;
    while left > 0 {
        let n = left.min(PIECE as u64) as usize;
        fresh.read_exact(&mut a[..n])?;
        old.read_exact(&mut b[..n])?;
        if a[..n] != b[..n] {
            return Ok(false);
        }
        left -= n as u64;
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    #[test]
    fn only_a_file_system_without_locks_goes_without_one() {
        use io::ErrorKind::{Interrupted, PermissionDenied, StorageFull, Unsupported};
        let after = |kinds: &[io::ErrorKind]| {
            let left = RefCell::new(kinds.to_vec());
            let answer = locked(|| left.borrow_mut().pop().map_or(Ok(()), |kind| Err(kind.into())));
            answer.map_err(|e| e.kind())
        };
        assert_eq!(after(&[]), Ok(true));
        assert_eq!(after(&[Interrupted, Interrupted]), Ok(true));
        assert_eq!(after(&[Unsupported, Interrupted]), Ok(false));
        for kind in [PermissionDenied, StorageFull] {
            assert_eq!(after(&[kind, Interrupted]), Err(kind));
        }
    }
}
