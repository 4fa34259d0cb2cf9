use std::io::Write;
use std::path::Path;

use ivd_core::{Exec, Grid, Volume, VoxelType};

use crate::volume::orientation::flip;
use crate::volume::replace::{put, replace};
use crate::volume::values::Values;
use crate::volume::{Error, VoxelAxes, Written};

/// Writes `.mha`, or `.mhd` with the voxels in a file beside it; uncompressed.
pub(crate) fn write(path: &Path, volume: &Volume, exec: &Exec) -> Result<Written, Error> {
    let values = Values::without_scale(volume);
    let header = header(volume.grid(), values.voxel_type(volume));
    let header = |data: Option<&str>| format!("{header}ElementDataFile = {}\n", data.unwrap_or("LOCAL"));
    values.write_with_header(path, "mhd", header, volume, exec)
}

/// Writes a field of vectors (mm) in LPS as a displacement field: three channels. The comment says which way it leads.
pub(crate) fn field(
    path: &Path,
    grid: &Grid,
    direction: &str,
    vectors: &mut dyn FnMut(&mut dyn Write) -> Result<(), Error>,
) -> Result<Written, Error> {
    replace(path, |to| {
        let header = header(grid, VoxelType::F32);
        let channels = format!("Comment = {direction} mm LPS\nElementNumberOfChannels = 3\n");
        put(to, path, format!("{header}{channels}ElementDataFile = LOCAL\n").as_bytes())?;
        vectors(to)
    })
}

fn header(grid: &Grid, voxel_type: VoxelType) -> String {
    let rows = grid.direction().map(flip);
    let [x, y, z] = grid.dims();
    // A reader takes a file without it for one that says nothing of the patient.
    let orientation = if grid.in_patient() {
        format!("AnatomicalOrientation = {}\n", String::from_iter(VoxelAxes::nearest(grid).opposite()))
    } else {
        String::new()
    };
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n\
         TransformMatrix = {}\nOffset = {}\nCenterOfRotation = 0 0 0\n{orientation}ElementSpacing = {}\nDimSize = {x} {y} {z}\n\
         ElementType = {}\n",
        numbers(rows.as_flattened()),
        numbers(&flip(grid.origin())),
        numbers(&grid.spacing()),
        type_name(voxel_type),
    )
}

/// Numbers in the shortest form that reads back to the same bits.
fn numbers(values: &[f64]) -> String {
    values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(" ")
}

fn type_name(voxel_type: VoxelType) -> &'static str {
    match voxel_type {
        VoxelType::U8 => "MET_UCHAR",
        VoxelType::I8 => "MET_CHAR",
        VoxelType::U16 => "MET_USHORT",
        VoxelType::I16 => "MET_SHORT",
        VoxelType::U32 => "MET_UINT",
        VoxelType::I32 => "MET_INT",
        VoxelType::F32 => "MET_FLOAT",
        VoxelType::F64 => "MET_DOUBLE",
    }
}
