//! Files of other programs, read and written.
//!
//! - [`volume`] reads the volumes of scanners, simulations and research tools (NIfTI, NRRD, MetaImage, DICOM folders, VTI, TIFF, PNG
//!   slices, raw) and writes them, and displacement fields, for other programs.
//! - [`mesh`] reads meshes (PLY, OBJ, STL, GLB, VTP) and writes lattices and their motions.
//! - [`transfer`] reads and writes transfer functions (3D Slicer, ParaView).
//! - [`landmarks`] reads points with names (3D Slicer).
//!
//! The format follows from the file's first bytes or its ending. Nothing in a file is trusted: sizes are checked against the file's own
//! before memory is taken, and an error names the file and the place in it. A file is replaced at once or not at all.
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, Voxels};
//! use ivd_io::volume::{ReadOptions, read, write};
//!
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("row.nrrd");
//! let row = Volume::new(Grid::with_spacing([3, 1, 1], [0.5, 1.0, 1.0])?, Voxels::from(vec![1_u8, 2, 3]))?;
//! write(&file, &row, &Exec::default())?;
//! let read = read(&file, &ReadOptions::default(), &Exec::default())?;
//! assert_eq!(read.voxels(), row.voxels());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod landmarks;
pub mod mesh;
#[cfg(test)]
#[path = "../tests/notes.rs"]
mod notes;
mod number;
mod order;
mod refusal;
mod space;
pub mod transfer;
pub mod volume;
mod vtk;

pub use refusal::FileError;
pub use space::Space;
