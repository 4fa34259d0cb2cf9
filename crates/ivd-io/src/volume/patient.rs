use std::path::Path;

use super::read::{Format, format, is_folder};
use super::{Error, ReadOptions, dicom, metaimage, nifti, nrrd};

/// Whether a file says where its voxels lie in the patient: DICOM with an orientation; NIfTI with a qform or sform; NRRD with a space of anatomy;
/// MetaImage with an orientation. Elsewhere left and right are only what [`read`](super::read()) takes for them, and its volume's grid says so.
///
/// # Errors
/// As [`read`](super::read()), as far as the header.
pub fn states_patient_space(path: &Path, options: &ReadOptions) -> Result<bool, Error> {
    if options.raw.is_some() {
        return Ok(false);
    }
    if is_folder(path)? {
        let is_dicom = super::read::is_of_dicom(path)?;
        return Ok(is_dicom && dicom::states_patient_space(path, options.series.as_deref())?);
    }
    Ok(match format(path)? {
        Format::Dicom => dicom::states_patient_space(path, None)?,
        Format::Nifti => nifti::states_patient_space(path)?,
        Format::Nrrd => nrrd::states_patient_space(path)?,
        Format::MetaImage => metaimage::states_patient_space(path)?,
        Format::Vti | Format::Tiff => false,
    })
}
