//! Artefacts: what passes between stages, as files.
//!
//! A stage's output is one file: a prelude of 64 bytes, metadata (where the value came from, and a table of sections),
//! and raw sections that are mapped into memory as they are. `docs/artefacts.md` describes every byte.
//!
//! - [`write()`] and [`read()`] move a value of ivd-core to a file and back; [`peek`] reads the metadata alone, [`open`]
//!   verifies the payload by pieces as they are touched, and so does [`read_lazily`] with the voxels of a volume.
//! - [`ContentHash`] names what an artefact holds, wherever it came from; [`content_hash`] gives it without a file.
//! - [`Cache`] keeps artefacts by [`CacheKey`], so that a stage whose inputs and parameters didn't change need not run.
//!
//! Nothing in a file is trusted: lengths are checked against the file's size before anything is allocated, every byte
//! is covered by a hash, and a value is made by its own checked constructor. A file is replaced by renaming a finished
//! one over it, and is not touched where its bytes would not change.
//!
//! ```
//! use ivd_artefact::{Artefact, Provenance, read, write};
//! use ivd_core::{Grid, Volume, Voxels};
//!
//! # let folder = tempfile::tempdir().unwrap();
//! # let path = folder.path().join("volume.ivd");
//! let grid = Grid::with_spacing([4, 3, 2], [0.5, 0.5, 2.0])?;
//! let volume = Volume::new(grid, Voxels::from((0..24).collect::<Vec<u8>>()))?;
//! let provenance = Provenance::new("import", serde_json::json!({"file": "scan.nrrd"}));
//!
//! let written = write(&path, &volume, &provenance)?;
//! let loaded = read(&path)?;
//! assert_eq!(loaded.artefact, Artefact::Volume(volume));
//! assert_eq!(loaded.hash, written.hash);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sections are little-endian in the file and in memory; this crate doesn't build for big-endian machines.
#![deny(unsafe_code)]

#[cfg(target_endian = "big")]
compile_error!("artefacts are mapped as they are: this crate needs a little-endian machine");

mod cache;
mod canonical;
mod element;
mod error;
mod hash;
mod head;
mod kind;
mod kinds;
mod map;
mod metadata;
mod opened;
mod prelude;
mod provenance;
mod read;
mod write;

pub use cache::{Cache, CacheKey, Entry, FileHash, Lookup, user_cache};
pub use canonical::canonical_json;
pub use element::Element;
pub use error::Error;
pub use hash::{CHUNK, ContentHash, hash_all};
pub use head::{Info, SectionInfo};
pub use ivd_core::{Artefact, ArtefactRef, Kind};
pub use kind::KindCode;
pub use map::TemporaryFiles;
pub use opened::{Loaded, Opened};
pub use provenance::Provenance;
pub use read::{is_artefact, open, peek, read, read_lazily};
pub use write::{
    SectionHashes, Written, content_hash, section_hashes, write, write_again, write_with_metrics,
};
