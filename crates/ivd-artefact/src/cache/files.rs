//! Hashes of files that are no artefacts, remembered for as long as the file isn't touched: a volume of gigabytes need not
//! be read to learn that nothing changed.

use std::fs::{self, File, Metadata};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use super::{Cache, used};
use crate::{ContentHash, Error, hash_all};

/// Folder of the remembered hashes, beside the entries.
const FOLDER: &str = "sources";
/// A file that changed less than this before it was read may change again unseen: some file systems count in steps of 2 s.
const SETTLED: Duration = Duration::from_secs(2);

/// What a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileHash {
    /// BLAKE3 of its bytes.
    pub hash: ContentHash,
    /// Bytes that had to be read to know it: none, or all.
    pub bytes_read: u64,
}

/// What the system says of a file, by which a change shows. A program can set the time of modification back, but not that
/// of the last change of anything about the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stamp {
    path: PathBuf,
    bytes: u64,
    device: u64,
    inode: u64,
    modified: [i64; 2],
    changed: [i64; 2],
}

impl Stamp {
    #[cfg(unix)]
    #[allow(clippy::unnecessary_wraps, reason = "other systems give none")]
    fn of(path: &Path, stat: &Metadata) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        Some(Self {
            path: path.to_owned(),
            bytes: stat.len(),
            device: stat.dev(),
            inode: stat.ino(),
            modified: [stat.mtime(), stat.mtime_nsec()],
            changed: [stat.ctime(), stat.ctime_nsec()],
        })
    }

    /// Elsewhere a file's time can be set back unseen: nothing is remembered.
    #[cfg(not(unix))]
    fn of(_path: &Path, _stat: &Metadata) -> Option<Self> {
        None
    }

    /// Whether the file was left alone for long enough that a later change would show.
    fn is_settled(&self) -> bool {
        let changed = Duration::new(self.changed[0].max(0) as u64, self.changed[1].max(0) as u32);
        let age = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH + changed);
        age.is_ok_and(|age| age > SETTLED)
    }

    /// Ties a remembered hash to this stamp, so that a damaged or exchanged note isn't believed.
    fn seal(&self, hash: ContentHash) -> ContentHash {
        let text = serde_json::to_string(&(self, hash)).expect("a stamp is plain data");
        ContentHash(*blake3::hash(text.as_bytes()).as_bytes())
    }
}

/// A remembered hash.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Note {
    stamp: Stamp,
    hash: ContentHash,
    seal: ContentHash,
}

impl Cache {
    /// The hash of a file's bytes; from the cache where the system says that the file is what it was.
    ///
    /// # Errors
    /// [`Error::Io`] where the file can't be read. A note that can't be read or written only costs time.
    pub fn file_hash(&self, path: &Path) -> Result<FileHash, Error> {
        let whole = path.canonicalize().map_err(Error::io(path, "open"))?;
        let file = File::open(&whole).map_err(Error::io(path, "open"))?;
        let stat = file.metadata().map_err(Error::io(path, "read"))?;
        let stamp = Stamp::of(&whole, &stat).filter(|_| self.is_enabled());
        let note = self.note_of(&whole);
        if let (Some(stamp), Some(note)) = (&stamp, &note)
            && let Some(hash) = remembered(note, stamp)
        {
            used::mark_used(note);
            return Ok(FileHash { hash, bytes_read: 0 });
        }
        let hash = hash_of(&file).map_err(Error::io(path, "read"))?;
        if let (Some(stamp), Some(note)) = (stamp.filter(Stamp::is_settled), note) {
            remember(&note, stamp, hash);
        }
        Ok(FileHash { hash, bytes_read: stat.len() })
    }

    /// Where the hash of a file is remembered.
    fn note_of(&self, whole: &Path) -> Option<PathBuf> {
        let name = blake3::hash(whole.as_os_str().as_encoded_bytes());
        Some(self.folder()?.join(FOLDER).join(format!("{name}.json")))
    }
}

fn hash_of(file: &File) -> std::io::Result<ContentHash> {
    let mut hasher = blake3::Hasher::new();
    hash_all(&mut hasher, file)?;
    Ok(ContentHash(*hasher.finalize().as_bytes()))
}

fn remembered(note: &Path, stamp: &Stamp) -> Option<ContentHash> {
    let note: Note = serde_json::from_slice(&fs::read(note).ok()?).ok()?;
    (note.stamp == *stamp && note.seal == stamp.seal(note.hash)).then_some(note.hash)
}

fn remember(note: &Path, stamp: Stamp, hash: ContentHash) {
    let seal = stamp.seal(hash);
    let text = serde_json::to_string(&Note { stamp, hash, seal }).expect("a note is plain data");
    let written = fs::create_dir_all(note.parent().expect("a note lies in a folder")).and_then(|()| {
        ivd_fs::replace(note, |_, e| e, |sink| std::io::Write::write_all(sink, text.as_bytes())).map(drop)
    });
    if let Err(error) = written {
        tracing::debug!(%error, note = %note.display(), "a file's hash isn't remembered");
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    fn wait() {
        std::thread::sleep(SETTLED + Duration::from_millis(100));
    }

    #[test]
    fn a_file_is_read_once_until_it_changes_and_a_false_note_is_not_believed() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(folder.path().join("cache")).unwrap();
        let path = folder.path().join("scan.raw");
        fs::write(&path, b"12345").unwrap();
        let fresh = cache.file_hash(&path).unwrap();
        assert_eq!(fresh.hash.0, *blake3::hash(b"12345").as_bytes());
        assert_eq!(cache.file_hash(&path).unwrap().bytes_read, 5, "just written: it may change unseen");
        wait();
        assert_eq!(cache.file_hash(&path).unwrap().bytes_read, 5);
        assert_eq!(cache.file_hash(&path).unwrap(), FileHash { bytes_read: 0, ..fresh });

        // The same length, and the time set back.
        let before = fs::metadata(&path).unwrap().modified().unwrap();
        fs::write(&path, b"54321").unwrap();
        File::options().append(true).open(&path).unwrap().set_modified(before).unwrap();
        let changed = cache.file_hash(&path).unwrap();
        assert_eq!((changed.hash.0, changed.bytes_read), (*blake3::hash(b"54321").as_bytes(), 5));

        wait();
        cache.file_hash(&path).unwrap();
        let note = cache.note_of(&path.canonicalize().unwrap()).unwrap();
        let text = fs::read_to_string(&note).unwrap();
        fs::write(&note, text.replace(&changed.hash.to_string(), &fresh.hash.to_string())).unwrap();
        assert_eq!(cache.file_hash(&path).unwrap(), FileHash { bytes_read: 5, ..changed });
        assert_eq!(Cache::disabled().file_hash(&path).unwrap().bytes_read, 5);
        assert!(cache.clear().unwrap() > 0, "notes are cleared too");
        assert!(!note.exists());
    }
}
