//! Mesh files: written and read again, of other programs, damaged; and lattices made of them.
#![allow(clippy::unwrap_used, reason = "a failed step of a test's own preparation is a failed test")]

mod addresses;
mod bad_files;
mod imported;
mod index_relation;
mod mutations;
mod other_programs;
mod quality;
mod round_trips;
mod solids;

use ivd_core::Mesh;
use ivd_core::{Grid, Lattice};
use ivd_io::mesh::Error;
use ivd_io::mesh::{Format, read_bytes, write};

/// Reads bytes without a limit.
fn read(format: Format, bytes: &[u8]) -> Result<Mesh, Error> {
    read_bytes(format, bytes, u64::MAX)
}

/// The file of a lattice, and what rounding it reports (mm).
fn file(format: Format, lattice: &Lattice) -> (Vec<u8>, f64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh").with_extension(format.ending());
    let written = write(&path, lattice, None).unwrap();
    (std::fs::read(path).unwrap(), written.rounding_mm)
}

/// Grids of every kind: near and far, oblique, left-handed.
fn grids() -> Vec<Grid> {
    let (s, c) = 0.3_f64.sin_cos();
    let oblique = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]];
    let left = [[-c, -s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]];
    let straight = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let grid = |dims, spacing, origin, direction| Grid::new(dims, spacing, origin, direction).unwrap();
    vec![
        grid([7, 6, 5], [1.0; 3], [0.0; 3], straight),
        grid([5, 7, 6], [0.7, 0.7, 3.0], [-120.5, 80.25, 31.0], straight),
        grid([6, 6, 6], [0.4, 0.5, 2.5], [10.0, -20.0, 3.0], oblique),
        grid([6, 5, 7], [0.4, 0.5, 1.5], [-91.0, 126.0, -72.0], left),
        grid([6, 6, 5], [0.5, 0.5, 0.5], [1e6, -1e6, 1e6], oblique),
        grid([5, 6, 6], [0.1, 0.2, 3.0], [1e6, 2.0, -3.0], left),
    ]
}
