//! A mapped artefact, verified piece by piece.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use ivd_core::ByteSource;
use rayon::prelude::*;
use serde_json::Value;

use crate::hash::{self, CHUNK};
use crate::head::{Head, Info};
use crate::kinds::{Decoder, decode};
use crate::map::Map;
use crate::{Artefact, ContentHash, Error, Provenance};

/// An artefact's value: every byte was verified, but for the voxels of a volume that [`crate::read_lazily`] gave.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The value; its bulk data view the mapped file.
    pub artefact: Artefact,
    /// Where it came from.
    pub provenance: Provenance,
    /// Metrics stored beside it; `null` where there are none.
    pub metrics: Value,
    /// Content hash.
    pub hash: ContentHash,
    /// Version of its kind in the file.
    pub kind_version: u16,
    /// The file behind the value.
    pub file: Arc<Opened>,
}

/// An artefact whose payload is mapped and not yet read.
///
/// Looked at as a [`ByteSource`], it verifies the chunks that are touched and remembers them, so that a look at a part of a large
/// file reads that part alone; what was wrong, [`Opened::damage`] tells. [`crate::read()`] verifies everything once.
pub struct Opened {
    path: PathBuf,
    map: Map,
    head: Head,
    verified: Vec<Box<[AtomicBool]>>,
    bytes_verified: AtomicU64,
    /// Section and chunk of the first touched bytes that didn't verify.
    first_bad: OnceLock<(usize, usize)>,
}

impl ByteSource for Opened {
    fn bytes(&self) -> &[u8] {
        self.map.bytes()
    }

    fn touch(&self, range: Range<usize>) {
        for (at, section) in self.head.info.sections.iter().enumerate() {
            let first = (section.offset as usize).max(range.start) - section.offset as usize;
            let end = range.end.saturating_sub(section.offset as usize).min(section.length as usize);
            if first < end {
                let mut chunks = first / CHUNK..end.div_ceil(CHUNK);
                // Asked often, and mostly of what is verified: only then is it worth the threads.
                if chunks.clone().all(|chunk| self.verified[at][chunk].load(Ordering::Relaxed)) {
                    continue;
                }
                let bad = chunks.clone().into_par_iter().any(|chunk| !self.verify_chunk(at, chunk));
                if bad && let Some(chunk) = chunks.find(|&chunk| !self.verify_chunk(at, chunk)) {
                    let _ = self.first_bad.set((at, chunk));
                }
            }
        }
    }

    fn damaged(&self) -> bool {
        self.first_bad.get().is_some()
    }
}

impl std::fmt::Debug for Opened {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Opened")
            .field("path", &self.path)
            .field("info", &self.head.info)
            .finish_non_exhaustive()
    }
}

impl Opened {
    /// A mapped file with its head; nothing of the payload was looked at.
    pub(crate) fn new(path: &Path, map: Map, head: Head) -> Self {
        let flags = |n: usize| (0..n).map(|_| AtomicBool::new(false)).collect();
        let verified = head.chunks.iter().map(|chunks| flags(chunks.len())).collect();
        let (bytes_verified, first_bad) = (AtomicU64::new(0), OnceLock::new());
        Self { path: path.to_owned(), map, head, verified, bytes_verified, first_bad }
    }

    /// What the file says about itself.
    pub fn info(&self) -> &Info {
        &self.head.info
    }

    /// Verifies all sections and the padding between them, in parallel.
    ///
    /// # Errors
    /// [`Error::SectionHash`] names the first chunk that doesn't match, [`Error::Padding`] the first byte that isn't 0.
    pub fn verify(&self) -> Result<(), Error> {
        self.verify_but("")
    }

    /// Verifies all sections but the one of that name.
    pub(crate) fn verify_but(&self, lazy: &str) -> Result<(), Error> {
        self.verify_padding()?;
        let chunks: Vec<(usize, usize)> = (0..self.verified.len())
            .filter(|&section| self.head.info.sections[section].name != lazy)
            .flat_map(|section| (0..self.verified[section].len()).map(move |chunk| (section, chunk)))
            .collect();
        match chunks.par_iter().find_first(|&&(section, chunk)| !self.verify_chunk(section, chunk)) {
            Some(&(section, chunk)) => Err(self.bad_chunk(section, chunk)),
            None => Ok(()),
        }
    }

    /// Bytes of the sections that were verified so far, and so read.
    pub fn bytes_verified(&self) -> u64 {
        self.bytes_verified.load(Ordering::Relaxed)
    }

    /// What was wrong with bytes that were touched, if anything.
    pub fn damage(&self) -> Option<Error> {
        self.first_bad.get().map(|&(section, chunk)| self.bad_chunk(section, chunk))
    }

    /// The value, from sections that [`Opened::verify`] has seen, or that are verified when they are touched.
    pub(crate) fn load(self: Arc<Self>) -> Result<Loaded, Error> {
        let source: Arc<dyn ByteSource> = self.clone();
        let info = self.head.info.clone();
        let mut decoder = Decoder::new(&info.meta, &info.sections, source);
        let artefact = decode(info.kind, &mut decoder).map_err(|problem| problem.at(&self.path))?;
        Ok(Loaded {
            artefact,
            provenance: info.provenance,
            metrics: info.metrics,
            hash: info.hash,
            kind_version: info.kind_version,
            file: self,
        })
    }

    fn section_bytes(&self, section: usize) -> &[u8] {
        let info = &self.head.info.sections[section];
        &self.map.bytes()[info.offset as usize..(info.offset + info.length) as usize]
    }

    fn verify_chunk(&self, section: usize, chunk: usize) -> bool {
        let seen = &self.verified[section][chunk];
        if !seen.load(Ordering::Relaxed) {
            let bytes =
                self.section_bytes(section).chunks(CHUNK).nth(chunk).expect("one hash a chunk was checked");
            let sound = hash::chunk_hash(bytes) == self.head.chunks[section][chunk];
            if sound && !seen.swap(true, Ordering::Relaxed) {
                self.bytes_verified.fetch_add(bytes.len() as u64, Ordering::Relaxed);
            }
            return sound;
        }
        true
    }

    fn bad_chunk(&self, section: usize, chunk: usize) -> Error {
        let section = self.head.info.sections[section].name.clone();
        Error::SectionHash { path: self.path.clone(), section, chunk }
    }

    fn verify_padding(&self) -> Result<(), Error> {
        let mut end = self.head.payload_offset;
        for section in &self.head.info.sections {
            let gap = &self.map.bytes()[end as usize..section.offset as usize];
            if let Some(at) = gap.iter().position(|&b| b != 0) {
                return Err(Error::Padding { path: self.path.clone(), offset: end + at as u64 });
            }
            end = section.offset + section.length;
        }
        Ok(())
    }
}
