//! Slices as tests want them, written element by element.

use std::collections::BTreeMap;
use std::path::Path;

use tempfile::TempDir;

use crate::volume::dicom::element::{PIXEL_DATA, Tag};

/// Group and element of the attributes that the tests set or leave out.
pub(super) mod tags {
    use super::Tag;

    pub(in super::super) const SOP_CLASS_UID: Tag = (0x08, 0x16);
    pub(in super::super) const SOP_INSTANCE_UID: Tag = (0x08, 0x18);
    pub(in super::super) const MODALITY: Tag = (0x08, 0x60);
    pub(in super::super) const SERIES_DESCRIPTION: Tag = (0x08, 0x103e);
    pub(in super::super) const PATIENT_NAME: Tag = (0x10, 0x10);
    pub(in super::super) const PATIENT_ID: Tag = (0x10, 0x20);
    pub(in super::super) const SLICE_THICKNESS: Tag = (0x18, 0x50);
    pub(in super::super) const SERIES_INSTANCE_UID: Tag = (0x20, 0x0e);
    pub(in super::super) const SERIES_NUMBER: Tag = (0x20, 0x11);
    pub(in super::super) const IMAGE_POSITION_PATIENT: Tag = (0x20, 0x32);
    pub(in super::super) const IMAGE_ORIENTATION_PATIENT: Tag = (0x20, 0x37);
    pub(in super::super) const SAMPLES_PER_PIXEL: Tag = (0x28, 0x02);
    pub(in super::super) const PHOTOMETRIC_INTERPRETATION: Tag = (0x28, 0x04);
    pub(in super::super) const NUMBER_OF_FRAMES: Tag = (0x28, 0x08);
    pub(in super::super) const ROWS: Tag = (0x28, 0x10);
    pub(in super::super) const COLUMNS: Tag = (0x28, 0x11);
    pub(in super::super) const PIXEL_SPACING: Tag = (0x28, 0x30);
    pub(in super::super) const BITS_ALLOCATED: Tag = (0x28, 0x100);
    pub(in super::super) const BITS_STORED: Tag = (0x28, 0x101);
    pub(in super::super) const HIGH_BIT: Tag = (0x28, 0x102);
    pub(in super::super) const PIXEL_REPRESENTATION: Tag = (0x28, 0x103);
    pub(in super::super) const RESCALE_INTERCEPT: Tag = (0x28, 0x1052);
    pub(in super::super) const RESCALE_SLOPE: Tag = (0x28, 0x1053);
    pub(in super::super) const PIXEL_DATA: Tag = super::PIXEL_DATA;
}

/// Transfer syntaxes, and the kind of picture (PS3.6, annex A).
pub(super) mod uids {
    pub(in super::super) const IMPLICIT_VR_LITTLE_ENDIAN: &str = "1.2.840.10008.1.2";
    pub(in super::super) const EXPLICIT_VR_LITTLE_ENDIAN: &str = "1.2.840.10008.1.2.1";
    /// Retired, but still found in archives.
    pub(in super::super) const EXPLICIT_VR_BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";
    pub(in super::super) const JPEGLS_LOSSLESS: &str = "1.2.840.10008.1.2.4.80";
    pub(in super::super) const MR_IMAGE_STORAGE: &str = "1.2.840.10008.5.1.4.1.1.4";
}

pub(super) const NAME: &str = "Fictional^Person";

#[derive(Clone)]
enum Value {
    Text(String),
    Words(Vec<u16>),
}

/// A slice of 3 × 2 pixels as a test wants it.
pub(super) struct Made {
    elements: BTreeMap<Tag, Value>,
}

impl Made {
    pub(super) fn new(series: &str, position: [f64; 3]) -> Self {
        let mut made = Self { elements: BTreeMap::new() };
        made.text(tags::SOP_CLASS_UID, uids::MR_IMAGE_STORAGE)
            .text(tags::SOP_INSTANCE_UID, "1.2.3.4")
            .text(tags::PATIENT_NAME, NAME)
            .text(tags::PATIENT_ID, "ID777")
            .text(tags::MODALITY, "MR")
            .text(tags::SERIES_DESCRIPTION, "T1 of fictional")
            .text(tags::SERIES_INSTANCE_UID, series)
            .text(tags::SERIES_NUMBER, &format!("{}", series.len()))
            .text(tags::SLICE_THICKNESS, "99")
            .text(tags::IMAGE_POSITION_PATIENT, &format!("{}\\{}\\{}", position[0], position[1], position[2]))
            .text(tags::IMAGE_ORIENTATION_PATIENT, "1\\0\\0\\0\\1\\0")
            .text(tags::PIXEL_SPACING, "0.5\\0.25")
            .text(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2")
            .number(tags::SAMPLES_PER_PIXEL, 1)
            .number(tags::ROWS, 2)
            .number(tags::COLUMNS, 3)
            .number(tags::BITS_ALLOCATED, 16)
            .number(tags::BITS_STORED, 16)
            .number(tags::HIGH_BIT, 15)
            .number(tags::PIXEL_REPRESENTATION, 1)
            .pixels(&[0; 6]);
        made
    }

    pub(super) fn text(&mut self, tag: Tag, value: &str) -> &mut Self {
        self.elements.insert(tag, Value::Text(value.to_owned()));
        self
    }

    pub(super) fn number(&mut self, tag: Tag, value: u16) -> &mut Self {
        self.elements.insert(tag, Value::Words(vec![value]));
        self
    }

    pub(super) fn pixels(&mut self, values: &[i16; 6]) -> &mut Self {
        self.elements.insert(PIXEL_DATA, Value::Words(values.iter().map(|&v| v as u16).collect()));
        self
    }

    pub(super) fn without(&mut self, tag: Tag) -> &mut Self {
        self.elements.remove(&tag);
        self
    }

    pub(super) fn save_as(&self, path: &Path, syntax: &str) {
        let explicit = syntax != uids::IMPLICIT_VR_LITTLE_ENDIAN;
        let big = syntax == uids::EXPLICIT_VR_BIG_ENDIAN;
        // The meta group is little-endian with types, whatever follows (PS3.10, 7.1).
        let meta = [
            element((2, 0x02), *b"UI", text(*b"UI", uids::MR_IMAGE_STORAGE), true, false),
            element((2, 0x03), *b"UI", text(*b"UI", "1.2.3.4"), true, false),
            element((2, 0x10), *b"UI", text(*b"UI", syntax), true, false),
        ]
        .concat();
        let length = element((2, 0), *b"UL", (meta.len() as u32).to_le_bytes().to_vec(), true, false);
        let mut bytes = [&[0; 128], &b"DICM"[..], &length, &meta].concat();
        for (&tag, value) in &self.elements {
            let kind = kind(tag);
            let value = match value {
                Value::Text(value) => text(kind, value),
                Value::Words(words) => words.iter().flat_map(|&w| ordered(w.to_le_bytes(), big)).collect(),
            };
            bytes.extend(element(tag, kind, value, explicit, big));
        }
        std::fs::write(path, bytes).unwrap();
    }

    pub(super) fn save(&self, dir: &TempDir, name: &str) {
        self.save_as(&dir.path().join(name), uids::EXPLICIT_VR_LITTLE_ENDIAN);
    }
}

/// The type of value of an attribute (PS3.6).
fn kind(tag: Tag) -> [u8; 2] {
    *match tag {
        tags::SOP_CLASS_UID | tags::SOP_INSTANCE_UID | tags::SERIES_INSTANCE_UID => b"UI",
        tags::PATIENT_NAME => b"PN",
        tags::PATIENT_ID | tags::SERIES_DESCRIPTION => b"LO",
        tags::SERIES_NUMBER | tags::NUMBER_OF_FRAMES => b"IS",
        tags::MODALITY | tags::PHOTOMETRIC_INTERPRETATION => b"CS",
        tags::SLICE_THICKNESS
        | tags::IMAGE_POSITION_PATIENT
        | tags::IMAGE_ORIENTATION_PATIENT
        | tags::PIXEL_SPACING
        | tags::RESCALE_INTERCEPT
        | tags::RESCALE_SLOPE => b"DS",
        PIXEL_DATA => b"OW",
        _ => b"US",
    }
}

/// Text of even length: UIDs end in a zero byte, everything else in a space (PS3.5, 6.2).
fn text(kind: [u8; 2], value: &str) -> Vec<u8> {
    let mut bytes = value.as_bytes().to_vec();
    if bytes.len() % 2 == 1 {
        bytes.push(if kind == *b"UI" { 0 } else { b' ' });
    }
    bytes
}

/// Bytes from the least, in the order of a file.
fn ordered<const N: usize>(mut bytes: [u8; N], big: bool) -> [u8; N] {
    if big {
        bytes.reverse();
    }
    bytes
}

/// An element of a data set (PS3.5, 7.1.2 and 7.1.3).
fn element(tag: Tag, kind: [u8; 2], value: Vec<u8>, explicit: bool, big: bool) -> Vec<u8> {
    let short = |n: u16| ordered(n.to_le_bytes(), big);
    let long = |n: u32| ordered(n.to_le_bytes(), big);
    let mut bytes = [short(tag.0), short(tag.1)].concat();
    if explicit {
        bytes.extend(kind);
    }
    match (explicit, kind == *b"OW") {
        (true, false) => bytes.extend(short(value.len() as u16)),
        (true, true) => bytes.extend([&[0, 0][..], &long(value.len() as u32)].concat()),
        (false, _) => bytes.extend(long(value.len() as u32)),
    }
    bytes.extend(value);
    bytes
}
