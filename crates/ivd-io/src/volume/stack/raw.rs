use std::io::Read;
use std::path::Path;

use ivd_core::{Exec, Scalar, Volume, VoxelType, Voxels};

use super::names::regular_files;
use super::slices::{Slices, note_foreign};
use crate::order::swap_in_place;
use crate::volume::bounded::{self, Declared, Packing};
use crate::volume::{Error, RawLayout, orientation, suspect_order};

/// The files of a folder that have the size of one slice.
pub(super) fn slices(dir: &Path, layout: &RawLayout) -> Result<Slices<u64>, Error> {
    let [nx, ny, nz] = layout.dims;
    let count = bounded::voxel_count(dir, "dims", [nx, ny, 1])? as u64;
    let size = (count * layout.voxel_type.bytes() as u64)
        .checked_add(layout.skip)
        .ok_or_else(|| Error::field(dir, "skip", format!("{} bytes overflow", layout.skip)))?;
    let (mut slices, mut foreign) = (Vec::new(), Vec::new());
    for file in regular_files(dir)? {
        let length = std::fs::metadata(&file).map_err(|e| Error::io(&file, "open", e))?.len();
        if length == size { slices.push(file) } else { foreign.push(file) }
    }
    if slices.is_empty() {
        return Err(Error::field(
            dir,
            "dims",
            format!(
                "none of {} files has the {size} bytes of a slice of {nx}×{ny} {}",
                foreign.len(),
                layout.voxel_type.name()
            ),
        ));
    }
    if nz != 0 && nz != slices.len() {
        let problem = format!("{nz} slices declared, but {} files have {size} bytes", slices.len());
        return Err(Error::field(dir, "dims", problem));
    }
    Ok(Slices { kind: size, files: slices, foreign })
}

pub(super) fn read_slices(
    dir: &Path,
    layout: &RawLayout,
    spacing: Option<[f64; 3]>,
    exec: &Exec,
) -> Result<Volume, Error> {
    let found = slices(dir, layout)?;
    note_foreign(dir, &found.foreign, exec);
    let dims = [layout.dims[0], layout.dims[1], found.files.len()];
    let declared = Declared {
        voxel_type: layout.voxel_type,
        count: bounded::voxel_count(dir, "dims", dims)?,
        order: layout.order,
        packing: Packing::Raw,
        available: found.kind.saturating_mul(found.files.len() as u64),
    };
    declared.check(dir, 0, exec)?;
    let voxels = match layout.voxel_type {
        VoxelType::U8 => typed::<u8>(&found, declared, layout, exec),
        VoxelType::I8 => typed::<i8>(&found, declared, layout, exec),
        VoxelType::U16 => typed::<u16>(&found, declared, layout, exec),
        VoxelType::I16 => typed::<i16>(&found, declared, layout, exec),
        VoxelType::U32 => typed::<u32>(&found, declared, layout, exec),
        VoxelType::I32 => typed::<i32>(&found, declared, layout, exec),
        VoxelType::F32 => typed::<f32>(&found, declared, layout, exec),
        VoxelType::F64 => typed::<f64>(&found, declared, layout, exec),
    }?;
    suspect_order::note(dir, layout, dims[0], &voxels, exec);
    let grid = orientation::plain_grid(dir, dims, spacing.unwrap_or(layout.spacing))?;
    Ok(Volume::new(grid, voxels)?)
}

fn typed<T: Scalar + bytemuck::Zeroable>(
    found: &Slices<u64>,
    declared: Declared,
    layout: &RawLayout,
    exec: &Exec,
) -> Result<Voxels, Error> {
    let mut values: Vec<T> = bounded::zeroed(declared.count)?;
    exec.observer().begin("read", found.files.len() as u64);
    let per_slice = declared.count / found.files.len();
    for (path, slice) in found.files.iter().zip(values.chunks_exact_mut(per_slice)) {
        exec.check_cancelled()?;
        let (mut file, _) = bounded::open(path)?;
        bounded::seek(&mut file, path, layout.skip)?;
        let bytes = bytemuck::cast_slice_mut(slice);
        let got = bounded::read_up_to(&mut file.by_ref(), path, bytes)?;
        if got < bytes.len() {
            return Err(Error::truncated(path, "slice", bytes.len() as u64, got as u64));
        }
        if declared.order.is_foreign() {
            swap_in_place(bytes, size_of::<T>());
        }
        exec.observer().advance("read", 1);
    }
    exec.observer().end("read");
    Ok(T::wrap(values.into()))
}
