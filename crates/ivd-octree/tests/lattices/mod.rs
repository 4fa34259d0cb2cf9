//! Lattices to test with, cut from random masks and from phantoms.

#![allow(clippy::unwrap_used, reason = "test values are sound")]

use ivd_core::{Exec, Grid, Lattice, LatticeSource, Mask, Volume, Voxels, noise};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_phantom::{Params, Shape, generate};

/// Grids of one size: unit, anisotropic and left-handed, rotated and sheared.
pub(crate) fn grids(dims: [usize; 3]) -> [Grid; 3] {
    let sheared = [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.28, 0.96]];
    let left = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    [
        Grid::with_spacing(dims, [1.0; 3]).unwrap(),
        Grid::new(dims, [0.3, 0.7, 5.0], [-4.0, 90.0, 1e6], left).unwrap(),
        Grid::new(dims, [1.0, 0.5, 2.0], [1e5, 0.0, 3.0], sheared).unwrap(),
    ]
}

/// A lattice without vertices.
pub(crate) fn empty() -> Lattice {
    let grid = Grid::with_spacing([3, 4, 5], [1.0; 3]).unwrap();
    let none = Lattice::new(grid, Vec::new().into(), Vec::new().into(), Vec::new().into());
    none.unwrap().with_source(LatticeSource::Mask)
}

/// Random bits, `percent` of them 1.
pub(crate) fn random_mask(grid: &Grid, seed: u64, percent: u64) -> Mask {
    let bit = |i: u64| u8::from(noise::below(seed, i, 100) < percent);
    Mask::new(grid.clone(), (0..grid.len() as u64).map(bit).collect::<Vec<_>>().into()).unwrap()
}

/// The lattice of a mask, halfway between its voxels: rows hit vertices and edges everywhere.
pub(crate) fn of_mask(mask: &Mask) -> Lattice {
    let volume = Volume::new(mask.grid().clone(), Voxels::from(mask.inside().to_vec())).unwrap();
    extract(&volume, Some(mask), &ExtractParams { iso: Iso::Mask }, &Exec::default()).unwrap().lattice
}

/// The lattice of a volume at an isovalue.
pub(crate) fn of_volume(volume: &Volume, iso: f64) -> Lattice {
    extract(volume, None, &ExtractParams { iso: Iso::Value(iso) }, &Exec::default()).unwrap().lattice
}

/// A phantom's voxels on another grid.
pub(crate) fn phantom(shape: Shape, grid: &Grid) -> Volume {
    let size = grid.dims()[0];
    let params = Params { shape, size, ..Params::default() };
    let phantom = generate(&params, &Exec::default()).unwrap().volume;
    Volume::new(grid.clone(), phantom.voxels().clone()).unwrap()
}
