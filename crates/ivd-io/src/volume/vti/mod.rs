//! VTK image data in XML: `.vti`.
//!
//! Read: ASCII, inline base64, appended raw and appended base64; plain or in zlib blocks; block headers of 32 or
//! 64 bits; both byte orders. The scalars are the point array that `Scalars` names, else the first one. VTK gives its
//! world no anatomical meaning: coordinates are taken as ITK takes them, as LPS millimetres, and written as such. A field `SPACE` that says LPS
//! or RAS, as in surfaces, says that they are the patient's.
//! An extent that doesn't start at 0 moves the first voxel: VTK's `Origin` is the place of index 0.

mod data;
mod header;
mod write;

use std::path::Path;

use ivd_core::{Exec, Grid, Volume};

use crate::Space;
use crate::volume::{Error, bounded, orientation};
use header::Header;
pub use write::write;

/// Reads a `.vti` file.
///
/// # Errors
/// [`Error`] names the element and attribute that is malformed, contradicts the data, or isn't supported.
pub fn read(path: &Path, exec: &Exec) -> Result<Volume, Error> {
    exec.run(|| {
        let (file, length) = bounded::open(path)?;
        exec.check_memory("the file", length)?;
        let mut bytes = bounded::zeroed::<u8>(length as usize)?;
        bounded::fill(&mut &file, path, &mut bytes, exec)?;
        let header = Header::parse(path, &bytes)?;
        let voxels = data::read(path, &header, exec)?;
        Ok(Volume::new(grid(path, &header)?, voxels)?.with_patient_space(header.space.is_some()))
    })
}

fn grid(path: &Path, header: &Header) -> Result<Grid, Error> {
    let first: [f64; 3] = std::array::from_fn(|row| {
        header.origin[row]
            + (0..3)
                .map(|axis| header.axes[axis][row] * (header.spacing[axis] * header.start[axis] as f64))
                .sum::<f64>()
    });
    // What a file in RAS says is turned to LPS, and back: by the same signs.
    let turned = |v: [f64; 3]| if header.space == Some(Space::Ras) { orientation::flip(v) } else { v };
    orientation::grid_from_lps_parts(
        path,
        header.dims,
        header.spacing,
        turned(first),
        header.axes.map(turned),
    )
}

#[cfg(test)]
mod tests;
