//! Hashes: of a section by chunks, of what an artefact means, and the name that both are printed by.

use crate::KindCode;
use std::fmt;
use std::io::{self, Read};
use std::str::FromStr;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Kind;
use crate::metadata::Metadata;

/// Bytes of a chunk, the unit in which sections are hashed and verified.
pub const CHUNK: usize = 4 << 20;

/// BLAKE3 hash of what an artefact holds: its kind, its sections and their meaning, not where it came from.
///
/// Printed, parsed and serialized as 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ContentHash(pub [u8; 32]);

impl ContentHash {
    /// The first 12 digits, for people.
    pub fn short(&self) -> String {
        self.to_string()[..12].to_owned()
    }
}

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ContentHash({self})")
    }
}

impl FromStr for ContentHash {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let bad = || format!("`{text}` is not a hash of 64 hexadecimal digits");
        if text.len() != 64 || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(bad());
        }
        let mut bytes = [0; 32];
        for (byte, pair) in bytes.iter_mut().zip(text.as_bytes().chunks(2)) {
            let pair = std::str::from_utf8(pair).map_err(|_| bad())?;
            *byte = u8::from_str_radix(pair, 16).map_err(|_| bad())?;
        }
        Ok(Self(bytes))
    }
}

impl Serialize for ContentHash {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for ContentHash {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = std::borrow::Cow::<'de, str>::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

/// Adds what is read to a hash, piece by piece. Nothing is mapped into memory: it would count as the program's, and others may write into a file that isn't
/// an artefact, or cut it.
///
/// # Errors
/// That of the reader.
pub fn hash_all(hasher: &mut blake3::Hasher, mut from: impl Read) -> io::Result<()> {
    let mut piece = Vec::with_capacity(CHUNK);
    loop {
        piece.clear();
        from.by_ref().take(CHUNK as u64).read_to_end(&mut piece)?;
        if piece.is_empty() {
            return Ok(());
        }
        hasher.update_rayon(&piece);
    }
}

/// Hash of every chunk of a section, in parallel.
pub(crate) fn chunk_hashes(bytes: &[u8]) -> Vec<[u8; 32]> {
    bytes.par_chunks(CHUNK).map(chunk_hash).collect()
}

/// Hash of one chunk.
pub(crate) fn chunk_hash(chunk: &[u8]) -> [u8; 32] {
    *blake3::hash(chunk).as_bytes()
}

/// Hash of a section: the hash of its chunks' hashes, one after the other.
pub(crate) fn section_hash(chunks: &[[u8; 32]]) -> [u8; 32] {
    *blake3::hash(chunks.as_flattened()).as_bytes()
}

/// A BLAKE3 hasher for fields: numbers little-endian, text and lists with their length before them, so that no two
/// different lists of fields feed it the same bytes.
pub(crate) struct FieldHasher(blake3::Hasher);

impl FieldHasher {
    /// A hasher for the purpose that `magic` names.
    pub(crate) fn new(magic: [u8; 4]) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&magic);
        Self(hasher)
    }

    pub(crate) fn raw(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.update(bytes);
        self
    }

    pub(crate) fn number(&mut self, value: u64) -> &mut Self {
        self.raw(&value.to_le_bytes())
    }

    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.number(text.len() as u64).raw(text.as_bytes())
    }

    pub(crate) fn finish(&self) -> [u8; 32] {
        *self.0.finalize().as_bytes()
    }
}

/// The content hash of an artefact from its metadata.
pub(crate) fn content(kind: Kind, version: u16, metadata: &Metadata) -> ContentHash {
    let mut hasher = FieldHasher::new(*b"IVDC");
    hasher.raw(&kind.code().to_le_bytes()).raw(&version.to_le_bytes()).text(&metadata.content);
    hasher.number(metadata.sections.len() as u64);
    for section in &metadata.sections {
        hasher.text(&section.name).text(&section.element).number(section.shape.len() as u64);
        for &n in &section.shape {
            hasher.number(n);
        }
        hasher.raw(&section.hash);
    }
    ContentHash(hasher.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives a few bytes at a time, as pipes do.
    struct Drops<'a>(&'a [u8]);

    impl Read for Drops<'_> {
        fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
            let bytes = room.len().min(70_001);
            self.0.read(&mut room[..bytes])
        }
    }

    #[test]
    fn what_is_read_in_pieces_hashes_as_a_whole() {
        for length in [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK + 12_345] {
            let bytes: Vec<u8> = (0..length).map(|i| (i % 251) as u8).collect();
            let mut hasher = blake3::Hasher::new();
            hash_all(&mut hasher, Drops(&bytes)).unwrap();
            assert_eq!(hasher.finalize(), blake3::hash(&bytes), "{length} bytes");
        }
    }

    #[test]
    fn hashes_print_parse_and_serialize_as_hex() {
        let hash = ContentHash(std::array::from_fn(|i| (i * 7 + 3) as u8));
        assert_eq!(hash.to_string().parse(), Ok(hash));
        assert_eq!(serde_json::to_value(hash).unwrap(), serde_json::json!(hash.to_string()));
        assert_eq!(serde_json::from_value::<ContentHash>(serde_json::json!(hash.to_string())).unwrap(), hash);
        assert_eq!(hash.short(), "030a11181f26");
        for bad in ["", "zz", &"0".repeat(63), &"é".repeat(32), &"+1".repeat(32)] {
            assert!(bad.parse::<ContentHash>().is_err());
        }
    }

    #[test]
    fn chunked_hash_of_a_section_ends_at_every_chunk_border() {
        for len in [0, 1, CHUNK - 1, CHUNK, CHUNK + 1] {
            let bytes = vec![5_u8; len];
            let chunks = chunk_hashes(&bytes);
            assert_eq!(chunks.len(), len.div_ceil(CHUNK));
            for (i, hash) in chunks.iter().enumerate() {
                assert_eq!(*hash, chunk_hash(&bytes[i * CHUNK..((i + 1) * CHUNK).min(len)]));
            }
        }
    }
}
