//! From a value to a file: hash, compare with what is there, write beside it, rename.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use crate::kinds::{Encoded, encode};
use crate::metadata::{Bincode, Metadata, MetadataCodec, Section};
use crate::prelude::{self, ALIGN, MAX_METADATA, PRELUDE, Prelude, align};
use crate::{ArtefactRef, ContentHash, Error, Kind, KindCode, Provenance, canonical_json, hash, read};

/// Hashes of the sections of one value, by which it is written again without being hashed again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SectionHashes(Arc<[Vec<[u8; 32]>]>);

/// What [`write()`] did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Content hash of the artefact.
    pub hash: ContentHash,
    /// Bytes of the file.
    pub bytes: u64,
    /// False where the file already held these very bytes and was left alone.
    pub touched: bool,
    /// Hashes of its sections.
    pub sections: SectionHashes,
}

/// Writes an artefact.
///
/// The bytes go to a temporary file in the same folder, which is synced and renamed: a reader sees the old file, the
/// new one, or none. A file that already holds these bytes is not touched. Sections are hashed in parallel on the
/// calling rayon pool and written straight from the value.
///
/// # Errors
/// [`Error::Io`] where the folder can't be written to; [`Error::Unwritable`] for a value that is not a number, or one
/// that breaks its own check.
pub fn write<'a>(
    path: impl AsRef<Path>,
    artefact: impl Into<ArtefactRef<'a>>,
    provenance: &Provenance,
) -> Result<Written, Error> {
    write_with_metrics(path, artefact, provenance, &Value::Null)
}

/// As [`write()`], with a small JSON of metrics beside the provenance. It is no part of the content hash.
///
/// # Errors
/// As [`write()`].
pub fn write_with_metrics<'a>(
    path: impl AsRef<Path>,
    artefact: impl Into<ArtefactRef<'a>>,
    provenance: &Provenance,
    metrics: &Value,
) -> Result<Written, Error> {
    write_hashed(path.as_ref(), artefact.into(), provenance, metrics, None)
}

/// As [`write_with_metrics`], of a value whose sections have been hashed.
///
/// # Errors
/// As [`write()`].
pub fn write_again<'a>(
    path: impl AsRef<Path>,
    artefact: impl Into<ArtefactRef<'a>>,
    provenance: &Provenance,
    metrics: &Value,
    sections: &SectionHashes,
) -> Result<Written, Error> {
    write_hashed(path.as_ref(), artefact.into(), provenance, metrics, Some(sections))
}

fn write_hashed(
    path: &Path,
    artefact: ArtefactRef<'_>,
    provenance: &Provenance,
    metrics: &Value,
    sections: Option<&SectionHashes>,
) -> Result<Written, Error> {
    let kind = artefact.kind();
    let unwritable = |problem| Error::Unwritable { path: path.to_owned(), kind: kind.name(), problem };
    let encoded = encode(artefact).map_err(unwritable)?;
    let sections = sections.cloned().unwrap_or_else(|| hash_sections(&encoded));
    debug_assert!(sections == hash_sections(&encoded), "the hashes are another value's");
    let (head, bytes, hash) = head(kind, &encoded, &sections, provenance, metrics).map_err(unwritable)?;
    if holds(path, &head, bytes) {
        ivd_fs::sweep(ivd_fs::folder_of(path));
        return Ok(Written { hash, bytes, touched: false, sections });
    }
    let failed = |action, source| Error::io(path, action)(source);
    let touched = ivd_fs::replace(path, failed, |to| {
        payload(to, &head, &encoded).map_err(|source| failed("write", source))
    })?;
    Ok(Written { hash, bytes, touched, sections })
}

/// The content hash of a value, without a file: what [`write()`] would return.
///
/// # Errors
/// [`Error::Unwritable`] for a value that [`write()`] would refuse.
pub fn content_hash<'a>(artefact: impl Into<ArtefactRef<'a>>) -> Result<ContentHash, Error> {
    section_hashes(artefact).map(|(hash, _)| hash)
}

/// The content hash of a value and those of its sections, for [`write_again`].
///
/// # Errors
/// As [`content_hash`].
pub fn section_hashes<'a>(
    artefact: impl Into<ArtefactRef<'a>>,
) -> Result<(ContentHash, SectionHashes), Error> {
    let artefact = artefact.into();
    let kind = artefact.kind();
    let unwritable = |problem| Error::Unwritable { path: "(in memory)".into(), kind: kind.name(), problem };
    let encoded = encode(artefact).map_err(unwritable)?;
    let provenance = Provenance::new("", Value::Null);
    let sections = hash_sections(&encoded);
    let (_, _, hash) = head(kind, &encoded, &sections, &provenance, &Value::Null).map_err(unwritable)?;
    Ok((hash, sections))
}

/// Prelude, metadata and padding up to the payload; bytes of the whole file; content hash.
fn head(
    kind: Kind,
    encoded: &Encoded<'_>,
    sections: &SectionHashes,
    provenance: &Provenance,
    metrics: &Value,
) -> Result<(Vec<u8>, u64, ContentHash), String> {
    let mut metadata = Metadata {
        stage: provenance.stage.clone(),
        revision: provenance.revision,
        params: canonical_json(&provenance.params),
        inputs: provenance.inputs.iter().map(|(name, hash)| (name.clone(), hash.0)).collect(),
        backend: provenance.backend.clone(),
        metrics: canonical_json(metrics),
        content: encoded.content.clone(),
        sections: table(encoded, sections),
    };
    // Offsets have a fixed width: they can be filled in once the length is known.
    let length = Bincode::encode(&metadata)?.len();
    let length = u32::try_from(length).ok().filter(|&n| n <= MAX_METADATA);
    let length = length.ok_or("its metadata are too long")?;
    let payload_offset = align(PRELUDE as u64 + u64::from(length)).expect("metadata are short");
    let end = place(&mut metadata.sections, payload_offset).ok_or("it is too long for a file")?;
    let version = encoded.version.unwrap_or(kind.version());
    let mut prelude = Prelude {
        kind,
        kind_version: version,
        sections: u16::try_from(metadata.sections.len()).map_err(|_| "it has more than 65535 sections")?,
        metadata: length,
        payload_offset: payload_offset as u32,
        payload: end - payload_offset,
        root: [0; 32],
    };
    let mut head = prelude.to_bytes().to_vec();
    head.extend(Bincode::encode(&metadata)?);
    head.resize(payload_offset as usize, 0);
    prelude.root = prelude::root(&head);
    head[..PRELUDE].copy_from_slice(&prelude.to_bytes());
    Ok((head, end, hash::content(kind, version, &metadata)))
}

fn hash_sections(encoded: &Encoded<'_>) -> SectionHashes {
    SectionHashes(encoded.sections.iter().map(|section| hash::chunk_hashes(&section.bytes)).collect())
}

/// The section table, offsets still 0.
fn table(encoded: &Encoded<'_>, hashes: &SectionHashes) -> Vec<Section> {
    let row = |(section, chunks): (&crate::kinds::SectionBytes<'_>, &Vec<[u8; 32]>)| Section {
        name: section.name.to_string(),
        element: section.element.name().to_owned(),
        shape: section.shape.clone(),
        offset: 0,
        length: section.bytes.len() as u64,
        hash: hash::section_hash(chunks),
        chunks: chunks.clone(),
    };
    encoded.sections.iter().zip(hashes.0.iter()).map(row).collect()
}

/// Gives each section the next aligned offset; the file's end, or `None` beyond `u64`.
fn place(sections: &mut [Section], payload_offset: u64) -> Option<u64> {
    let mut end = payload_offset;
    for section in sections {
        section.offset = align(end)?;
        end = section.offset.checked_add(section.length)?;
    }
    Some(end)
}

/// Whether the file at `path` already holds these bytes, intact.
fn holds(path: &Path, head: &[u8], file_bytes: u64) -> bool {
    let same_head = || -> std::io::Result<bool> {
        let mut file = File::open(path)?;
        if file.metadata()?.len() != file_bytes {
            return Ok(false);
        }
        let mut prelude = [0; PRELUDE];
        file.read_exact(&mut prelude)?;
        Ok(prelude == head[..PRELUDE])
    };
    same_head().unwrap_or(false) && read::open(path).is_ok_and(|opened| opened.verify().is_ok())
}

fn payload(to: &mut dyn Write, head: &[u8], encoded: &Encoded<'_>) -> std::io::Result<()> {
    to.write_all(head)?;
    let mut end = head.len() as u64;
    for section in &encoded.sections {
        let padding = end.next_multiple_of(ALIGN) - end;
        to.write_all(&[0; ALIGN as usize][..padding as usize])?;
        to.write_all(&section.bytes)?;
        end += padding + section.bytes.len() as u64;
    }
    Ok(())
}
