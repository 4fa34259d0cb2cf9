//! `transfer`: `table`, RGBA of shape `[classes, resolution, 4]`; classes and entries as JSON.

use ivd_core::{Buffer, TransferEntry, TransferFunction};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::Real;
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    range: [f64; 2],
    resolution: usize,
    reference_mm: f64,
    classes: Vec<u16>,
    entries: Vec<EntryContent>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EntryContent {
    class: u16,
    rgb: [Real; 3],
    opacity: Real,
    lower: Real,
    upper: Real,
    softness: Real,
}

impl From<&TransferEntry> for EntryContent {
    fn from(entry: &TransferEntry) -> Self {
        Self {
            class: entry.class,
            rgb: entry.rgb.map(|c| Real(f64::from(c))),
            opacity: Real(f64::from(entry.opacity)),
            lower: Real(entry.lower),
            upper: Real(entry.upper),
            softness: Real(entry.softness),
        }
    }
}

impl From<EntryContent> for TransferEntry {
    fn from(entry: EntryContent) -> Self {
        Self {
            class: entry.class,
            // Widened from f32 when written, so that narrowing is exact.
            rgb: entry.rgb.map(|c| c.0 as f32),
            opacity: entry.opacity.0 as f32,
            lower: entry.lower.0,
            upper: entry.upper.0,
            softness: entry.softness.0,
        }
    }
}

fn shape(classes: usize, resolution: usize) -> Vec<u64> {
    vec![classes as u64, resolution as u64, 4]
}

pub(super) fn encode(transfer: &TransferFunction) -> Result<Encoded<'_>, String> {
    let content = Content {
        range: transfer.range(),
        resolution: transfer.resolution(),
        reference_mm: transfer.reference_mm(),
        classes: transfer.classes().to_vec(),
        entries: transfer.entries().iter().map(EntryContent::from).collect(),
    };
    let shape = shape(content.classes.len(), content.resolution);
    let table = SectionBytes::new("table", Element::F32, shape, transfer.table());
    Encoded::new(&content, vec![table])
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<TransferFunction, Problem> {
    let content: Content = decoder.content()?;
    let shape = shape(content.classes.len(), content.resolution);
    let table: Buffer<[f32; 4]> = decoder.take("table", Element::F32, &shape)?;
    let entries = content.entries.into_iter().map(TransferEntry::from).collect();
    let (range, resolution) = (content.range, content.resolution);
    Ok(TransferFunction::new(
        range,
        resolution,
        content.reference_mm,
        content.classes,
        table.into_vec(),
        entries,
    )?)
}
