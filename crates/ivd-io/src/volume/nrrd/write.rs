use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use ivd_core::{Exec, Grid, Volume, VoxelType};

use crate::volume::orientation::flip;
use crate::volume::replace::{put, replace};
use crate::volume::values::Values;
use crate::volume::{Error, Written};

/// Writes `.nrrd`, or `.nhdr` with the voxels in a file beside it.
///
/// The encoding is raw: reading and writing then cost what the disk costs, and the voxels can be mapped. Who wants a
/// small file has `.nii.gz`.
pub(crate) fn write(path: &Path, volume: &Volume, exec: &Exec) -> Result<Written, Error> {
    let values = Values::without_scale(volume);
    let header = header(volume.grid(), values.voxel_type(volume), "");
    let header = |data: Option<&str>| match data {
        None => format!("{header}\n"),
        Some(data) => format!("{header}data file: {data}\n"),
    };
    values.write_with_header(path, "nhdr", header, volume, exec)
}

/// Writes a field of vectors (mm) in LPS as a displacement field: the vector is the fastest axis. The key `displacement` says
/// which way it leads.
pub(crate) fn field(
    path: &Path,
    grid: &Grid,
    direction: &str,
    vectors: &mut dyn FnMut(&mut dyn Write) -> Result<(), Error>,
) -> Result<Written, Error> {
    replace(path, |to| {
        let header = header(grid, VoxelType::F32, "3 ");
        put(to, path, format!("{header}displacement:={direction} mm LPS\n\n").as_bytes())?;
        vectors(to)
    })
}

/// The header's lines. Where nobody said where the patient lies the space has no name; readers take its coordinates for LPS.
/// `vector` is the size of a fastest axis that isn't space, with a space after it, or empty.
fn header(grid: &Grid, voxel_type: VoxelType, vector: &str) -> String {
    let [x, y, z] = grid.dims();
    let axes: [[f64; 3]; 3] =
        std::array::from_fn(|a| flip(grid.direction()[a]).map(|d| d * grid.spacing()[a]));
    let [i, j, k] = axes.map(vector_text);
    // Vectors are along a space that has a name.
    let named = grid.in_patient() || !vector.is_empty();
    let space = if named { "space: left-posterior-superior" } else { "space dimension: 3" };
    let (none, kind, rank) = if vector.is_empty() { ("", "", 3) } else { ("none ", "vector ", 4) };
    let mut text = format!("NRRD0004\ntype: {}\ndimension: {rank}\n", type_name(voxel_type));
    let _ = write!(
        text,
        "{space}\nsizes: {vector}{x} {y} {z}\nspace directions: {none}{i} {j} {k}\n\
         kinds: {kind}domain domain domain\nendian: little\nencoding: raw\nspace origin: {}\n",
        vector_text(flip(grid.origin())),
    );
    text
}

/// Numbers in the shortest form that reads back to the same bits.
fn vector_text([x, y, z]: [f64; 3]) -> String {
    format!("({x:?},{y:?},{z:?})")
}

fn type_name(voxel_type: VoxelType) -> &'static str {
    match voxel_type {
        VoxelType::U8 => "uint8",
        VoxelType::I8 => "int8",
        VoxelType::U16 => "uint16",
        VoxelType::I16 => "int16",
        VoxelType::U32 => "uint32",
        VoxelType::I32 => "int32",
        VoxelType::F32 => "float",
        VoxelType::F64 => "double",
    }
}
