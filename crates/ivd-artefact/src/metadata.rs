//! What stands between prelude and payload, and the one place that knows its encoding.
//!
//! The encoding is that of bincode's `legacy` configuration: integers of fixed width, little-endian; text and lists
//! with their length as `u64` before them; structs field by field without names; arrays of fixed length bare.

use serde::{Deserialize, Serialize};

use crate::prelude::MAX_METADATA;

/// The metadata of an artefact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Metadata {
    pub(crate) stage: String,
    pub(crate) revision: u32,
    /// Canonical JSON.
    pub(crate) params: String,
    /// Name and content hash, ascending by name.
    pub(crate) inputs: Vec<(String, [u8; 32])>,
    pub(crate) backend: String,
    /// Canonical JSON; `null` where there are none. No part of the content hash.
    pub(crate) metrics: String,
    /// Canonical JSON of what the kind keeps beside its sections.
    pub(crate) content: String,
    pub(crate) sections: Vec<Section>,
}

/// A row of the section table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Section {
    pub(crate) name: String,
    /// Name of the element type, such as `f32`.
    pub(crate) element: String,
    /// Slowest axis first.
    pub(crate) shape: Vec<u64>,
    /// Bytes from the start of the file.
    pub(crate) offset: u64,
    pub(crate) length: u64,
    /// BLAKE3 of the chunks' hashes.
    pub(crate) hash: [u8; 32],
    /// BLAKE3 of each chunk.
    pub(crate) chunks: Vec<[u8; 32]>,
}

/// Writes and reads [`Metadata`]. A replacement must keep the bytes or raise the container version.
pub(crate) trait MetadataCodec {
    /// The bytes.
    fn encode(metadata: &Metadata) -> Result<Vec<u8>, String>;
    /// The metadata; all bytes must be used.
    fn decode(bytes: &[u8]) -> Result<Metadata, String>;
}

/// The codec in use.
pub(crate) struct Bincode;

impl MetadataCodec for Bincode {
    fn encode(metadata: &Metadata) -> Result<Vec<u8>, String> {
        bincode::serde::encode_to_vec(metadata, bincode::config::legacy()).map_err(|e| e.to_string())
    }

    fn decode(bytes: &[u8]) -> Result<Metadata, String> {
        // The limit keeps a hostile length from being believed before its bytes are there.
        let config = bincode::config::legacy().with_limit::<{ MAX_METADATA as usize }>();
        let (metadata, used) =
            bincode::serde::decode_from_slice(bytes, config).map_err(|e| format!("undecodable: {e}"))?;
        if used != bytes.len() {
            return Err(format!("{} bytes are left over", bytes.len() - used));
        }
        Ok(metadata)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Metadata {
        Metadata {
            stage: "st".into(),
            revision: 3,
            params: "{}".into(),
            inputs: vec![("volume".into(), [7; 32])],
            backend: "cpu".into(),
            metrics: "null".into(),
            content: "{}".into(),
            sections: vec![Section {
                name: "s".into(),
                element: "u8".into(),
                shape: vec![1, 2],
                offset: 4096,
                length: 2,
                hash: [1; 32],
                chunks: vec![[2; 32]],
            }],
        }
    }

    #[test]
    fn encoding_is_the_documented_one() {
        let bytes = Bincode::encode(&sample()).unwrap();
        let mut due = Vec::new();
        let text = |due: &mut Vec<u8>, t: &str| {
            due.extend((t.len() as u64).to_le_bytes());
            due.extend(t.as_bytes());
        };
        text(&mut due, "st");
        due.extend(3_u32.to_le_bytes());
        text(&mut due, "{}");
        due.extend(1_u64.to_le_bytes());
        text(&mut due, "volume");
        due.extend([7; 32]);
        for t in ["cpu", "null", "{}"] {
            text(&mut due, t);
        }
        due.extend(1_u64.to_le_bytes());
        text(&mut due, "s");
        text(&mut due, "u8");
        for n in [2_u64, 1, 2, 4096, 2] {
            due.extend(n.to_le_bytes());
        }
        due.extend([1; 32]);
        due.extend(1_u64.to_le_bytes());
        due.extend([2; 32]);
        assert_eq!(bytes, due);
        assert_eq!(Bincode::decode(&bytes).unwrap(), sample());
    }

    #[test]
    fn every_cut_and_every_hostile_length_is_an_error() {
        let bytes = Bincode::encode(&sample()).unwrap();
        for end in 0..bytes.len() {
            assert!(Bincode::decode(&bytes[..end]).is_err());
        }
        for at in 0..bytes.len() - 8 {
            let mut hostile = bytes.clone();
            hostile[at..at + 8].fill(0xff);
            let _ = Bincode::decode(&hostile);
        }
    }
}
