//! From a file to a value: prelude, metadata, section table, then the sections, each verified before it is used.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use crate::hash::{self, CHUNK};
use crate::kinds::Element;
use crate::map::Map;
use crate::metadata::{Bincode, Metadata, MetadataCodec, Section};
use crate::prelude::{CONTAINER_VERSION, MAGIC, PRELUDE, Prelude, align};
use crate::{Artefact, ContentHash, Error, Kind, Opened, Provenance, write};

/// An artefact's value: every byte was verified, but for the voxels of a volume that [`read_lazily`] gave.
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

/// Whether a file begins like an artefact. A file that can't be read doesn't.
pub fn is_artefact(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    let mut magic = [0; 4];
    // Opening a pipe would wait for its writer.
    path.is_file()
        && File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok()
        && magic == MAGIC
}

/// Reads prelude and metadata and verifies their hash; the payload isn't touched, only its length is checked.
///
/// # Errors
/// [`Error`] names the part that is damaged, cut, unknown or newer than this program.
pub fn peek(path: impl AsRef<Path>) -> Result<Info, Error> {
    let path = path.as_ref();
    let (_, head) = Head::read(path)?;
    Ok(head.info)
}

/// Reads an artefact, mapped, every section verified in parallel on the calling rayon pool.
///
/// # Errors
/// [`Error`] names the part that is damaged, cut, unknown or newer than this program, or what the value's own check
/// found.
pub fn read(path: impl AsRef<Path>) -> Result<Loaded, Error> {
    let opened = open(path)?;
    opened.verify()?;
    Arc::new(opened).load()
}

/// As [`read`], but a volume's voxels are verified when they are touched ([`ivd_core::Volume::layers`]), 4 MiB at a time,
/// and what nobody touches is never read. Whoever uses the value asks [`Opened::damage`] of [`Loaded::file`] before
/// trusting what came of it.
///
/// # Errors
/// As [`read`], of what is verified at once.
pub fn read_lazily(path: impl AsRef<Path>) -> Result<Loaded, Error> {
    let opened = open(path)?;
    opened.verify_but(if opened.info().kind == Kind::Volume { LAZY } else { "" })?;
    Arc::new(opened).load()
}

/// The section of a volume that is verified as it is touched.
const LAZY: &str = "voxels";

/// Opens an artefact without reading its payload: sections are verified as they are touched.
///
/// # Errors
/// As [`peek`].
pub fn open(path: impl AsRef<Path>) -> Result<Opened, Error> {
    let path = path.as_ref();
    let (file, head) = Head::read(path)?;
    let map = Map::new(&file).map_err(Error::io(path, "map"))?;
    // The length may have changed between the check and the mapping.
    head.check_length(path, map.bytes().len() as u64)?;
    Ok(Opened::new(path, map, head))
}

/// Prelude and metadata, checked.
pub(crate) struct Head {
    pub(crate) info: Info,
    pub(crate) chunks: Vec<Vec<[u8; 32]>>,
    pub(crate) payload_offset: u64,
}

impl Head {
    /// Reads and verifies; also gives the file.
    fn read(path: &Path) -> Result<(File, Self), Error> {
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
        if head.len() as u64 != u64::from(prelude.payload_offset) || write::root(head) != prelude.root {
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
    fn check_length(&self, path: &Path, found: u64) -> Result<(), Error> {
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
