//! Volumes in: import, phantom.

use std::path::Path;

use ivd_artefact::{Artefact, Cache, Kind};
use ivd_core::op::{Fill as _, Voxelwise};
use ivd_core::{Classified, VoxelType};
use ivd_io::volume::{ByteOrder, FieldDirection, RawLayout, ReadOptions};
use ivd_pipeline::stages::{
    Import, ImportField, ImportLabels, ImportMask, ImportSource, ImportTransfer, PutOnto,
};
use ivd_pipeline::{Input, Inputs, Stage, ending, export as write_as};

use crate::args::{Direction, Raw};
use crate::context::Context;
use crate::exit::Failure;
use crate::files::{file_for, finish, write_artefact};

/// What a file's values are taken for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Taken {
    /// What they are.
    Volume,
    /// Labels.
    Labels,
    /// Inside where they aren't 0.
    Mask,
    /// Vectors of a displacement field, and which way it leads where that is said.
    Displacement(Option<Direction>),
}

/// Other files whose grids count.
#[derive(Default, Clone, Copy)]
pub(super) struct Others<'a> {
    /// A volume onto whose grid it is put, by where its voxels lie.
    pub(super) like: Option<&'a Path>,
    /// A file whose grid is taken in place of its own.
    pub(super) grid_of: Option<&'a Path>,
}

/// `ivd import`.
pub(super) fn import(
    source: &Path,
    taken: Taken,
    Others { like, grid_of }: Others<'_>,
    raw: &Raw,
    output: &Path,
    context: &Context,
) -> anyhow::Result<()> {
    let cache = context.stage_cache()?;
    let of_artefact = ivd_artefact::is_artefact(source);
    if !of_artefact && ending(source) == "json" {
        let stage = ImportTransfer { path: source.to_owned() };
        let done = context.run(&cache, &stage, &Inputs::default())?;
        return finish(&stage, done, output, context);
    }
    if let Taken::Displacement(direction) = taken
        && !of_artefact
    {
        let stage = ImportField { path: source.to_owned(), direction: direction.map(FieldDirection::from) };
        let onto = like.map(|file| file_for(file, &[Kind::Volume], &cache, context)).transpose()?;
        let inputs = onto.into_iter().fold(Inputs::default(), |inputs, volume| inputs.with("volume", volume));
        let done = context.run(&cache, &stage, &inputs)?;
        return finish(&stage, done, output, context);
    }
    let options = options(raw)?;
    if of_artefact && grid_of.is_none() {
        return again(source, taken, like, options == ReadOptions::default(), output, &cache, context);
    }
    if like.is_some() && taken == Taken::Volume {
        return Err(what_is_put(source));
    }
    if of_artefact {
        must_hold_a_volume(source)?;
    }
    let grid_of = grid_of.map(Path::to_owned);
    let stage = Import { source: ImportSource::File { path: source.to_owned(), options, grid_of } };
    let done = context.run(&cache, &stage, &Inputs::default())?;
    let Some(drawn) = drawn(taken) else { return finish(&stage, done, output, context) };
    // What is made of the volume is told by its own record.
    if let Some(told) = done.record.told_remark() {
        context.say(&format!("ivd: note: {told}"));
    }
    take(drawn, done.input(), like, output, &cache, context)
}

/// Labels and masks that are artefacts got their grid when they were made.
fn must_hold_a_volume(artefact: &Path) -> anyhow::Result<()> {
    let kind = ivd_artefact::peek(artefact)?.kind;
    if kind == Kind::Volume {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{}: --grid-of is of a volume's artefact or of another program's file, and this artefact holds {}; import the file that it was made of \
         again, with --grid-of",
        artefact.display(),
        held(kind)
    )))
}

/// The error about a volume that is to be put onto another's grid.
fn what_is_put(source: &Path) -> anyhow::Error {
    Failure::usage(format!(
        "--like puts labels, a mask or a displacement onto a volume's grid; say what {} holds: --labels, --mask or --displacement",
        source.display()
    ))
}

/// What takes a volume for labels or for a mask.
fn drawn(taken: Taken) -> Option<&'static dyn Stage> {
    match taken {
        Taken::Labels => Some(&ImportLabels),
        Taken::Mask => Some(&ImportMask),
        Taken::Volume | Taken::Displacement(_) => None,
    }
}

/// Takes a volume for labels or for a mask, and puts that onto another's grid where one is given.
fn take(
    stage: &dyn Stage,
    volume: Input,
    like: Option<&Path>,
    output: &Path,
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<()> {
    let done = context.run(cache, stage, &Inputs::default().with("volume", volume))?;
    match like {
        None => finish(stage, done, output, context),
        Some(like) => put(done.input(), like, output, cache, context),
    }
}

/// Puts labels or a mask onto the grid of a file.
fn put(drawn: Input, like: &Path, output: &Path, cache: &Cache, context: &Context) -> anyhow::Result<()> {
    let like = file_for(like, Voxelwise::KINDS, cache, context)?;
    let done = context.run(cache, &PutOnto, &Inputs::default().with("drawn", drawn).with("like", like))?;
    finish(&PutOnto, done, output, context)
}

/// An import of what is an artefact already: a volume's numbers can be taken for labels or a mask, and these be put onto another grid.
fn again(
    file: &Path,
    taken: Taken,
    like: Option<&Path>,
    is_plain: bool,
    output: &Path,
    cache: &Cache,
    context: &Context,
) -> anyhow::Result<()> {
    let name = file.display();
    if !is_plain {
        let problem = format!(
            "{name}: an artefact says itself how it is laid out; leave out what says it of other files (--raw-…, --axes, --frame, --series)"
        );
        return Err(Failure::usage(problem));
    }
    let input = context.stage_input(file)?;
    let kind = input.artefact.kind();
    if let Some(stage) = drawn(taken).filter(|_| kind == Kind::Volume) {
        return take(stage, input, like, output, cache, context);
    }
    match (kind, taken, like) {
        (Kind::Volume, Taken::Volume, Some(_)) => Err(what_is_put(file)),
        (Kind::Labels, Taken::Volume | Taken::Labels, Some(like))
        | (Kind::Mask, Taken::Volume | Taken::Mask, Some(like)) => put(input, like, output, cache, context),
        _ => Err(Failure::usage(format!(
            "{name}: it is an artefact already, which holds {}; every command takes it as it is, and `ivd export {name} -o FILE` writes it \
             for other programs",
            held(kind)
        ))),
    }
}

/// A kind in a sentence.
fn held(kind: Kind) -> String {
    match kind {
        Kind::Labels => "labels".to_owned(),
        Kind::Octree | Kind::Image => format!("an {}", kind.name()),
        Kind::Transfer => "a transfer function".to_owned(),
        Kind::Volume | Kind::Mask | Kind::Lattice | Kind::Motion | Kind::Displacement | Kind::Tree => {
            format!("a {}", kind.name())
        }
    }
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
