//! Cuts a lattice out of a volume: marching cubes whose result is a closed 2-manifold for any field.
//!
//! The surface separates the voxels inside from those outside. It crosses a grid edge where its two voxels differ in
//! sign, once, and that crossing is a vertex; in each cell the crossings are linked into loops, face by face, and the
//! loops filled with triangles.
//!
//! - **Signs are exact.** A voxel is inside where its real value is, to the last bit, whatever slope and intercept
//!   lie between the stored value and the real one. A voxel on the isovalue is inside.
//! - **Always closed.** A layer of voxels outside surrounds the volume, so a part that leaves the volume is capped
//!   half a voxel beyond its border. Voxels that are no data are outside, with the surface halfway to them.
//! - **Always manifold.** An ambiguous face (inside and outside on opposite diagonals) is decided by the asymptotic
//!   decider (Nielson and Hamann 1991) from its own four voxels, hence alike in both its cells. Triangle edges never
//!   lie across a face, so no edge has more than two triangles; loops that leave no other way get a vertex in the
//!   cell's middle.
//! - **As the trilinear function goes.** Two loops in a cell bound two sheets, or a tube where that function joins inside
//!   to inside, or outside to outside, through the cell. So components and holes are those of the function's own surface. A
//!   saddle on the isovalue is inside, as a voxel is: all is as if the isovalue were less by a hair.
//! - **Never degenerate.** A crossing stays [`MIN_EDGE_FRACTION`](ivd_core::MIN_EDGE_FRACTION) of an edge away from its ends, so the corners
//!   of a triangle are three different places on three different elements.
//!
//! After Lorensen and Cline 1987, in the passes of Flying Edges (Schroeder, Maynard and Geveci 2015).
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, Voxels};
//! use ivd_lattice::extract::{extract, ExtractParams, Iso};
//!
//! let grid = Grid::with_spacing([3, 3, 3], [1.0; 3])?;
//! let mut voxels = vec![0_u8; 27];
//! voxels[13] = 200;
//! let volume = Volume::new(grid, Voxels::from(voxels))?;
//! let cut = extract(&volume, None, &ExtractParams { iso: Iso::Value(100.0) }, &Exec::default())?;
//! assert_eq!((cut.lattice.keys().len(), cut.lattice.triangles().len()), (6, 8)); // an octahedron around one voxel
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bounds;
pub(crate) mod cell;
mod extractor;
mod interior;
mod normals;
mod params;
mod parts;
mod place;
#[cfg(test)]
mod plain;
pub mod plan;
mod rows;
mod samples;
mod signs;
mod specks;
mod stage;
mod surface;
mod sweep;
mod table;
#[cfg(test)]
mod tests;
mod tube;
mod vertices;

use ivd_core::{Exec, Mask, Volume};

use crate::Error;
pub use extractor::{Extracted, Extractor};
pub use normals::normals;
pub use params::{ExtractParams, Iso};
pub use parts::{Part, extract_parts, labels_present};
pub use stage::{Inputs, IsoChoice, IsoWord, LatticeFigures, LatticeParams, STAGE};
pub(crate) use table::PARTED;

/// Cuts the surface `params.iso` out of `volume`, or out of the part of it that `mask` isolates.
///
/// With a mask, a voxel is inside where the mask says so (and the volume has data there). A crossing between two
/// voxels whose field agrees with the mask is placed by the field; beside a voxel where it doesn't (a neighbour cut
/// off, a hole filled) the surface runs halfway. For [`Iso::Mask`] the volume's values aren't read.
///
/// The lattice is closed and manifold for every input, and empty where nothing is inside. Same input, same lattice,
/// for any number of threads.
///
/// # Errors
/// [`ivd_core::Error::Param`] for a bad isovalue, [`Error::MissingInput`] for [`Iso::Mask`] without a mask,
/// [`Error::TooManyVertices`] beyond 32-bit indices, and in [`Error::Core`] a mask on another grid, the memory limit
/// and cancelling.
pub fn extract(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &ExtractParams,
    exec: &Exec,
) -> Result<Extracted, Error> {
    Extractor::default().extract(volume, mask, params, exec)
}
