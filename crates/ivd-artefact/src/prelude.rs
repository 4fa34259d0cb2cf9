//! The first 64 bytes of every artefact, written by hand, little-endian.

use std::path::Path;

use crate::{Error, Kind, KindCode};

/// First bytes of every artefact.
pub(crate) const MAGIC: [u8; 4] = *b"IVDA";
/// Container version that this crate writes and reads.
pub(crate) const CONTAINER_VERSION: u16 = 1;
/// Bytes of the prelude.
pub(crate) const PRELUDE: usize = 64;
/// Bytes of the prelude that the root covers: all before the root itself.
const BEFORE_ROOT: usize = 32;
/// Sections begin at multiples of this, so that they can be mapped.
pub(crate) const ALIGN: u64 = 4096;
/// Most bytes of metadata that are read. The hashes of a terabyte of chunks take 8 MiB.
pub(crate) const MAX_METADATA: u32 = 64 << 20;

/// The prelude, decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Prelude {
    pub(crate) kind: Kind,
    pub(crate) kind_version: u16,
    pub(crate) sections: u16,
    pub(crate) metadata: u32,
    pub(crate) payload_offset: u32,
    pub(crate) payload: u64,
    /// BLAKE3 of the bytes before it, the metadata and the padding up to the payload.
    pub(crate) root: [u8; 32],
}

/// The next multiple of [`ALIGN`]; `None` beyond `u64`.
pub(crate) fn align(offset: u64) -> Option<u64> {
    offset.checked_next_multiple_of(ALIGN)
}

impl Prelude {
    /// The bytes, the root as it stands.
    pub(crate) fn to_bytes(&self) -> [u8; PRELUDE] {
        let mut bytes = [0; PRELUDE];
        let mut at = 0;
        let mut put = |field: &[u8]| {
            bytes[at..at + field.len()].copy_from_slice(field);
            at += field.len();
        };
        put(&MAGIC);
        put(&CONTAINER_VERSION.to_le_bytes());
        put(&self.kind.code().to_le_bytes());
        put(&self.kind_version.to_le_bytes());
        put(&self.sections.to_le_bytes());
        put(&0_u32.to_le_bytes()); // flags: none yet
        put(&self.metadata.to_le_bytes());
        put(&self.payload_offset.to_le_bytes());
        put(&self.payload.to_le_bytes());
        put(&self.root);
        bytes
    }

    /// Bytes of the whole file.
    pub(crate) fn file_bytes(&self) -> u64 {
        u64::from(self.payload_offset) + self.payload
    }

    /// Decodes and checks against the file's size, before anything is allocated for what it announces.
    pub(crate) fn parse(path: &Path, bytes: &[u8; PRELUDE], file_bytes: u64) -> Result<Self, Error> {
        let bad = |problem: String| Error::Metadata { path: path.to_owned(), part: "prelude", problem };
        let mut rest = &bytes[4..];
        let container = take_u16(&mut rest);
        let code = take_u16(&mut rest);
        let kind_version = take_u16(&mut rest);
        let sections = take_u16(&mut rest);
        let flags = take_u32(&mut rest);
        let metadata = take_u32(&mut rest);
        let payload_offset = take_u32(&mut rest);
        let payload = u64::from(take_u32(&mut rest)) | u64::from(take_u32(&mut rest)) << 32;
        let root: [u8; 32] = rest.try_into().expect("32 bytes of the prelude are left");

        if bytes[..4] != MAGIC {
            return Err(Error::NotAnArtefact { path: path.to_owned() });
        }
        newer(path, "container", container, CONTAINER_VERSION)?;
        let kind = Kind::from_code(code).ok_or_else(|| Error::UnknownKind { path: path.to_owned(), code })?;
        newer(path, kind.name(), kind_version, kind.version())?;
        if flags != 0 {
            return Err(bad(format!("flags {flags:#x} that this program doesn't know")));
        }
        if metadata > MAX_METADATA {
            return Err(bad(format!("{metadata} bytes of metadata, at most {MAX_METADATA} are read")));
        }
        let due = align(PRELUDE as u64 + u64::from(metadata));
        if due != Some(u64::from(payload_offset)) {
            return Err(bad(format!("payload at byte {payload_offset} after {metadata} bytes of metadata")));
        }
        let length = |part: &str, needed: u64| Error::Length {
            path: path.to_owned(),
            part: part.to_owned(),
            needed,
            found: file_bytes,
        };
        if u64::from(payload_offset) > file_bytes {
            return Err(length("the metadata", u64::from(payload_offset)));
        }
        match u64::from(payload_offset).checked_add(payload) {
            // A cut file is told by its section, once the section table is read.
            Some(needed) if needed >= file_bytes => {}
            needed => return Err(length("the payload", needed.unwrap_or(u64::MAX))),
        }
        Ok(Self { kind, kind_version, sections, metadata, payload_offset, payload, root })
    }
}

/// Refuses versions beyond `supported`, and version 0, which never was.
fn newer(path: &Path, what: &'static str, found: u16, supported: u16) -> Result<(), Error> {
    if found > supported {
        return Err(Error::Newer { path: path.to_owned(), what, found, supported });
    }
    if found == 0 {
        let problem = format!("{what} version 0");
        return Err(Error::Metadata { path: path.to_owned(), part: "prelude", problem });
    }
    Ok(())
}

fn take_u16(rest: &mut &[u8]) -> u16 {
    let (field, after) = rest.split_first_chunk().expect("the prelude has a fixed length");
    *rest = after;
    u16::from_le_bytes(*field)
}

fn take_u32(rest: &mut &[u8]) -> u32 {
    let (field, after) = rest.split_first_chunk().expect("the prelude has a fixed length");
    *rest = after;
    u32::from_le_bytes(*field)
}

/// The root: BLAKE3 of the head without the root itself. The metadata hold the hashes of all sections, and all padding
/// is 0, so that it covers every byte of the file.
pub(crate) fn root(head: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&head[..BEFORE_ROOT]).update(&head[PRELUDE..]);
    *hasher.finalize().as_bytes()
}
