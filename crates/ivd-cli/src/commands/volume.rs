//! Volumes in: import, phantom.

use std::path::Path;

use ivd_artefact::{Artefact, Kind};
use ivd_core::{Classified, VoxelType};
use ivd_io::volume::{ByteOrder, FieldDirection, RawLayout, ReadOptions};
use ivd_pipeline::stages::{Import, ImportField, ImportLabels, ImportMask, ImportSource, ImportTransfer};
use ivd_pipeline::{Inputs, Stage, ending, export as write_as};

use crate::args::{Direction, Raw};
use crate::context::Context;
use crate::exit::Failure;
use crate::files::{file_for, finish, write_artefact};

/// What a volume's values are taken for.
#[derive(Clone, Copy)]
pub(super) enum Taken<'a> {
    /// What they are.
    Volume,
    /// Labels.
    Labels,
    /// Inside where they aren't 0.
    Mask,
    /// Vectors of a displacement field.
    Displacement {
        /// Which way it leads, where that is said.
        direction: Option<Direction>,
        /// A volume onto whose grid it is put.
        like: Option<&'a Path>,
    },
}

/// `ivd import`.
pub(super) fn import(
    source: &Path,
    taken: Taken<'_>,
    raw: &Raw,
    output: &Path,
    context: &Context,
) -> anyhow::Result<()> {
    if ending(source) == "json" {
        let stage = ImportTransfer { path: source.to_owned() };
        let done = context.run(&context.stage_cache()?, &stage, &Inputs::default())?;
        return finish(&stage, done, output, context);
    }
    if let Taken::Displacement { direction, like } = taken {
        let direction = direction.map(FieldDirection::from);
        let stage = ImportField { path: source.to_owned(), direction };
        let cache = context.stage_cache()?;
        let onto = like.map(|file| file_for(file, &[Kind::Volume], &cache, context)).transpose()?;
        let inputs = onto.into_iter().fold(Inputs::default(), |inputs, volume| inputs.with("volume", volume));
        let done = context.run(&cache, &stage, &inputs)?;
        return finish(&stage, done, output, context);
    }
    let stage = Import { source: ImportSource::File { path: source.to_owned(), options: options(raw)? } };
    let cache = context.stage_cache()?;
    let done = context.run(&cache, &stage, &Inputs::default())?;
    let taken: &dyn Stage = match taken {
        Taken::Volume | Taken::Displacement { .. } => return finish(&stage, done, output, context),
        Taken::Labels => &ImportLabels,
        Taken::Mask => &ImportMask,
    };
    let inputs = Inputs::default().with("volume", done.input());
    let done = context.run(&cache, taken, &inputs)?;
    finish(taken, done, output, context)
}

impl From<Direction> for FieldDirection {
    fn from(direction: Direction) -> Self {
        match direction {
            Direction::Forward => Self::Forward,
            Direction::Inverse => Self::Inverse,
        }
    }
}

/// What the flags say about a file.
fn options(raw: &Raw) -> anyhow::Result<ReadOptions> {
    let layout = match (raw.raw_dims, &raw.raw_type) {
        (Some(dims), Some(name)) => Some(RawLayout {
            dims,
            voxel_type: voxel_type(name)?,
            spacing: raw.raw_spacing.unwrap_or([1.0; 3]),
            order: match raw.raw_order.as_deref() {
                None | Some("little") => ByteOrder::Little,
                Some("big") => ByteOrder::Big,
                Some(other) => return Err(Failure::usage(format!("--raw-order {other}: little or big"))),
            },
            skip: raw.raw_skip,
        }),
        _ => None,
    };
    let spacing = if layout.is_none() { raw.raw_spacing } else { None };
    let Raw { frame, resample_slices, axes, .. } = *raw;
    Ok(ReadOptions { raw: layout, frame, series: raw.series.clone(), resample_slices, spacing, axes })
}

fn voxel_type(name: &str) -> anyhow::Result<VoxelType> {
    VoxelType::from_name(name)
        .ok_or_else(|| Failure::usage(format!("type {name}: one of u8, i8, u16, i16, u32, i32, f32, f64")))
}

/// The parameters of `ivd phantom`.
pub(super) fn phantom_params(
    name: &str,
    size: usize,
    noise: Option<f64>,
    type_name: &str,
    seed: u64,
    contrast: &str,
) -> anyhow::Result<ivd_phantom::Params> {
    let shape = name.parse().map_err(|e| Failure::usage(format!("{e}")))?;
    let contrast = contrast.parse().map_err(|e| Failure::usage(format!("{e}")))?;
    Ok(ivd_phantom::Params { shape, size, noise, voxel_type: voxel_type(type_name)?, seed, contrast })
}

/// `ivd phantom`.
pub(super) fn phantom(
    params: ivd_phantom::Params,
    truth: Option<&Path>,
    output: &Path,
    context: &Context,
) -> anyhow::Result<()> {
    if let Some(truth) = truth {
        let labels = ivd_phantom::generate(&params, &context.exec)
            .map_err(|e| Failure::of(e.error_class(), e.to_string()))?
            .truth;
        let artefact = Artefact::Labels(labels);
        if ending(truth) == "ivd" {
            let provenance = ivd_artefact::Provenance::new("phantom", serde_json::to_value(&params)?);
            write_artefact(truth, &artefact, &provenance, context)?;
        } else {
            write_as(&artefact, truth, &context.exec)?;
        }
    }
    let stage = Import { source: ImportSource::Phantom(params) };
    let done = context.run(&context.stage_cache()?, &stage, &Inputs::default())?;
    finish(&stage, done, output, context)
}
