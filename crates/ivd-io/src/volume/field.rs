use std::io::Write;
use std::path::Path;

use ivd_core::{Displacement, Exec, Grid, VoxelIndex};

use crate::volume::replace::put;
use crate::volume::{Error, Written, metaimage, nifti, nrrd};

/// Which way a displacement field leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FieldDirection {
    /// Rest to deformed: where each voxel goes.
    Forward,
    /// Deformed to rest: where each voxel of the deformed volume comes from. This is what a resampler wants
    /// (ITK's displacement field transform pulls).
    #[default]
    Inverse,
}

impl FieldDirection {
    /// Its name in files and on command lines.
    pub fn name(self) -> &'static str {
        match self {
            Self::Forward => "forward",
            Self::Inverse => "inverse",
        }
    }
}

/// Writes one of a displacement's fields, dense, three `f32` a voxel, millimetres in LPS, as ITK, SimpleITK and ANTs read
/// displacement fields, and 3D Slicer a grid transform.
///
/// - `.nrrd`: the vector is the fastest axis, grid and vectors share the space `left-posterior-superior`; the key `displacement`
///   says which way the field leads.
/// - `.mha`: three channels; the comment says which way the field leads.
/// - `.nii`, `.nii.gz`: five dimensions, intent `VECTOR`; the intent's name says which way the field leads.
///
/// # Errors
/// [`Error::Unknown`] for another ending, a [`Error::Core`] where the fields don't lie on the grid, [`Error::Io`].
pub fn write_field(
    path: &Path,
    displacement: &Displacement,
    direction: FieldDirection,
    exec: &Exec,
) -> Result<Written, Error> {
    let field = match direction {
        FieldDirection::Forward => displacement.forward(),
        FieldDirection::Inverse => displacement.inverse(),
    };
    let grid = displacement.grid();
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
    let mut vectors = |to: &mut dyn Write| {
        rows(to, path, grid, exec, |at, row| {
            row.extend(lps(field.at(at)).into_iter().flat_map(f32::to_le_bytes));
        })
    };
    if ends(&[".nrrd"]) {
        return nrrd::field(path, grid, direction.name(), &mut vectors);
    }
    if ends(&[".mha"]) {
        return metaimage::field(path, grid, direction.name(), &mut vectors);
    }
    if ends(&[".nii", ".nii.gz"]) {
        let kind = format!("{} mm LPS", direction.name());
        let components = |to: &mut dyn Write| {
            (0..3).try_for_each(|component| {
                rows(to, path, grid, exec, |at, row| {
                    row.extend_from_slice(&lps(field.at(at))[component].to_le_bytes());
                })
            })
        };
        return nifti::field(path, grid, &kind, components, exec);
    }
    Err(Error::Unknown {
        path: path.to_owned(),
        problem: "the ending tells no format of displacement fields".into(),
        remedy: "end the name in .nrrd, .mha, .nii or .nii.gz".into(),
    })
}

/// RAS to LPS, without negative zeros.
fn lps([r, a, s]: [f32; 3]) -> [f32; 3] {
    [0.0 - r, 0.0 - a, s]
}

/// Writes what `put_voxel` makes of every voxel row by row, so that the dense field never stands in memory.
fn rows(
    to: &mut dyn Write,
    path: &Path,
    grid: &Grid,
    exec: &Exec,
    put_voxel: impl Fn(VoxelIndex, &mut Vec<u8>),
) -> Result<(), Error> {
    let [nx, ny, nz] = grid.dims();
    let mut row = Vec::with_capacity(12 * nx);
    for z in 0..nz {
        exec.check_cancelled()?;
        for y in 0..ny {
            row.clear();
            (0..nx).for_each(|x| put_voxel(VoxelIndex([x, y, z]), &mut row));
            put(to, path, &row)?;
        }
    }
    Ok(())
}
