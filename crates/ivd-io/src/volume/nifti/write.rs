use std::io::Write;
use std::path::Path;

use flate2::{Compression, GzBuilder};
use ivd_core::{Exec, Grid, Reference, Volume, VoxelType};
use nalgebra::Vector3;

use super::ending::strip_ending;
use super::header::{NO_PATIENT, SIZE_1, SIZE_2, code};
use super::orient;
use crate::volume::replace::{put, replace};
use crate::volume::values::Values;
use crate::volume::{Error, Written};

/// Most that NIfTI-1's `f32` may move a voxel (mm) without a note.
const MOST_MOVED: f64 = 1e-3;

/// Writes NIfTI-1, or NIfTI-2 where NIfTI-1's `i16` sizes are too small. Where NIfTI-1's `f32` would change values by half a stored
/// step they are written decoded. Notes say what differs from what a reader may expect. The gzip stream carries no name and no time:
/// same volume, same bytes.
pub(crate) fn write(path: &Path, volume: &Volume, exec: &Exec) -> Result<Written, Error> {
    let (values, scale) = Values::with_scale(volume, fits_1(volume.grid()));
    let voxel_type = values.voxel_type(volume);
    if let Values::Real(to) = values
        && !to.is_integer()
    {
        exec.observer().note(&format!(
            "{}: NIfTI keeps slope {} and intercept {} in 32 bits, which would change values: real values are written, as {}",
            path.display(),
            volume.slope(),
            volume.intercept(),
            to.name()
        ));
    }
    let header = header(path, volume.grid(), voxel_type, scale, None, exec);
    with_header(path, &header, |to| values.write(to, path, volume, exec))
}

/// Writes a field of vectors (mm), LPS, as ITK and ANTs have displacement fields: five dimensions, the components one after the
/// other, intent `VECTOR`. `name`, of at most 15 bytes, says what the field is.
pub(crate) fn field(
    path: &Path,
    grid: &Grid,
    name: &str,
    components: impl FnOnce(&mut dyn Write) -> Result<(), Error>,
    exec: &Exec,
) -> Result<Written, Error> {
    with_header(path, &header(path, grid, VoxelType::F32, [1.0, 0.0], Some(name), exec), components)
}

fn with_header(
    path: &Path,
    header: &[u8],
    values: impl FnOnce(&mut dyn Write) -> Result<(), Error>,
) -> Result<Written, Error> {
    replace(path, |to| {
        if strip_ending(&path.to_string_lossy(), ".gz").is_none() {
            put(to, path, header)?;
            return values(to);
        }
        let mut gzip = GzBuilder::new().write(to, Compression::fast());
        put(&mut gzip, path, header)?;
        values(&mut gzip)?;
        let to = gzip.finish().map_err(|e| Error::io(path, "write", e))?;
        to.flush().map_err(|e| Error::io(path, "write", e))
    })
}

/// A volume's header, or that of a field of three components with this name.
fn header(
    path: &Path,
    grid: &Grid,
    voxel_type: VoxelType,
    scale: [f64; 2],
    field: Option<&str>,
    exec: &Exec,
) -> Vec<u8> {
    let note = |what: String| exec.observer().note(&format!("{}: {what}", path.display()));
    if !fits_1(grid) {
        note(format!(
            "{:?} voxels are more than NIfTI-1 counts along an axis: written as NIfTI-2, which fewer programs read",
            grid.dims()
        ));
        return header_2(grid, voxel_type, scale, field);
    }
    let moved = moved(grid);
    if moved > MOST_MOVED {
        note(format!("NIfTI-1's 32-bit places move voxels by up to {moved:.4} mm; .nrrd and .mha keep them"));
    }
    header_1(grid, voxel_type, scale, field)
}

/// Whether NIfTI-1 counts so many voxels.
fn fits_1(grid: &Grid) -> bool {
    grid.dims().iter().all(|&n| i16::try_from(n).is_ok())
}

/// How far rounding the affine to `f32` moves a corner voxel at most (mm).
fn moved(grid: &Grid) -> f64 {
    let rows = srow(grid);
    let error = rows.map(|row| row.map(|v| f64::from(v as f32) - v));
    let n = grid.dims();
    (0..8_usize)
        .map(|corner| {
            let at: [f64; 3] =
                std::array::from_fn(|a| if corner >> a & 1 == 1 { (n[a] - 1) as f64 } else { 0.0 });
            Vector3::from(error.map(|e| e[0] * at[0] + e[1] * at[1] + e[2] * at[2] + e[3])).norm()
        })
        .fold(0.0, f64::max)
}

/// Rows of the voxel-to-world affine (mm), RAS.
fn srow(grid: &Grid) -> [[f64; 4]; 3] {
    let (m, o) = (grid.linear_part(), grid.origin());
    std::array::from_fn(|r| [m[(r, 0)], m[(r, 1)], m[(r, 2)], o[r]])
}

/// Bytes to be filled at the places that the format gives them, little endian.
struct Bytes(Vec<u8>);

impl Bytes {
    fn set(&mut self, at: usize, bytes: &[u8]) {
        self.0[at..at + bytes.len()].copy_from_slice(bytes);
    }
    fn f32s(&mut self, at: usize, values: &[f64]) {
        for (i, &v) in values.iter().enumerate() {
            self.set(at + 4 * i, &(v as f32).to_le_bytes());
        }
    }
    fn f64s(&mut self, at: usize, values: &[f64]) {
        for (i, v) in values.iter().enumerate() {
            self.set(at + 8 * i, &v.to_le_bytes());
        }
    }
}

/// Header and the four zero bytes that say "no extension".
fn header_1(grid: &Grid, voxel_type: VoxelType, scale: [f64; 2], field: Option<&str>) -> Vec<u8> {
    let mut b = Bytes(vec![0; SIZE_1 + 4]);
    b.set(0, &348_i32.to_le_bytes());
    b.set(38, b"r");
    for (i, n) in rank_and_sizes(grid, field.is_some()).into_iter().enumerate() {
        b.set(40 + 2 * i, &(n as i16).to_le_bytes());
    }
    b.set(70, &code(voxel_type).to_le_bytes());
    b.set(72, &(8 * voxel_type.bytes() as i16).to_le_bytes());
    let form = orient::quaternion(grid);
    b.f32s(76, &pixdim(grid, form.map_or(1.0, |f| f.1)));
    b.f32s(108, &[(SIZE_1 + 4) as f64, scale[0], scale[1]]);
    b.set(123, &[MILLIMETRES]);
    let ([qform, sform], says) = space(grid, form.is_some());
    b.set(148, says);
    b.set(252, &qform.to_le_bytes());
    b.set(254, &sform.to_le_bytes());
    b.f32s(256, &form.unwrap_or_default().0);
    b.f32s(268, &grid.origin());
    for (r, row) in srow(grid).iter().enumerate() {
        b.f32s(280 + 16 * r, row);
    }
    if let Some(name) = field {
        b.set(68, &(VECTOR as i16).to_le_bytes());
        b.set(328, name.as_bytes());
    }
    b.set(344, b"n+1\0");
    b.0
}

/// As [`header_1`], in the second version of the format.
fn header_2(grid: &Grid, voxel_type: VoxelType, scale: [f64; 2], field: Option<&str>) -> Vec<u8> {
    let mut b = Bytes(vec![0; SIZE_2 + 4]);
    b.set(0, &540_i32.to_le_bytes());
    b.set(4, b"n+2\0\r\n\x1a\n");
    b.set(12, &code(voxel_type).to_le_bytes());
    b.set(14, &(8 * voxel_type.bytes() as i16).to_le_bytes());
    for (i, n) in rank_and_sizes(grid, field.is_some()).into_iter().enumerate() {
        b.set(16 + 8 * i, &(n as i64).to_le_bytes());
    }
    let form = orient::quaternion(grid);
    b.f64s(104, &pixdim(grid, form.map_or(1.0, |f| f.1)));
    b.set(168, &((SIZE_2 + 4) as i64).to_le_bytes());
    b.f64s(176, &scale);
    let ([qform, sform], says) = space(grid, form.is_some());
    b.set(240, says);
    b.set(344, &i32::from(qform).to_le_bytes());
    b.set(348, &i32::from(sform).to_le_bytes());
    b.f64s(352, &form.unwrap_or_default().0);
    b.f64s(376, &grid.origin());
    for (r, row) in srow(grid).iter().enumerate() {
        b.f64s(400 + 32 * r, row);
    }
    b.set(500, &i32::from(MILLIMETRES).to_le_bytes());
    if let Some(name) = field {
        b.set(504, &VECTOR.to_le_bytes());
        b.set(508, name.as_bytes());
    }
    b.0
}

/// The codes of qform, where there is one, and sform, and what the description says of them. The format has no code for an affine that isn't the
/// patient's, and without any the places are lost: then it is said to be that of another file.
fn space(grid: &Grid, has_qform: bool) -> ([i16; 2], &'static [u8]) {
    let (code, says): (_, &[u8]) = match grid.reference() {
        Reference::Unknown => (2, NO_PATIENT),
        Reference::Patient => (1, b""),
        Reference::Aligned => (2, b""),
        Reference::Talairach => (3, b""),
        Reference::Mni => (4, b""),
        Reference::Template => (5, b""),
    };
    ([if has_qform { code } else { 0 }, code], says)
}

/// `xyzt_units`: lengths in millimetres, no time.
const MILLIMETRES: u8 = 2;

/// `intent_code` of a vector at every voxel.
const VECTOR: i32 = 1007;

fn rank_and_sizes(grid: &Grid, field: bool) -> [usize; 8] {
    let [x, y, z] = grid.dims();
    if field { [5, x, y, z, 1, 3, 1, 1] } else { [3, x, y, z, 1, 1, 1, 1] }
}

fn pixdim(grid: &Grid, qfac: f64) -> [f64; 8] {
    let [x, y, z] = grid.spacing();
    [qfac, x, y, z, 1.0, 1.0, 1.0, 1.0]
}
