//! `volume`: `voxels` as stored, and the brick min–max index as `brick_min`, `brick_max`, `brick_missing`. From version 2 on it may say what it was made
//! with; one that doesn't is written as version 1.

use ivd_core::{BrickIndex, Buffer, Modality, Scalar, Volume, VoxelType, Voxels, with_voxels};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::{GridContent, voxel_shape};
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 2;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    voxel_type: VoxelType,
    slope: f64,
    intercept: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    modality: Option<Modality>,
}

/// The version before modalities.
const WITHOUT_MODALITY: u16 = 1;

pub(super) fn encode(volume: &Volume) -> Result<Encoded<'_>, String> {
    let voxel_type = volume.voxel_type();
    let content = Content {
        grid: volume.grid().into(),
        voxel_type,
        slope: volume.slope(),
        intercept: volume.intercept(),
        modality: volume.modality(),
    };
    let shape = voxel_shape(volume.grid().dims());
    let voxels =
        with_voxels!(volume.voxels(), slice => SectionBytes::new("voxels", voxel_type.into(), shape, slice));
    let bricks = volume.bricks();
    let shape = voxel_shape(bricks.dims());
    let (min, max, missing) = bricks.parts();
    let sections = vec![
        voxels,
        SectionBytes::new("brick_min", Element::F32, shape.clone(), min.as_slice()),
        SectionBytes::new("brick_max", Element::F32, shape.clone(), max.as_slice()),
        SectionBytes::new("brick_missing", Element::U8, shape, missing.as_slice()),
    ];
    let version = content.modality.is_none().then_some(WITHOUT_MODALITY);
    Ok(Encoded { version, ..Encoded::new(&content, sections)? })
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Volume, Problem> {
    let content: Content = decoder.content()?;
    let grid = content.grid.grid()?;
    let shape = voxel_shape(grid.dims());
    let voxels = match content.voxel_type {
        VoxelType::U8 => typed::<u8>(decoder, &shape),
        VoxelType::I8 => typed::<i8>(decoder, &shape),
        VoxelType::U16 => typed::<u16>(decoder, &shape),
        VoxelType::I16 => typed::<i16>(decoder, &shape),
        VoxelType::U32 => typed::<u32>(decoder, &shape),
        VoxelType::I32 => typed::<i32>(decoder, &shape),
        VoxelType::F32 => typed::<f32>(decoder, &shape),
        VoxelType::F64 => typed::<f64>(decoder, &shape),
    }?;
    let dims = BrickIndex::dims_for(grid.dims());
    let shape = voxel_shape(dims);
    let min: Buffer<f32> = decoder.take("brick_min", Element::F32, &shape)?;
    let max: Buffer<f32> = decoder.take("brick_max", Element::F32, &shape)?;
    let missing: Buffer<u8> = decoder.take("brick_missing", Element::U8, &shape)?;
    // A range is ordered, or (inf, -inf) where the brick holds no data; NaN would switch off every comparison.
    let sound = |(&lo, &hi): (&f32, &f32)| lo <= hi || (lo == f32::INFINITY && hi == f32::NEG_INFINITY);
    if !min.iter().zip(max.iter()).all(sound) || missing.iter().any(|&m| m > 1) {
        return Err("a brick's range is not ordered, or its flag neither 0 nor 1".to_owned().into());
    }
    let volume =
        Volume::with_scale(grid, voxels, content.slope, content.intercept)?.with_modality(content.modality);
    let bricks = BrickIndex::from_parts(dims, min, max, missing);
    volume.attach_bricks(bricks.ok_or_else(|| "brick sections differ in length".to_owned())?)?;
    Ok(volume)
}

fn typed<T: Scalar>(decoder: &mut Decoder<'_>, shape: &[u64]) -> Result<Voxels, Problem> {
    Ok(T::wrap(decoder.take::<T>("voxels", T::TYPE.into(), shape)?))
}
