//! DICOM: one series of a folder, or one file.
//!
//! [`read_folder`] goes in four steps, a module each: `element` walks over a file's elements and takes the few that
//! matter; `header` makes them a slice's description; `series` groups slices and chooses; `geometry` sorts them by
//! their positions and makes the grid; `pixels` decodes each slice into its place. A folder without an image of its own is read with
//! all that lies below it (`folder`). Spacing along the stack comes
//! from the positions, never from the thickness. Slope and intercept are kept beside the stored values.
//!
//! Patient identifiers are never decoded but for one purpose: to mask their words in a series' description.
//!
//! The walk over elements is this crate's own: general parsers allocate the length that an element declares before
//! they look whether the file holds it, and quote values in their errors, patients' names among them.

mod codec;
mod element;
mod folder;
mod geometry;
mod header;
mod kind;
mod pixels;
mod series;
mod syntax;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use ivd_core::{Exec, Modality, Volume};
use rayon::prelude::*;

use crate::volume::{Error, ReadOptions, bounded};
pub(crate) use folder::{holds_dicom, holds_dicom_below};
use geometry::Stacked;
use header::Slice;
pub use series::Series;

/// Reads one series of a folder, or of the folders below where it holds no image itself.
///
/// `options.series` chooses among several: a SeriesInstanceUID, the unique start of one, or a SeriesNumber.
/// `options.resample_slices` puts slices that aren't evenly spaced onto even spacing, with a note.
///
/// Files that aren't DICOM, or hold no image, are passed over with a note.
///
/// # Errors
/// [`Error::Choice`] lists the series where there are several and none, or none that exists, is chosen, or says that the slices aren't
/// evenly spaced. Others name the file and attribute that is malformed, missing or not supported, or the positions that two slices
/// share.
pub fn read_folder(dir: &Path, options: &ReadOptions, exec: &Exec) -> Result<Volume, Error> {
    exec.run(|| {
        let found = scan(dir, exec)?;
        for (what, files) in [("no DICOM", &found.foreign), ("no image", &found.imageless)] {
            if let [first, rest @ ..] = files.as_slice() {
                let name = first.file_name().unwrap_or_default().to_string_lossy();
                let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
                exec.observer().note(&format!("{}: passed over {name}{more}: {what}", dir.display()));
            }
        }
        let slices = series::choose(dir, found.slices, options.series.as_deref())?;
        volume(dir, slices, options.resample_slices, exec)
    })
}

/// Reads one file.
///
/// # Errors
/// As [`read_folder`].
pub fn read_file(path: &Path, exec: &Exec) -> Result<Volume, Error> {
    exec.run(|| {
        let slice = header::read(path)?.ok_or_else(|| {
            let kind = kind::of_file(path);
            let what = kind.map_or("a DICOM file without an image", |kind| kind.what);
            let remedy = kind.map_or("give the file or folder of an image series", |kind| kind.remedy);
            Error::unsupported(path, what, remedy)
        })?;
        volume(path, vec![slice], false, exec)
    })
}

/// The series of a folder, or of the folders below where it holds no image itself, in the order of their UIDs.
///
/// # Errors
/// As [`read_folder`], for what is known before a series is chosen.
pub fn list(dir: &Path, exec: &Exec) -> Result<Vec<Series>, Error> {
    exec.run(|| Ok(series::list(scan(dir, exec)?.slices)))
}

/// The files that make up the volume that [`read_folder`] reads, in the order of their names.
///
/// # Errors
/// As [`read_folder`], for what is known without decoding pixels.
pub fn sources(dir: &Path, series: Option<&str>) -> Result<Vec<PathBuf>, Error> {
    let slices = series::choose(dir, scan(dir, &Exec::default())?.slices, series)?;
    let mut files: Vec<PathBuf> = slices.into_iter().map(|s| s.path).collect();
    files.sort();
    Ok(files)
}

/// Whether a file has DICOM's mark behind its preamble.
pub fn looks_like_dicom(path: &Path) -> bool {
    bounded::head(path, 132).is_ok_and(|head| head.get(128..) == Some(b"DICM"))
}

/// What a folder holds.
#[derive(Default)]
struct Found {
    slices: Vec<Slice>,
    foreign: Vec<PathBuf>,
    imageless: Vec<PathBuf>,
}

/// The slices of a folder; where it holds none, those of all folders below.
///
/// Folders are often named after their patient: how many were read is said, not which.
fn scan(dir: &Path, exec: &Exec) -> Result<Found, Error> {
    let own = described(folder::files(dir)?, exec)?;
    if !own.slices.is_empty() {
        return Ok(own);
    }
    let mut found = described(folder::below(dir)?, exec)?;
    found.foreign.splice(..0, own.foreign);
    found.imageless.splice(..0, own.imageless);
    if found.slices.is_empty() {
        return Err(no_image(dir, &found));
    }
    let folders: BTreeSet<_> = found.slices.iter().map(|slice| slice.path.parent()).collect();
    let (images, plural) = (found.slices.len(), if folders.len() == 1 { "" } else { "s" });
    exec.observer().note(&format!(
        "{}: no image in the folder itself; the {images} in {} folder{plural} below it are taken",
        dir.display(),
        folders.len()
    ));
    Ok(found)
}

/// The error for a folder without an image, which tells what its DICOM files are.
fn no_image(dir: &Path, found: &Found) -> Error {
    match found.imageless.iter().find_map(|file| kind::of_file(file)) {
        None => Error::choice(dir, "no DICOM image", "give the folder of an image series"),
        Some(kind) => Error::choice(dir, format!("no DICOM image; it holds {}", kind.what), kind.remedy),
    }
}

/// What the headers of files say that they hold.
fn described(files: Vec<PathBuf>, exec: &Exec) -> Result<Found, Error> {
    exec.observer().begin("read headers", files.len() as u64);
    let headers: Vec<Result<Option<Slice>, Error>> = files
        .par_iter()
        .map(|path| {
            exec.check_cancelled()?;
            exec.observer().advance("read headers", 1);
            if looks_like_dicom(path) { header::read(path) } else { Ok(None) }
        })
        .collect();
    exec.observer().end("read headers");
    let mut found = Found::default();
    for (path, header) in files.into_iter().zip(headers) {
        match header? {
            Some(slice) => found.slices.push(slice),
            None if looks_like_dicom(&path) => found.imageless.push(path),
            None => found.foreign.push(path),
        }
    }
    Ok(found)
}

/// One series' slices as a volume.
fn volume(path: &Path, mut slices: Vec<Slice>, resample: bool, exec: &Exec) -> Result<Volume, Error> {
    for slice in &slices {
        slice.check_readable()?;
    }
    let Stacked { grid, layers } = geometry::grid(path, &mut slices, resample, exec)?;
    let first = &slices[0];
    let grid = grid.with_patient_space(first.orientation.is_some());
    if first.inverted {
        exec.observer().note(&format!(
            "{}: MONOCHROME1: small values are the bright ones; the stored values are kept as they are",
            path.display()
        ));
    }
    if slices.iter().any(|s| s.syntax.is_lossy()) {
        exec.observer().note(&format!("{}: the pixels were compressed with loss", path.display()));
    }
    let modality = match first.modality.as_str() {
        "CT" => Some(Modality::ComputedTomography),
        "MR" => Some(Modality::MagneticResonance),
        _ => None,
    };
    let (slope, intercept) = (first.slope, first.intercept);
    let same = slices.iter().all(|s| s.slope == slope && s.intercept == intercept);
    let mut voxels = if same { pixels::stored(&slices, exec)? } else { pixels::real(&slices, exec)? };
    if let Some(layers) = layers {
        voxels = pixels::between(&voxels, &layers, grid.len() / layers.len(), exec)?;
    }
    if same {
        return Ok(Volume::with_scale(grid, voxels, slope, intercept)?.with_modality(modality));
    }
    exec.observer().note(&format!(
        "{}: slope and intercept differ from slice to slice: real values are kept as f32",
        path.display()
    ));
    Ok(Volume::new(grid, voxels)?.with_modality(modality))
}

#[cfg(test)]
mod tests;
