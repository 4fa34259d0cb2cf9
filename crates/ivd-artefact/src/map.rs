//! Memory-mapped files: the only unsafe code of the crate.
//!
//! Mapping a file is unsafe because the bytes behind a `&[u8]` change when somebody writes into the file, and reading
//! beyond a file that was cut ends the process. Artefacts are never written in place: this crate replaces them by
//! renaming a finished file over the old name, which leaves a mapped file whole until its last reader is gone. A
//! program that writes into an artefact behind our back breaks this; the hashes find most of what it does.

use std::fs::File;

/// A whole file, mapped for reading.
pub(crate) struct Map(memmap2::Mmap);

impl Map {
    /// Maps a file.
    #[allow(unsafe_code)]
    pub(crate) fn new(file: &File) -> std::io::Result<Self> {
        // SAFETY: see the head of this module.
        unsafe { memmap2::Mmap::map(file) }.map(Self)
    }

    /// The file's bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }
}
