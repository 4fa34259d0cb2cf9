//! `transfer`: `table`, RGBA of shape `[classes, resolution, 4]`; classes and entries as JSON. From version 2 on there may be `gradient`, RGBA by value
//! and gradient, of shape `[gradients, values, 4]`; from version 3 on entries may have a role. What has neither is written as version 1, what has
//! materials alone as version 2.

use ivd_core::{Buffer, ClassRole, GradientTable, TransferEntry, TransferFunction};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::Real;
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 3;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    range: [f64; 2],
    resolution: usize,
    reference_mm: f64,
    classes: Vec<u16>,
    entries: Vec<EntryContent>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gradient: Option<GradientContent>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GradientContent {
    top: f64,
    dims: [usize; 2],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EntryContent {
    class: u16,
    #[serde(default, skip_serializing_if = "ClassRole::is_material")]
    role: ClassRole,
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
            role: entry.role,
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
            role: entry.role,
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

fn gradient_shape([values, gradients]: [usize; 2]) -> Vec<u64> {
    vec![gradients as u64, values as u64, 4]
}

/// The version before gradients, and before roles.
const WITHOUT_GRADIENT: u16 = 1;
/// The version before roles.
const WITHOUT_ROLES: u16 = 2;

pub(super) fn encode(transfer: &TransferFunction) -> Result<Encoded<'_>, String> {
    let content = Content {
        range: transfer.range(),
        resolution: transfer.resolution(),
        reference_mm: transfer.reference_mm(),
        classes: transfer.classes().to_vec(),
        entries: transfer.entries().iter().map(EntryContent::from).collect(),
        gradient: transfer.gradient().map(|table| GradientContent { top: table.top(), dims: table.dims() }),
    };
    let shape = shape(content.classes.len(), content.resolution);
    let mut sections = vec![SectionBytes::new("table", Element::F32, shape, transfer.table())];
    if let Some(table) = transfer.gradient() {
        sections.push(SectionBytes::new(
            "gradient",
            Element::F32,
            gradient_shape(table.dims()),
            table.table(),
        ));
    }
    let has_roles = transfer.entries().iter().any(|entry| !entry.role.is_material());
    let version = match (has_roles, transfer.gradient()) {
        (true, _) => None,
        (false, Some(_)) => Some(WITHOUT_ROLES),
        (false, None) => Some(WITHOUT_GRADIENT),
    };
    Ok(Encoded { version, ..Encoded::new(&content, sections)? })
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<TransferFunction, Problem> {
    let content: Content = decoder.content()?;
    let shape = shape(content.classes.len(), content.resolution);
    let table: Buffer<[f32; 4]> = decoder.take("table", Element::F32, &shape)?;
    let entries = content.entries.into_iter().map(TransferEntry::from).collect();
    let (range, resolution) = (content.range, content.resolution);
    let transfer = TransferFunction::new(
        range,
        resolution,
        content.reference_mm,
        content.classes,
        table.into_vec(),
        entries,
    )?;
    let Some(GradientContent { top, dims }) = content.gradient else { return Ok(transfer) };
    let table: Buffer<[f32; 4]> = decoder.take("gradient", Element::F32, &gradient_shape(dims))?;
    Ok(transfer.with_gradient(GradientTable::new(top, dims, table.into_vec())?))
}
