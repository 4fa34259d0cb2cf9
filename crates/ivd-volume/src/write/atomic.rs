use std::fs::File;
use std::io::{self, BufWriter, Read};
use std::path::Path;

use tempfile::NamedTempFile;

use super::Written;
use crate::Error;

/// Writes a file through `content` so that a reader sees the old file, the new one, or none: into a temporary file of
/// the same folder, then renamed. A file that already holds the same bytes isn't touched.
pub(crate) fn replace(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<NamedTempFile>) -> Result<(), Error>,
) -> Result<Written, Error> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ivd-").suffix(".tmp");
    // The permissions of any new file, not those of a private one.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let file = builder.tempfile_in(folder).map_err(|e| Error::io(path, "create a file beside", e))?;
    let mut writer = BufWriter::with_capacity(1 << 20, file);
    content(&mut writer)?;
    let file = writer.into_inner().map_err(|e| Error::io(path, "write", e.into_error()))?;
    if same_bytes(file.path(), path).unwrap_or(false) {
        return Ok(Written { touched: false });
    }
    file.as_file().sync_all().map_err(|e| Error::io(path, "write", e))?;
    file.persist(path).map_err(|e| Error::io(path, "write", e.error))?;
    Ok(Written { touched: true })
}

fn same_bytes(a: &Path, b: &Path) -> io::Result<bool> {
    let (mut a, mut b) = (File::open(a)?, File::open(b)?);
    if !b.metadata()?.is_file() || a.metadata()?.len() != b.metadata()?.len() {
        return Ok(false);
    }
    let (mut x, mut y) = (vec![0; 1 << 18], vec![0; 1 << 18]);
    loop {
        let n = a.read(&mut x)?;
        if n == 0 {
            return Ok(true);
        }
        b.read_exact(&mut y[..n])?;
        if x[..n] != y[..n] {
            return Ok(false);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn put(path: &Path, bytes: &[u8]) -> Result<Written, Error> {
        replace(path, |w| w.write_all(bytes).map_err(|e| Error::io(path, "write", e)))
    }

    #[test]
    fn the_same_bytes_leave_the_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        assert!(put(&path, b"one").unwrap().touched);
        let before = std::fs::metadata(&path).unwrap().modified().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(!put(&path, b"one").unwrap().touched);
        assert_eq!(std::fs::metadata(&path).unwrap().modified().unwrap(), before);
        assert!(put(&path, b"two").unwrap().touched);
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_litter() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        put(&path, b"old").unwrap();
        let failed = replace(&path, |w| {
            w.write_all(b"ne").unwrap();
            Err(Error::unsupported(&path, "this", "try that"))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
