use std::path::Path;

use ivd_core::{Exec, Volume, VoxelType, counted};
use serde::{Deserialize, Serialize};

use crate::volume::data::{DataFile, Encoding, Frames, Start};
use crate::volume::replace::replace;
use crate::volume::stored::FileType;
use crate::volume::values::Values;
use crate::volume::{ByteOrder, Error, Written, bounded, orientation, suspect_order};

/// How a file without a header is laid out; x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawLayout {
    /// Voxels along x, y, z. For a folder of raw slices z may be 0: the number of files is taken.
    pub dims: [usize; 3],
    /// Stored type.
    pub voxel_type: VoxelType,
    /// Distance of voxel centres, in mm.
    #[serde(default = "unit_spacing")]
    pub spacing: [f64; 3],
    /// Byte order.
    #[serde(default)]
    pub order: ByteOrder,
    /// Bytes before the first voxel, in each file.
    #[serde(default)]
    pub skip: u64,
}

fn unit_spacing() -> [f64; 3] {
    [1.0; 3]
}

/// Reads a file without a header; a note tells where it is most likely of the other byte order.
pub(crate) fn read(path: &Path, layout: &RawLayout, exec: &Exec) -> Result<Volume, Error> {
    let count = bounded::voxel_count(path, "dims", layout.dims)?;
    let grid = orientation::plain_grid(path, layout.dims, layout.spacing)?;
    let data = DataFile {
        path: path.to_owned(),
        offset: 0,
        start: Start::After { lines: 0, bytes: layout.skip },
        encoding: Encoding::Raw,
        order: layout.order,
        file_type: FileType::Plain(layout.voxel_type),
        count,
        frames: Frames { field: "dims", count: 1, chosen: None },
    };
    let voxels = data.read(exec)?;
    let read = layout.skip + (voxels.len() * layout.voxel_type.bytes()) as u64;
    if let Some(left @ 1..) = std::fs::metadata(path).ok().and_then(|file| file.len().checked_sub(read)) {
        let [x, y, z] = layout.dims;
        exec.observer().note(&format!(
            "{}: {} left over after {x} × {y} × {z} voxels of {}; where they belong to the volume, give other --raw-dims, --raw-type \
             or --raw-skip (in a scene dims, type, skip of input.raw)",
            path.display(),
            counted(left, "byte is", "bytes are"),
            layout.voxel_type.name(),
        ));
    }
    suspect_order::note(path, layout, layout.dims[0], &voxels, exec);
    Ok(Volume::new(grid, voxels)?)
}

/// Writes the voxels alone, least significant byte first.
pub(crate) fn write(path: &Path, volume: &Volume, exec: &Exec) -> Result<Written, Error> {
    let values = Values::without_scale(volume);
    let written = replace(path, |to| values.write(to, path, volume, exec))?;
    let grid = volume.grid();
    exec.observer().note(&format!(
        "{}: numbers alone; --raw-dims {} --raw-type {} --raw-spacing {} read it back, or with --grid-of FILE in place of the spacing where that file lies",
        path.display(),
        listed(grid.dims()),
        values.voxel_type(volume).name(),
        listed(grid.spacing()),
    ));
    Ok(written)
}

fn listed<T: std::fmt::Display>(of: [T; 3]) -> String {
    of.map(|one| one.to_string()).join(",")
}
