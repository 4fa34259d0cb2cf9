//! `lattice`: `keys` (`u64` a vertex), `places` (3 `f32` a vertex), `triangles` (3 `u32` each).

use ivd_core::{Buffer, Lattice, LatticeSource};
use serde::{Deserialize, Serialize};

use super::real::{GridContent, Real};
use super::{Decoder, Element, Encoded, SectionBytes};
use crate::error::Problem;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    source: Source,
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
    lattice.check().map_err(|e| e.to_string())?;
    let content = Content {
        grid: (&lattice.grid).into(),
        source: (&lattice.source).into(),
        level: lattice.level,
        max_error_mm: Real(lattice.max_error_mm),
    };
    let (vertices, triangles) = (lattice.keys.len() as u64, lattice.triangles.len() as u64);
    let sections = vec![
        SectionBytes::new("keys", Element::U64, vec![vertices], &lattice.keys),
        SectionBytes::new("places", Element::F32, vec![vertices, 3], &lattice.places),
        SectionBytes::new("triangles", Element::U32, vec![triangles, 3], &lattice.triangles),
    ];
    Encoded::new(&content, sections)
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Lattice, Problem> {
    let content: Content = decoder.content()?;
    let keys: Buffer<ivd_core::ElementKey> = decoder.take_rows("keys", Element::U64, &[])?;
    let places: Buffer<[f32; 3]> = decoder.take("places", Element::F32, &[keys.len() as u64, 3])?;
    let triangles: Buffer<[u32; 3]> = decoder.take_rows("triangles", Element::U32, &[3])?;
    let lattice = Lattice {
        grid: content.grid.grid()?,
        source: content.source.into(),
        keys: keys.into_vec(),
        places: places.into_vec(),
        triangles: triangles.into_vec(),
        level: content.level,
        max_error_mm: content.max_error_mm.0,
    };
    lattice.check()?;
    Ok(lattice)
}
