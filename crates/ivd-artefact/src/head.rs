//! What stands before the payload of a file: prelude, metadata and section table, verified and checked before anything is believed.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde_json::Value;

use crate::hash::{self, CHUNK};
use crate::metadata::{Bincode, Metadata, MetadataCodec, Section};
use crate::prelude::{self, CONTAINER_VERSION, MAGIC, PRELUDE, Prelude, align};
use crate::{ContentHash, Element, Error, Kind, Provenance};

/// What a file says about itself, without its payload.
#[derive(Debug, Clone)]
pub struct Info {
    /// What it holds.
    pub kind: Kind,
    /// Version of the kind.
    pub kind_version: u16,
    /// Version of the container.
    pub container_version: u16,
    /// Where it came from.
    pub provenance: Provenance,
    /// Metrics stored beside it; `null` where there are none.
    pub metrics: Value,
    /// Content hash.
    pub hash: ContentHash,
    /// The section table.
    pub sections: Vec<SectionInfo>,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// What the kind keeps beside its sections: grid, classes, …
    pub meta: Value,
}

/// A row of the section table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SectionInfo {
    /// Name, unique in the file.
    pub name: String,
    /// Element type.
    pub element: Element,
    /// Shape, slowest axis first.
    pub shape: Vec<u64>,
    /// Bytes from the start of the file, a multiple of 4096.
    pub offset: u64,
    /// Bytes.
    pub length: u64,
    /// BLAKE3 of the hashes of its chunks.
    pub hash: ContentHash,
}

/// Prelude and metadata, checked.
pub(crate) struct Head {
    pub(crate) info: Info,
    pub(crate) chunks: Vec<Vec<[u8; 32]>>,
    pub(crate) payload_offset: u64,
}

impl Head {
    /// Reads and verifies; also gives the file.
    pub(crate) fn read(path: &Path) -> Result<(File, Self), Error> {
        // Before it is opened: opening a pipe would wait for its writer.
        if !path.metadata().map_err(Error::io(path, "open"))?.is_file() {
            return Err(Error::NotAnArtefact { path: path.to_owned() });
        }
        let mut file = File::open(path).map_err(Error::io(path, "open"))?;
        let stat = file.metadata().map_err(Error::io(path, "read"))?;
        let mut bytes = Vec::with_capacity(PRELUDE);
        file.by_ref().take(PRELUDE as u64).read_to_end(&mut bytes).map_err(Error::io(path, "read"))?;
        if !bytes.starts_with(&MAGIC[..bytes.len().min(4)]) || bytes.is_empty() {
            return Err(Error::NotAnArtefact { path: path.to_owned() });
        }
        let prelude: [u8; PRELUDE] = bytes.as_slice().try_into().map_err(|_| Error::Length {
            path: path.to_owned(),
            part: "the prelude".to_owned(),
            needed: PRELUDE as u64,
            found: bytes.len() as u64,
        })?;
        let prelude = Prelude::parse(path, &prelude, stat.len())?;
        let rest = u64::from(prelude.payload_offset) - PRELUDE as u64;
        file.by_ref().take(rest).read_to_end(&mut bytes).map_err(Error::io(path, "read"))?;
        let head = Self::parse(path, &prelude, &bytes)?;
        head.check_length(path, stat.len())?;
        Ok((file, head))
    }

    fn parse(path: &Path, prelude: &Prelude, head: &[u8]) -> Result<Self, Error> {
        if head.len() as u64 != u64::from(prelude.payload_offset) || prelude::root(head) != prelude.root {
            return Err(Error::HeadHash { path: path.to_owned() });
        }
        let bad = |part| move |problem| Error::Metadata { path: path.to_owned(), part, problem };
        let metadata =
            Bincode::decode(&head[PRELUDE..PRELUDE + prelude.metadata as usize]).map_err(bad("metadata"))?;
        if let Some(at) = head[PRELUDE + prelude.metadata as usize..].iter().position(|&b| b != 0) {
            let offset = (PRELUDE + prelude.metadata as usize + at) as u64;
            return Err(Error::Padding { path: path.to_owned(), offset });
        }
        let sections = table(prelude, &metadata).map_err(bad("section table"))?;
        let json = |part, text: &str| {
            serde_json::from_str::<Value>(text).map_err(|e| bad(part)(format!("not JSON: {e}")))
        };
        let inputs = metadata.inputs.iter().map(|(name, hash)| (name.clone(), ContentHash(*hash))).collect();
        let info = Info {
            kind: prelude.kind,
            kind_version: prelude.kind_version,
            container_version: CONTAINER_VERSION,
            hash: hash::content(prelude.kind, prelude.kind_version, &metadata),
            provenance: Provenance {
                params: json("parameters", &metadata.params)?,
                stage: metadata.stage,
                revision: metadata.revision,
                inputs,
                backend: metadata.backend,
            },
            metrics: json("metrics", &metadata.metrics)?,
            sections,
            file_bytes: prelude.file_bytes(),
            meta: json("content", &metadata.content)?,
        };
        let chunks = metadata.sections.into_iter().map(|s| s.chunks).collect();
        Ok(Self { info, chunks, payload_offset: u64::from(prelude.payload_offset) })
    }

    /// Checks the file's length and names the first section that it cuts.
    pub(crate) fn check_length(&self, path: &Path, found: u64) -> Result<(), Error> {
        if found == self.info.file_bytes {
            return Ok(());
        }
        let cut = self.info.sections.iter().find(|s| s.offset + s.length > found);
        Err(Error::Length {
            path: path.to_owned(),
            part: cut.map_or_else(|| "the payload".to_owned(), |s| format!("section `{}`", s.name)),
            needed: cut.map_or(self.info.file_bytes, |s| s.offset + s.length),
            found,
        })
    }
}

/// Checks the section table: names, types, shapes against lengths, and that every section is where it must be.
fn table(prelude: &Prelude, metadata: &Metadata) -> Result<Vec<SectionInfo>, String> {
    if metadata.sections.len() != usize::from(prelude.sections) {
        return Err(format!("{} rows, the prelude says {}", metadata.sections.len(), prelude.sections));
    }
    let mut end = Some(u64::from(prelude.payload_offset));
    let mut sections = Vec::<SectionInfo>::with_capacity(metadata.sections.len());
    for section in &metadata.sections {
        let bad = |problem: &str| format!("section `{}`: {problem}", section.name);
        let info = row(section).map_err(|problem| bad(&problem))?;
        if end.and_then(align) != Some(section.offset) {
            return Err(bad(&format!("begins at byte {}, not where the last one ends", section.offset)));
        }
        end = section.offset.checked_add(section.length);
        sections.push(info);
    }
    if end != Some(prelude.file_bytes()) {
        return Err(format!("it ends at byte {end:?}, the payload at {}", prelude.file_bytes()));
    }
    let mut names: Vec<&str> = sections.iter().map(|s| s.name.as_str()).collect();
    names.sort_unstable();
    match names.windows(2).find(|w| w[0] == w[1]) {
        Some(twice) => Err(format!("section `{}` twice", twice[0])),
        None => Ok(sections),
    }
}

fn row(section: &Section) -> Result<SectionInfo, String> {
    let element = Element::from_name(&section.element)
        .ok_or_else(|| format!("unknown element type `{}`", section.element))?;
    let bytes = section.shape.iter().try_fold(element.bytes(), |n, &d| n.checked_mul(d));
    if bytes != Some(section.length) {
        return Err(format!(
            "{} bytes for {:?} elements of {}",
            section.length, section.shape, section.element
        ));
    }
    if section.chunks.len() as u64 != section.length.div_ceil(CHUNK as u64) {
        return Err(format!("{} chunk hashes for {} bytes", section.chunks.len(), section.length));
    }
    if hash::section_hash(&section.chunks) != section.hash {
        return Err("its hash isn't that of its chunks".to_owned());
    }
    Ok(SectionInfo {
        name: section.name.clone(),
        element,
        shape: section.shape.clone(),
        offset: section.offset,
        length: section.length,
        hash: ContentHash(section.hash),
    })
}
