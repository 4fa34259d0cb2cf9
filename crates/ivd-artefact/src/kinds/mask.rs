//! `mask`: `inside`, 0 or 1 a voxel, and `level`, an `f32` a voxel, where there is a level function.

use ivd_core::Mask;
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::{GridContent, voxel_shape};
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    level: bool,
}

pub(super) fn encode(mask: &Mask) -> Result<Encoded<'_>, String> {
    let content = Content { grid: mask.grid().into(), level: mask.level().is_some() };
    let shape = voxel_shape(mask.grid().dims());
    let mut sections = vec![SectionBytes::new("inside", Element::U8, shape.clone(), mask.inside())];
    sections
        .extend(mask.level().map(|level| SectionBytes::new("level", Element::F32, shape, level.as_slice())));
    Encoded::new(&content, sections)
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Mask, Problem> {
    let content: Content = decoder.content()?;
    let grid = content.grid.grid()?;
    let shape = voxel_shape(grid.dims());
    let mask = Mask::new(grid, decoder.take("inside", Element::U8, &shape)?)?;
    if content.level {
        return Ok(mask.with_level(decoder.take("level", Element::F32, &shape)?)?);
    }
    Ok(mask)
}
