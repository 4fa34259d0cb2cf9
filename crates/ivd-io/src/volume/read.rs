use std::path::{Path, PathBuf};

use ivd_core::{Exec, Volume};
use serde::{Deserialize, Serialize};

use crate::volume::{
    Error, RawLayout, VoxelAxes, bounded, dicom, foreign, metaimage, nifti, nrrd, raw, stack, vti,
};

/// What the file alone doesn't tell.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReadOptions {
    /// Layout of a file, or of the slices of a folder, without a header. Where it is given it is believed.
    pub raw: Option<RawLayout>,
    /// Which frame of a file with several, from 0.
    pub frame: Option<usize>,
    /// Which DICOM series of a folder with several.
    pub series: Option<String>,
    /// Puts the slices of a DICOM series that aren't evenly spaced onto even spacing, by linear interpolation.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub resample_slices: bool,
    /// Spacing in mm, in place of the file's, for formats without a trustworthy one: TIFF, PNG and raw slices.
    pub spacing: Option<[f64; 3]>,
    /// Where the axes of the voxels lead, in place of what the file says or for want of its word.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<VoxelAxes>,
}

/// Formats of one file, told by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Nifti,
    Nrrd,
    MetaImage,
    Vti,
    Tiff,
    Dicom,
}

/// Reads a volume: NIfTI-1 and -2, NRRD, MetaImage, VTI, TIFF, DICOM, raw with a layout, or a folder of DICOM files
/// (its own, else those of the folders below it), PNG or TIFF pictures or raw slices.
///
/// The format is told by the first bytes, not by the name. Voxels keep their stored type (64-bit integers become
/// 32-bit ones where all fit), slope and intercept stand beside them, and positions are millimetres in RAS: they equal
/// those of ITK. A file without a space is taken as ITK takes it, the identity in LPS. The grid knows whether the file says where the patient
/// lies: DICOM with an orientation, NIfTI with a qform or an sform, NRRD with a space of anatomy, MetaImage with an orientation,
/// VTI with the field `SPACE`; or [`ReadOptions::axes`] say it.
///
/// No size is believed before it is compared with the file and with `exec`'s memory limit; memory is taken once, for
/// the voxels.
///
/// # Errors
/// [`Error`] names the file, and the field or the place; see its variants.
pub fn read(path: &Path, options: &ReadOptions, exec: &Exec) -> Result<Volume, Error> {
    let volume = as_it_lies(path, options, exec)?;
    Ok(match options.axes {
        Some(axes) => axes.lay(&volume, exec)?,
        None => volume,
    })
}

/// The volume where its file says.
fn as_it_lies(path: &Path, options: &ReadOptions, exec: &Exec) -> Result<Volume, Error> {
    // Formats that know where the patient lies say whether a file tells it.
    let nowhere = |volume: Volume| volume.with_patient_space(false);
    exec.run(|| {
        if is_folder(path)? {
            return read_folder(path, options, exec);
        }
        if let Some(layout) = &options.raw {
            let spacing = options.spacing.unwrap_or(layout.spacing);
            return raw::read(path, &RawLayout { spacing, ..*layout }, exec).map(nowhere);
        }
        match format(path)? {
            Format::Nifti => nifti::read(path, options.frame, exec),
            Format::Nrrd => nrrd::read(path, options.frame, exec),
            Format::MetaImage => metaimage::read(path, options.frame, exec),
            Format::Vti => vti::read(path, exec),
            Format::Tiff => stack::read_tiff(path, options.spacing, exec).map(nowhere),
            Format::Dicom => dicom::read_file(path, exec),
        }
    })
}

fn read_folder(path: &Path, options: &ReadOptions, exec: &Exec) -> Result<Volume, Error> {
    if options.raw.is_none() && is_of_dicom(path)? {
        return dicom::read_folder(path, options, exec).map_err(|error| error.without_folders_below(path));
    }
    let volume = stack::read_folder(path, options.raw.as_ref(), options.spacing, exec)?;
    Ok(volume.with_patient_space(false))
}

/// Every file that [`read`] would take voxels or a header from, in the order in which it stacks them: who knows that
/// none of them changed, nor their order, knows that the volume is the same.
///
/// All of them are regular files: who reads them to the end comes to it.
///
/// # Errors
/// As [`read`], as far as it takes to know the names.
pub fn sources(path: &Path, options: &ReadOptions) -> Result<Vec<PathBuf>, Error> {
    let files = named(path, options)?;
    files.iter().try_for_each(|file| bounded::regular(file).map(drop))?;
    Ok(files)
}

/// The files that a volume's header names.
fn named(path: &Path, options: &ReadOptions) -> Result<Vec<PathBuf>, Error> {
    if is_folder(path)? {
        if options.raw.is_none() && is_of_dicom(path)? {
            let files = dicom::sources(path, options.series.as_deref());
            return files.map_err(|error| error.without_folders_below(path));
        }
        return stack::sources(path, options.raw.as_ref());
    }
    if options.raw.is_some() {
        return Ok(vec![path.to_owned()]);
    }
    match format(path)? {
        Format::Nifti => nifti::sources(path),
        Format::Nrrd => nrrd::sources(path),
        Format::MetaImage => metaimage::sources(path),
        Format::Vti | Format::Tiff | Format::Dicom => Ok(vec![path.to_owned()]),
    }
}

pub(super) fn is_folder(path: &Path) -> Result<bool, Error> {
    Ok(std::fs::metadata(path).map_err(|e| Error::io(path, "open", e))?.is_dir())
}

/// Whether a folder is read as DICOM: some file of it is, or, where it holds no pictures either, some file below it.
pub(super) fn is_of_dicom(dir: &Path) -> Result<bool, Error> {
    Ok(dicom::holds_dicom(dir)? || (stack::sources(dir, None).is_err() && dicom::holds_dicom_below(dir)?))
}

fn is_dicom(bytes: &[u8]) -> bool {
    bytes.get(128..132) == Some(b"DICM")
}

pub(super) fn format(path: &Path) -> Result<Format, Error> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
    if ends(&[".img", ".img.gz"]) {
        return Ok(Format::Nifti);
    }
    let bytes = nifti::unpacked_head(path)?;
    let text = || String::from_utf8_lossy(&bytes[..bytes.len().min(1024)]).into_owned();
    if nifti::is_nifti(&bytes) {
        Ok(Format::Nifti)
    } else if bytes.starts_with(b"NRRD") {
        Ok(Format::Nrrd)
    } else if is_dicom(&bytes) {
        Ok(Format::Dicom)
    } else if matches!(bytes.get(..4), Some([b'I', b'I', 42 | 43, 0] | [b'M', b'M', 0, 42 | 43])) {
        Ok(Format::Tiff)
    } else if text().contains("<VTKFile") {
        Ok(Format::Vti)
    } else if metaimage::is_metaimage(&bytes) {
        Ok(Format::MetaImage)
    } else {
        foreign::refusal(path, &name, &bytes).map_or_else(|| by_ending(path, &name), Err)
    }
}

/// A file whose start isn't any format's: its ending says whose error to give.
fn by_ending(path: &Path, name: &str) -> Result<Format, Error> {
    let ends = |endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
    if ends(&[".nii", ".nii.gz", ".hdr", ".hdr.gz"]) {
        Ok(Format::Nifti)
    } else if ends(&[".nrrd", ".nhdr"]) {
        Ok(Format::Nrrd)
    } else if ends(&[".mha", ".mhd"]) {
        Ok(Format::MetaImage)
    } else if ends(&[".vti"]) {
        Ok(Format::Vti)
    } else if ends(&[".tif", ".tiff"]) {
        Ok(Format::Tiff)
    } else if ends(&[".dcm"]) {
        Ok(Format::Dicom)
    } else {
        Err(Error::Unknown {
            path: path.to_owned(),
            problem: "neither its first bytes nor its ending tell a volume format".into(),
            remedy: "give a NIfTI, NRRD, MetaImage, VTI, TIFF or DICOM file, a folder of slices, or the dims and type \
                     of a raw file (--raw-dims, --raw-type)"
                .into(),
        })
    }
}
