//! Displacement fields of other programs: three numbers a voxel, in mm.

use std::path::Path;

use ivd_core::{Exec, FieldBricks, Grid, Scalar, with_voxels};

use super::components::Components;
use super::read::{Format, format};
use super::{Error, FieldDirection, metaimage, nifti, nrrd};

/// A field that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenField {
    /// Where its voxels lie.
    pub grid: Grid,
    /// Its vectors (mm, RAS); bricks of zeros aren't stored.
    pub vectors: FieldBricks,
    /// Which way it leads, where the file says so: files of ours do.
    pub direction: Option<FieldDirection>,
}

/// Reads a displacement field: NRRD with a vector of three as its fastest axis, in LPS (ITK, 3D Slicer); NIfTI of five dimensions with
/// an intent of vectors, in LPS, or of displacements, in RAS (ITK, ANTs); MetaImage of three channels, in LPS (ITK, elastix).
///
/// # Errors
/// As [`read`](super::read()); where the file isn't one, what it is instead.
pub fn read_field(path: &Path, exec: &Exec) -> Result<GivenField, Error> {
    exec.run(|| {
        let found = match format(path)? {
            Format::Nrrd => nrrd::read_field(path, exec)?,
            Format::Nifti => nifti::read_field(path, exec)?,
            Format::MetaImage => metaimage::read_field(path, exec)?,
            Format::Vti | Format::Tiff | Format::Dicom => {
                let remedy = "write it as .nrrd, .nii.gz or .mha, as ITK does";
                return Err(Error::unsupported(path, "a displacement field in this format", remedy));
            }
        };
        if found.voxels.voxel_type().is_integer() {
            let what = "three whole numbers a voxel, which is a picture in colour and";
            return Err(Error::unsupported(
                path,
                what,
                "a displacement field has real numbers (mm); write it as floats",
            ));
        }
        let direction = [FieldDirection::Forward, FieldDirection::Inverse]
            .into_iter()
            .find(|direction| found.says.starts_with(direction.name()));
        let vectors = with_voxels!(&found.voxels, numbers => bricks(path, numbers, &found)?);
        Ok(GivenField { grid: found.grid, vectors, direction })
    })
}

/// The bricks in which something moves.
fn bricks<T: Scalar>(path: &Path, numbers: &[T], found: &Components) -> Result<FieldBricks, Error> {
    let [nx, ny, nz] = found.grid.dims();
    let count = nx * ny * nz;
    let vector = |voxel: usize| -> [f32; 3] {
        let at = |c: usize| numbers[if found.together { 3 * voxel + c } else { c * count + voxel }].to_f64();
        // Adding 0: no negative zeros.
        found.space.turn([at(0), at(1), at(2)]).map(|v| v as f32 + 0.0)
    };
    let size = [nx, ny, nz].map(|n| n.div_ceil(8));
    let (mut moving, mut all) = (Vec::new(), Vec::new());
    for brick in 0..size.iter().product::<usize>() {
        let corner = [brick % size[0], brick / size[0] % size[1], brick / size[0] / size[1]].map(|b| 8 * b);
        let mut vectors = [[0.0_f32; 3]; FieldBricks::VOXELS];
        for (i, out) in vectors.iter_mut().enumerate() {
            let [x, y, z] = [corner[0] + i % 8, corner[1] + i / 8 % 8, corner[2] + i / 64];
            if x < nx && y < ny && z < nz {
                *out = vector(x + nx * (y + ny * z));
                if !out.iter().all(|v| v.is_finite()) {
                    let problem = format!("voxel [{x}, {y}, {z}] has a vector that isn't finite");
                    return Err(Error::field(path, "values", problem));
                }
            }
        }
        if vectors.iter().any(|v| *v != [0.0; 3]) {
            moving.push(brick);
            all.extend_from_slice(&vectors);
        }
    }
    Ok(FieldBricks::of_bricks([nx, ny, nz], &moving, all.into())?)
}
