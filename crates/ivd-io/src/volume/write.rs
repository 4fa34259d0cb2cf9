use std::path::Path;

use ivd_core::{Exec, Volume};

use crate::volume::values::Values;
use crate::volume::{Error, Written, metaimage, nifti, nrrd, raw, stack, vti};

/// Writes a volume in the format of the file's ending: `.nii`, `.nii.gz`, `.nrrd`, `.nhdr` (with `NAME.nhdr.raw` beside it),
/// `.mha`, `.mhd` (with `NAME.mhd.raw`), `.vti`, `.tif` or `.tiff` (a page a slice), `.raw`.
///
/// The stored type is kept. NIfTI is version 1 (2 only beyond its 32,767 voxels along an axis, with a note) and keeps slope and
/// intercept where its 32 bits change no value by half a stored step; otherwise, and in the other formats, a volume that has them is
/// written as real values: whole numbers where a whole intercept only shifts them (a CT), `f32`, or `f64` where that would be too
/// coarse. TIFF keeps the spacing alone, and a note says what is left out. A file that would get the bytes it has is left alone, otherwise it is replaced at once, so
/// that a reader sees the old file, the new one, or none.
///
/// # Errors
/// [`Error::Unknown`] for an ending of no format, [`Error::Unsupported`] for a grid that the format can't hold,
/// [`Error::Io`] where the system refuses, or a cancelled [`Error::Core`].
///
/// ```
/// use ivd_core::{Exec, Grid, Volume, Voxels};
/// use ivd_io::volume::{ReadOptions, read, write};
///
/// let folder = tempfile::tempdir().unwrap();
/// let file = folder.path().join("ramp.nrrd");
/// let grid = Grid::with_spacing([2, 2, 2], [0.5, 0.5, 2.0]).unwrap();
/// let volume = Volume::new(grid, Voxels::from(vec![0_i16, 1, 2, 3, 4, 5, 6, 7])).unwrap();
///
/// assert!(write(&file, &volume, &Exec::default()).unwrap().touched);
/// assert!(!write(&file, &volume, &Exec::default()).unwrap().touched, "nothing changed");
/// assert_eq!(read(&file, &ReadOptions::default(), &Exec::default()).unwrap(), volume);
/// ```
pub fn write(path: &Path, volume: &Volume, exec: &Exec) -> Result<Written, Error> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
    exec.run(|| {
        if ends(&[".nii", ".nii.gz"]) {
            return nifti::write(path, volume, exec);
        }
        if let Values::Real(to) = Values::without_scale(volume)
            && !to.is_integer()
        {
            exec.observer().note(&format!(
                "{}: the format keeps no slope and intercept ({} and {}): real values are written, as {}; .nii keeps them",
                path.display(),
                volume.slope(),
                volume.intercept(),
                to.name()
            ));
        }
        if ends(&[".nrrd", ".nhdr"]) {
            nrrd::write(path, volume, exec)
        } else if ends(&[".mha", ".mhd"]) {
            metaimage::write(path, volume, exec)
        } else if ends(&[".vti"]) {
            vti::write(path, volume, exec)
        } else if ends(&[".tif", ".tiff"]) {
            stack::write_tiff(path, volume, exec)
        } else if ends(&[".raw"]) {
            raw::write(path, volume, exec)
        } else {
            Err(Error::Unknown {
                path: path.to_owned(),
                problem: "the ending tells no volume format".into(),
                remedy: "end the name in .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, .vti, .tif or .raw".into(),
            })
        }
    })
}
