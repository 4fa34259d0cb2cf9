use std::io::Write;
use std::path::Path;

use ivd_core::{Displacement, Exec, FieldBricks, Grid, VoxelIndex};

use crate::write::put;
use crate::{Error, Written, nrrd};

/// Which way a displacement field leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldDirection {
    /// Rest to deformed: where each voxel goes.
    Forward,
    /// Deformed to rest: where each voxel of the deformed volume comes from. This is what a resampler wants
    /// (ITK's displacement field transform pulls).
    Inverse,
}

/// Writes one of a displacement's fields as a dense `.nrrd` of three `f32` a voxel, millimetres in LPS, as ITK and SimpleITK
/// read a displacement field: the vector is the fastest axis, grid and vectors share the space
/// `left-posterior-superior`.
///
/// # Errors
/// [`Error::Unknown`] for another ending, a [`Error::Core`] where the fields don't lie on the grid, [`Error::Io`].
pub fn write_field(
    path: &Path,
    displacement: &Displacement,
    direction: FieldDirection,
    exec: &Exec,
) -> Result<Written, Error> {
    displacement.check()?;
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("nrrd")) {
        return Err(Error::Unknown {
            path: path.to_owned(),
            problem: "the ending tells no format of displacement fields".into(),
            remedy: "end the name in .nrrd".into(),
        });
    }
    let field = match direction {
        FieldDirection::Forward => &displacement.forward,
        FieldDirection::Inverse => &displacement.inverse,
    };
    nrrd::field(path, &displacement.grid, &mut |to| rows(to, path, &displacement.grid, field, exec))
}

/// Writes the vectors row by row, so that the dense field never stands in memory.
fn rows(to: &mut dyn Write, path: &Path, grid: &Grid, field: &FieldBricks, exec: &Exec) -> Result<(), Error> {
    let [nx, ny, nz] = grid.dims();
    let mut row = Vec::with_capacity(12 * nx);
    for z in 0..nz {
        exec.check_cancelled()?;
        for y in 0..ny {
            row.clear();
            for x in 0..nx {
                let [r, a, s] = field.at(VoxelIndex([x, y, z]));
                for component in [0.0 - r, 0.0 - a, s] {
                    row.extend_from_slice(&component.to_le_bytes());
                }
            }
            put(to, path, &row)?;
        }
    }
    Ok(())
}
