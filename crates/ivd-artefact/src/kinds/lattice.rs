//! `lattice`: `keys` (`u64` a vertex), `places` (3 `f32` a vertex), `triangles` (3 `u32` each).

use ivd_core::{Buffer, CoarseLevel, Lattice, LatticeSource};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::{GridContent, Real};
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    source: Source,
    level: u8,
    max_error_mm: Real,
    /// Coarser levels, the finest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    coarser: Vec<Level>,
}

/// A coarser level; its triangles are a section.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Level {
    level: u8,
    max_error_mm: Real,
}

/// [`LatticeSource`] as it is written, so that a change there doesn't change files.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
enum Source {
    Iso(Real),
    Interval { lower: Option<Real>, upper: Option<Real> },
    Mask,
    Foreign,
}

impl From<&LatticeSource> for Source {
    fn from(source: &LatticeSource) -> Self {
        match *source {
            LatticeSource::Iso(iso) => Self::Iso(Real(iso)),
            LatticeSource::Interval { lower, upper } => {
                Self::Interval { lower: lower.map(Real), upper: upper.map(Real) }
            }
            LatticeSource::Mask => Self::Mask,
            LatticeSource::Foreign => Self::Foreign,
        }
    }
}

impl From<Source> for LatticeSource {
    fn from(source: Source) -> Self {
        match source {
            Source::Iso(iso) => Self::Iso(iso.0),
            Source::Interval { lower, upper } => {
                Self::Interval { lower: lower.map(|v| v.0), upper: upper.map(|v| v.0) }
            }
            Source::Mask => Self::Mask,
            Source::Foreign => Self::Foreign,
        }
    }
}

pub(super) fn encode(lattice: &Lattice) -> Result<Encoded<'_>, String> {
    let content = Content {
        grid: (lattice.grid()).into(),
        source: (lattice.source()).into(),
        level: lattice.level(),
        max_error_mm: Real(lattice.max_error_mm()),
        coarser: lattice
            .coarser()
            .iter()
            .map(|c| Level { level: c.level, max_error_mm: Real(c.max_error_mm) })
            .collect(),
    };
    let (vertices, triangles) = (lattice.keys().len() as u64, lattice.triangles().len() as u64);
    let mut sections = vec![
        SectionBytes::new("keys", Element::U64, vec![vertices], lattice.keys()),
        SectionBytes::new("places", Element::F32, vec![vertices, 3], lattice.places()),
        SectionBytes::new("triangles", Element::U32, vec![triangles, 3], lattice.triangles()),
    ];
    sections.extend(lattice.coarser().iter().enumerate().map(|(k, coarser)| {
        let shape = vec![coarser.triangles.len() as u64, 3];
        SectionBytes::new(coarser_name(k), Element::U32, shape, &coarser.triangles)
    }));
    Encoded::new(&content, sections)
}

/// Name of the section of the `k`-th coarser level's triangles.
fn coarser_name(k: usize) -> String {
    format!("coarser{k}")
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Lattice, Problem> {
    let content: Content = decoder.content()?;
    let keys: Buffer<ivd_core::ElementKey> = decoder.take_rows("keys", Element::U64, &[])?;
    let places: Buffer<[f32; 3]> = decoder.take("places", Element::F32, &[keys.len() as u64, 3])?;
    let triangles: Buffer<[u32; 3]> = decoder.take_rows("triangles", Element::U32, &[3])?;
    let mut coarser = Vec::with_capacity(content.coarser.len());
    for (k, Level { level, max_error_mm }) in content.coarser.into_iter().enumerate() {
        let triangles: Buffer<[u32; 3]> = decoder.take_rows(&coarser_name(k), Element::U32, &[3])?;
        coarser.push(CoarseLevel { triangles, level, max_error_mm: max_error_mm.0 });
    }
    Ok(Lattice::new(content.grid.grid()?, keys, places, triangles)?
        .with_source(content.source.into())
        .with_level(content.level)
        .with_max_error_mm(content.max_error_mm.0)
        .with_coarser(coarser)?)
}
