//! The stage cache: a folder of artefacts named by what made them.

mod entries;
mod files;
mod key;
mod used;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use serde_json::Value;

pub use entries::Entry;
pub use files::FileHash;
pub use key::CacheKey;

use crate::{
    ArtefactRef, ContentHash, Error, Info, Loaded, Provenance, Written, peek, read, read_lazily,
    write_with_metrics,
};

/// Folder within the cache's folder. Raised when keys or file names change; other versions' folders are left alone.
const VERSION: &str = "v1";

/// What a look into the cache found.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "returned once a stage")]
pub enum Lookup<T> {
    /// A sound entry.
    Hit(T),
    /// No entry.
    Absent,
    /// An entry that doesn't verify; it was removed. The text says why.
    Unusable(String),
}

impl<T> Lookup<T> {
    /// The entry of a hit.
    pub fn hit(self) -> Option<T> {
        match self {
            Self::Hit(value) => Some(value),
            Self::Absent | Self::Unusable(_) => None,
        }
    }
}

/// A cache of artefacts, `DIR/v1/<2 digits>/<64 digits of the key>.ivd`.
///
/// Beside them, `DIR/v1/sources/`: what [`Cache::file_hash`] remembers of files that are no artefacts.
///
/// Many processes may share a folder: entries are only ever renamed into place, and an entry that two processes make is
/// the same from both. An entry that can't be read, doesn't verify, or isn't what its name says is removed and counts as
/// absent. Nothing in here is trusted: every payload is verified before it is used.
#[derive(Debug, Default)]
pub struct Cache {
    folder: Option<PathBuf>,
    /// Hits of this value, for reports.
    hits: AtomicU64,
    /// Set once what killed processes left in any of the folders was looked for.
    swept: OnceLock<()>,
}

impl Cache {
    /// A cache in `dir`, which is made where it doesn't exist.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder can't be made.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, Error> {
        let folder = dir.as_ref().join(VERSION);
        std::fs::create_dir_all(&folder).map_err(Error::io(&folder, "make the cache's folder"))?;
        Ok(Self { folder: Some(folder), ..Self::default() })
    }

    /// A cache that holds nothing and keeps nothing.
    pub fn disabled() -> Self {
        Self::default()
    }

    /// Whether anything is kept.
    pub fn is_enabled(&self) -> bool {
        self.folder.is_some()
    }

    /// The folder of this version's entries.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Number of hits so far.
    pub fn hits(&self) -> u64 {
        self.hits.load(Ordering::Relaxed)
    }

    /// Where the entry of a key is or would be; `None` for a disabled cache.
    pub fn path_of(&self, key: &CacheKey) -> Option<PathBuf> {
        let name = key.to_string();
        Some(self.folder.as_ref()?.join(&name[..2]).join(format!("{name}.ivd")))
    }

    /// The entry of a key, verified whole. Why an entry was unusable is traced; [`Cache::lookup`] returns it.
    pub fn get(&self, key: &CacheKey) -> Option<Loaded> {
        self.lookup(key).hit()
    }

    /// The entry of a key, verified whole, or why there is none.
    pub fn lookup(&self, key: &CacheKey) -> Lookup<Loaded> {
        self.find(key, |path| {
            let loaded = read(path)?;
            Ok((loaded.file.info().clone(), loaded))
        })
    }

    /// As [`Cache::lookup`]; a volume's voxels are verified when they are touched, as [`crate::read_lazily`] has it.
    pub fn lookup_lazily(&self, key: &CacheKey) -> Lookup<Loaded> {
        self.find(key, |path| {
            let loaded = read_lazily(path)?;
            Ok((loaded.file.info().clone(), loaded))
        })
    }

    /// The entry that was put a moment ago, mapped: what was made needs no memory of its own any more. `None` where it can't be read
    /// back, or is another's by now.
    pub fn mapped(&self, key: &CacheKey, written: &Written, lazily: bool) -> Option<Loaded> {
        let path = self.path_of(key)?;
        let loaded = if lazily { read_lazily(&path) } else { read(&path) };
        loaded.ok().filter(|loaded| loaded.hash == written.hash)
    }

    /// The content hash of a key's entry from its metadata alone: an unchanged chain is followed without reading a
    /// payload. The payload is verified when it is used.
    pub fn lookup_hash(&self, key: &CacheKey) -> Option<ContentHash> {
        self.lookup_info(key).hit().map(|info| info.hash)
    }

    /// What the entry of a key says about itself, from its metadata alone.
    pub fn lookup_info(&self, key: &CacheKey) -> Lookup<Info> {
        self.find(key, |path| {
            let info = peek(path)?;
            Ok((info.clone(), info))
        })
    }

    /// As [`Cache::lookup_info`], with every byte of the payload verified and no value made: about as fast as memory
    /// is read.
    pub fn verify(&self, key: &CacheKey) -> Lookup<Info> {
        self.find(key, |path| {
            let opened = crate::open(path)?;
            opened.verify()?;
            Ok((opened.info().clone(), opened.info().clone()))
        })
    }

    /// Keeps an artefact.
    ///
    /// # Errors
    /// As [`crate::write`]. A caller may go on without: a cache that can't be written to is only slow.
    pub fn put<'a>(
        &self,
        key: &CacheKey,
        artefact: impl Into<ArtefactRef<'a>>,
        provenance: &Provenance,
    ) -> Result<Option<Written>, Error> {
        self.put_with_metrics(key, artefact, provenance, &Value::Null)
    }

    /// Keeps an artefact with a small JSON of metrics.
    ///
    /// # Errors
    /// As [`Cache::put`].
    pub fn put_with_metrics<'a>(
        &self,
        key: &CacheKey,
        artefact: impl Into<ArtefactRef<'a>>,
        provenance: &Provenance,
        metrics: &Value,
    ) -> Result<Option<Written>, Error> {
        let Some(path) = self.path_of(key) else { return Ok(None) };
        let folder = path.parent().expect("an entry lies in a folder");
        std::fs::create_dir_all(folder).map_err(Error::io(folder, "make the cache's folder"))?;
        // A write sweeps its own folder; another run may never write into the one where a process was killed.
        self.swept.get_or_init(|| self.remove_abandoned());
        write_with_metrics(&path, artefact, provenance, metrics).map(Some)
    }

    /// Reads an entry, checks that it is what its name says, marks it as used.
    fn find<T>(&self, key: &CacheKey, load: impl Fn(&Path) -> Result<(Info, T), Error>) -> Lookup<T> {
        let Some(path) = self.path_of(key) else { return Lookup::Absent };
        let reason = match load(&path) {
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                return Lookup::Absent;
            }
            Ok((info, value)) if CacheKey::new(info.kind, &info.provenance) == *key => {
                self.hits.fetch_add(1, Ordering::Relaxed);
                used::mark_used(&path);
                return Lookup::Hit(value);
            }
            Ok(_) => format!("{}: the entry was made from something else", path.display()),
            Err(error) => error.to_string(),
        };
        tracing::warn!(%reason, "a cache entry is not usable and is made again");
        // Where it can't be removed it is replaced by the next put.
        let _ = std::fs::remove_file(&path);
        Lookup::Unusable(reason)
    }
}

/// The user's cache folder: `IVD_CACHE`, else the system's usual place.
pub fn user_cache() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    folder("IVD_CACHE")
        .or_else(|| folder("XDG_CACHE_HOME").map(|d| d.join("ivd")))
        .or_else(|| folder("LOCALAPPDATA").map(|d| d.join("ivd").join("cache")))
        .or_else(|| folder("HOME").map(|d| d.join(".cache").join("ivd")))
}
