//! `displacement`: `forward_table`, `forward_vectors`, `inverse_table`, `inverse_vectors`, `vacated` where something
//! was left behind, and `sides` where something is cut.

use std::borrow::Cow;

use ivd_core::{Buffer, Displacement, FieldBricks};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::{GridContent, Real, voxel_shape};
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    time: Real,
    inverse_residual_max: Real,
    min_det_j: Real,
    vacated: bool,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    sides: bool,
}

/// Shape of one brick of vectors.
const BRICK_SHAPE: [u64; 4] = [8, 8, 8, 3];

pub(super) fn encode(displacement: &Displacement) -> Result<Encoded<'_>, String> {
    let content = Content {
        grid: (displacement.grid()).into(),
        time: Real(displacement.time()),
        inverse_residual_max: Real(displacement.inverse_residual_max()),
        min_det_j: Real(displacement.min_det_j()),
        vacated: !displacement.vacated().is_empty(),
        sides: displacement.has_cut(),
    };
    let mut sections = Vec::new();
    sections.extend(field("forward_table", "forward_vectors", displacement.forward()));
    sections.extend(field("inverse_table", "inverse_vectors", displacement.inverse()));
    for (name, flags) in [("vacated", displacement.vacated()), ("sides", displacement.sides())] {
        if !flags.is_empty() {
            let shape = voxel_shape(displacement.grid().dims());
            sections.push(SectionBytes::new(name, Element::U8, shape, flags));
        }
    }
    Encoded::new(&content, sections)
}

/// The sections of a field.
pub(super) fn field(
    table: impl Into<Cow<'static, str>>,
    vectors: impl Into<Cow<'static, str>>,
    field: &FieldBricks,
) -> [SectionBytes<'_>; 2] {
    let mut shape = vec![field.stored() as u64];
    shape.extend(BRICK_SHAPE);
    [
        SectionBytes::new(table, Element::U32, voxel_shape(field.brick_dims()), field.table()),
        SectionBytes::new(vectors, Element::F32, shape, field.vectors()),
    ]
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Displacement, Problem> {
    let content: Content = decoder.content()?;
    let grid = content.grid.grid()?;
    let forward = take_field(decoder, "forward_table", "forward_vectors", grid.dims())?;
    let inverse = take_field(decoder, "inverse_table", "inverse_vectors", grid.dims())?;
    let mut flags = |name, there: bool| {
        if there { decoder.take(name, Element::U8, &voxel_shape(grid.dims())) } else { Ok(Vec::new().into()) }
    };
    let (vacated, sides) = (flags("vacated", content.vacated)?, flags("sides", content.sides)?);
    Ok(Displacement::new(grid, forward, inverse)?
        .with_time(content.time.0)
        .with_inverse_residual_max(content.inverse_residual_max.0)
        .with_min_det_j(content.min_det_j.0)
        .with_vacated(vacated)?
        .with_sides(sides)?)
}

pub(super) fn take_field(
    decoder: &mut Decoder<'_>,
    table: &str,
    vectors: &str,
    dims: [usize; 3],
) -> Result<FieldBricks, Problem> {
    let bricks = dims.map(|n| n.div_ceil(FieldBricks::SIDE));
    let table: Buffer<u32> = decoder.take(table, Element::U32, &voxel_shape(bricks))?;
    let vectors: Buffer<[f32; 3]> = decoder.take_rows(vectors, Element::F32, &BRICK_SHAPE)?;
    Ok(FieldBricks::new(dims, table.into_vec(), vectors)?)
}
