//! Volumes as slices: a TIFF with several pages, a folder of PNG or TIFF pictures, a folder of raw slices.
//!
//! Slices are taken in the order of their names, numbers in a name by their value (`slice2` before `slice10`); the
//! first one is z = 0. Only single-valued pictures are read: a colour has no place in a scalar volume. Such files
//! have no space, so their axes lie along LPS with the first voxel at 0, as ITK takes them.

mod directory;
mod names;
mod pile;
mod png;
mod raw;
mod slices;
mod tiff;
mod write;

use std::path::{Path, PathBuf};

use ivd_core::{Exec, Volume};

use crate::volume::{Error, RawLayout, bounded, orientation};
use names::regular_files;
use pile::Pile;
use slices::{Slices, note_foreign};
use tiff::PixelSize;
pub use write::write_tiff;

/// Reads a TIFF stack: every page is a slice, the first page is z = 0.
///
/// Without `spacing` (mm), the resolution tags give x and y where they or ImageJ's description have a unit (else 1), and
/// z is ImageJ's, or else 1.
///
/// # Errors
/// [`Error`] names the page and tag that is malformed, differs from the first page, or isn't single-valued.
pub fn read_tiff(path: &Path, spacing: Option<[f64; 3]>, exec: &Exec) -> Result<Volume, Error> {
    exec.run(|| {
        let mut pile = Pile::default();
        let own = tiff::read_pages(path, &mut pile, None, exec)?;
        finish(path, pile, spacing, own, exec)
    })
}

/// Reads the slices of a folder: PNG or TIFF pictures, or raw slices where `raw` tells their layout.
///
/// Files of another kind are passed over with a note. `spacing` (mm) overrides that of `raw` and of the pictures.
///
/// # Errors
/// [`Error`] names the slice that is malformed or that differs from the first, or says what is missing.
pub fn read_folder(
    dir: &Path,
    raw: Option<&RawLayout>,
    spacing: Option<[f64; 3]>,
    exec: &Exec,
) -> Result<Volume, Error> {
    exec.run(|| match raw {
        Some(layout) => raw::read_slices(dir, layout, spacing, exec),
        None => read_pictures(dir, spacing, exec),
    })
}

/// The files that make up the volume that [`read_folder`] reads, in the order of its slices.
///
/// # Errors
/// Where the folder can't be read or holds no slices, or pictures of two kinds.
pub fn sources(dir: &Path, raw: Option<&RawLayout>) -> Result<Vec<PathBuf>, Error> {
    match raw {
        Some(layout) => Ok(raw::slices(dir, layout)?.files),
        None => Ok(pictures(dir)?.files),
    }
}

/// A kind of picture, told by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Png,
    Tiff,
}

fn kind_of(path: &Path) -> Result<Option<Kind>, Error> {
    let head = bounded::head(path, 8)?;
    Ok(match head.as_slice() {
        [0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a] => Some(Kind::Png),
        // Classic and big TIFF, either byte order.
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Kind::Tiff),
        _ => None,
    })
}

fn pictures(dir: &Path) -> Result<Slices<Kind>, Error> {
    let (mut png, mut tiff, mut foreign) = (Vec::new(), Vec::new(), Vec::new());
    for file in regular_files(dir)? {
        match kind_of(&file)? {
            Some(Kind::Png) => png.push(file),
            Some(Kind::Tiff) => tiff.push(file),
            None => foreign.push(file),
        }
    }
    match (png.is_empty(), tiff.is_empty()) {
        (false, true) => Ok(Slices { kind: Kind::Png, files: png, foreign }),
        (true, false) => Ok(Slices { kind: Kind::Tiff, files: tiff, foreign }),
        (true, true) => {
            let problem = format!("no DICOM, PNG or TIFF file among {} files", foreign.len());
            Err(if with_pictures_below(dir)? {
                Error::choice(dir, format!("{problem}, but a folder below it holds some"), "give that folder")
            } else {
                Error::choice(
                    dir,
                    problem,
                    "for raw slices give dims and type (--raw-dims, --raw-type), and of other volumes the file itself",
                )
            })
        }
        (false, false) => Err(Error::choice(
            dir,
            format!("{} PNG and {} TIFF files", png.len(), tiff.len()),
            "keep slices of one kind in a folder",
        )),
    }
}

/// Whether a folder right below one holds a picture; those that can't be read are passed over. Its name may be a patient's.
fn with_pictures_below(dir: &Path) -> Result<bool, Error> {
    let holds_some = |folder: &PathBuf| {
        let files = regular_files(folder).unwrap_or_default();
        files.iter().any(|file| kind_of(file).is_ok_and(|kind| kind.is_some()))
    };
    Ok(names::folders(dir)?.iter().any(holds_some))
}

fn read_pictures(dir: &Path, spacing: Option<[f64; 3]>, exec: &Exec) -> Result<Volume, Error> {
    let found = pictures(dir)?;
    note_foreign(dir, &found.foreign, exec);
    let mut pile = Pile::default();
    let mut own = None;
    // A single TIFF is a stack of pages; among several each is one slice.
    let pages = (found.files.len() > 1).then_some(1);
    exec.observer().begin("read", found.files.len() as u64);
    for (z, slice) in found.files.iter().enumerate() {
        exec.check_cancelled()?;
        let of_slice = match found.kind {
            Kind::Png => png::read(slice, &mut pile, exec).map(|()| None)?,
            Kind::Tiff => tiff::read_pages(slice, &mut pile, pages, exec)?,
        };
        if z == 0 {
            own = of_slice;
        }
        exec.observer().advance("read", 1);
    }
    exec.observer().end("read");
    finish(dir, pile, spacing, own, exec)
}

/// `own`: the spacing that the pictures tell.
fn finish(
    path: &Path,
    pile: Pile,
    spacing: Option<[f64; 3]>,
    own: Option<PixelSize>,
    exec: &Exec,
) -> Result<Volume, Error> {
    let (dims, voxels) = pile.finish(path)?;
    let spacing = spacing.unwrap_or_else(|| {
        let PixelSize { xy: [x, y], z } = own.unwrap_or(PixelSize { xy: [1.0; 2], z: None });
        if let Some(z) = z {
            return [x, y, z];
        }
        exec.observer().note(&format!(
            "{}: the slices don't tell their distance: spacing {x} × {y} × 1 mm is taken; give the spacing if it is another",
            path.display()
        ));
        [x, y, 1.0]
    });
    Ok(Volume::new(orientation::plain_grid(path, dims, spacing)?, voxels)?)
}

#[cfg(test)]
mod tests;
