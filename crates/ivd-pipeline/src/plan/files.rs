//! The files that a scene's places read: its input, a start that was drawn, labels, and what its volume meets.

use std::path::Path;

use ivd_core::op::{Method, Place};
use ivd_io::volume::{RawLayout, ReadOptions};

use crate::scene::{InputSection, Loaded};
use crate::stages::{Import, ImportDrawn, ImportLabelsOf, ImportOperand, ImportSource};
use crate::{Error, Section};

/// The import of the volume.
///
/// # Errors
/// A usage error where the scene has no input.
pub(super) fn import(loaded: &Loaded, input: Option<&Path>) -> Result<Import, Error> {
    let section: &InputSection = &loaded.scene.input;
    let file = input.map(Path::to_owned).or_else(|| section.file.as_ref().map(|f| loaded.folder.join(f)));
    let source = match (file, section.phantom) {
        (Some(path), _) => {
            let grid_of = section.grid_of.as_ref().map(|file| loaded.folder.join(file));
            ImportSource::File { path, options: read_options(section), grid_of }
        }
        (None, Some(shape)) => {
            let base = ivd_phantom::Params::default();
            ImportSource::Phantom(ivd_phantom::Params {
                shape,
                size: section.size.unwrap_or(base.size),
                noise: section.noise,
                voxel_type: section.voxel_type.unwrap_or(base.voxel_type),
                seed: section.seed.unwrap_or(base.seed),
                contrast: section.contrast.unwrap_or(base.contrast),
            })
        }
        (None, None) => {
            return Err(Error::usage("import", "the scene has no input; give input.file or --input"));
        }
    };
    Ok(Import { source })
}

/// The start that a scene has drawn.
pub(super) fn drawn(loaded: &Loaded) -> Option<ImportDrawn> {
    loaded.scene.input.start.as_ref().map(|file| ImportDrawn { path: loaded.folder.join(file) })
}

/// The labels that a scene has from a file.
///
/// # Errors
/// An artefact of another kind.
pub(super) fn labelled(loaded: &Loaded) -> Result<Option<ImportLabelsOf>, Error> {
    let file = loaded.scene.input.labels.as_ref();
    file.map(|file| ImportLabelsOf::new(loaded.folder.join(file))).transpose()
}

fn read_options(section: &InputSection) -> ReadOptions {
    ReadOptions {
        raw: section.raw.as_ref().map(|r| RawLayout {
            dims: r.dims,
            voxel_type: r.voxel_type,
            spacing: r.spacing,
            order: r.order,
            skip: r.skip,
        }),
        frame: section.frame,
        series: section.series.clone(),
        resample_slices: section.resample_slices,
        spacing: section.spacing,
        axes: section.axes,
    }
}

/// What the parameter of a place's slot says to fill it with.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Named {
    /// A value of the scene.
    Value(&'static str),
    /// A file.
    File(String),
}

/// What the parameter of a slot says to fill it with; `None` where no parameter says, or it says nothing.
pub(super) fn named(section: &Section, place: &Place, slot: &str) -> Option<Named> {
    let (_, values) = place.named.iter().find(|(known, _)| *known == slot)?;
    let said = section.job().params().remove(slot)?;
    let said = said.as_str()?;
    let value = values.iter().find(|value| **value == said);
    Some(value.map_or_else(|| Named::File(said.to_owned()), |value| Named::Value(value)))
}

/// The imports of the files that a place's slots are filled with, each with its slot.
///
/// # Errors
/// A file that can't be read, or that doesn't fit the slot.
pub(super) fn met(
    loaded: &Loaded,
    section: &Section,
    place: &'static Place,
) -> Result<Vec<(&'static str, ImportOperand)>, Error> {
    let kinds = |method: &Method, slot: &str| {
        method.slots.iter().find(|known| known.name == slot).map_or(&[][..], |known| known.kinds)
    };
    let file = |slot: &'static str| match named(section, place, slot) {
        Some(Named::File(file)) => Some((slot, file)),
        Some(Named::Value(_)) | None => None,
    };
    let files = place.named.iter().filter_map(|(slot, _)| file(slot));
    let import = |(slot, file): (&'static str, String)| {
        Ok((slot, ImportOperand::new(loaded.folder.join(file), kinds(section.method(), slot))?))
    };
    files.map(import).collect()
}
