use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

use crate::Error;

/// Writes a file under a temporary name in its target's folder and renames it, so that a reader sees the old file, the
/// new one or none. Returns whether the target was touched: it isn't where its bytes are the same already.
pub(super) fn replace(
    path: &Path,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<bool, Error> {
    let failed = |source| Error::Io { action: "writing", path: path.to_owned(), source };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut fresh = beside(folder).map_err(failed)?;
    fill(&mut fresh, content).map_err(failed)?;
    if same_bytes(fresh.path(), path) {
        return Ok(false);
    }
    fresh.persist(path).map_err(|error| failed(error.error))?;
    sync_folder(folder).map_err(failed)?;
    Ok(true)
}

fn fill(fresh: &mut NamedTempFile, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(1 << 18, fresh.as_file_mut());
    content(&mut writer)?;
    writer.flush()?;
    drop(writer);
    fresh.as_file().sync_all()
}

#[cfg(unix)]
fn beside(folder: &Path) -> io::Result<NamedTempFile> {
    use std::os::unix::fs::PermissionsExt;
    // What the user's mask leaves of it, as for any new file; a temporary file alone would be private.
    let shared = std::fs::Permissions::from_mode(0o666);
    Builder::new().prefix(".lattice-").permissions(shared).tempfile_in(folder)
}

#[cfg(not(unix))]
fn beside(folder: &Path) -> io::Result<NamedTempFile> {
    Builder::new().prefix(".lattice-").tempfile_in(folder)
}

#[cfg(unix)]
fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

#[cfg(not(unix))]
#[allow(clippy::unnecessary_wraps, reason = "only some systems can sync a folder")]
fn sync_folder(_folder: &Path) -> io::Result<()> {
    Ok(())
}

/// Whether two files hold the same bytes; `false` where one can't be read.
fn same_bytes(a: &Path, b: &Path) -> bool {
    let sized = |path: &Path| -> io::Result<_> {
        let file = File::open(path)?;
        Ok((file.metadata()?.len(), BufReader::with_capacity(1 << 18, file)))
    };
    let (Ok((len_a, mut a)), Ok((len_b, mut b))) = (sized(a), sized(b)) else { return false };
    if len_a != len_b {
        return false;
    }
    let mut left = len_a;
    let (mut piece_a, mut piece_b) = (vec![0; 1 << 16], vec![0; 1 << 16]);
    while left > 0 {
        let n = left.min(piece_a.len() as u64) as usize;
        let read = a.read_exact(&mut piece_a[..n]).and_then(|()| b.read_exact(&mut piece_b[..n]));
        if read.is_err() || piece_a[..n] != piece_b[..n] {
            return false;
        }
        left -= n as u64;
    }
    true
}
