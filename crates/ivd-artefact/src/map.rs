//! Memory-mapped files: the only unsafe code of the crate.
//!
//! Mapping a file is unsafe because the bytes behind a `&[u8]` change when somebody writes into the file, and reading
//! beyond a file that was cut ends the process. Artefacts are never written in place: this crate replaces them by
//! renaming a finished file over the old name, which leaves a mapped file whole until its last reader is gone. A
//! program that writes into an artefact behind our back breaks this; the hashes find most of what it does.

use std::fs::File;
use std::sync::Arc;

use ivd_core::{ByteSource, Spill, SpillSpace};

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

/// Room in temporary files without a name: nobody else can open them, and they are gone with their last reader.
#[derive(Debug, Default)]
pub struct TemporaryFiles;

impl Spill for TemporaryFiles {
    #[allow(unsafe_code)]
    fn space(&self, bytes: usize) -> std::io::Result<Box<dyn SpillSpace>> {
        let file = tempfile::tempfile()?;
        reserve(&file, bytes as u64)?;
        // SAFETY: the file has no name, so that no other program can write into it or cut it.
        let map = unsafe { memmap2::MmapOptions::new().len(bytes).map_mut(&file) }?;
        Ok(Box::new(Temporary(map)))
    }
}

/// Takes the room on the disk now: writing into a mapped file that finds none later would end the process.
#[cfg(target_os = "linux")]
fn reserve(file: &File, bytes: u64) -> std::io::Result<()> {
    match rustix::fs::fallocate(file, rustix::fs::FallocateFlags::empty(), 0, bytes) {
        Err(rustix::io::Errno::OPNOTSUPP) => file.set_len(bytes),
        done => Ok(done?),
    }
}

#[cfg(not(target_os = "linux"))]
fn reserve(file: &File, bytes: u64) -> std::io::Result<()> {
    file.set_len(bytes)
}

struct Temporary(memmap2::MmapMut);

impl SpillSpace for Temporary {
    fn bytes(&self) -> &[u8] {
        &self.0
    }
    fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.0
    }
    fn seal(self: Box<Self>) -> Arc<dyn ByteSource> {
        Arc::new(*self)
    }
}

impl ByteSource for Temporary {
    fn bytes(&self) -> &[u8] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::Exec;

    #[test]
    fn data_beyond_the_limit_lies_in_a_file_and_reads_as_it_was_written() {
        let exec = Exec::default().with_memory_limit(Some(100)).with_spill(Arc::new(TemporaryFiles));
        let mut bulk = exec.bulk::<u32>("numbers", 10_000).unwrap();
        assert!(bulk.iter().all(|v| *v == 0));
        bulk.iter_mut().enumerate().for_each(|(i, v)| *v = i as u32);
        let buffer = bulk.into_buffer();
        let copy = buffer.clone();
        drop(buffer);
        assert!(copy.iter().enumerate().all(|(i, v)| *v == i as u32) && copy.len() == 10_000);
    }
}
