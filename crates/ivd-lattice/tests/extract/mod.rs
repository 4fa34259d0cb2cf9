//! Extraction against what must hold for every field, and against analytic surfaces.
// A failed step of a test's own preparation is a failed test.
#![allow(clippy::unwrap_used)]

mod awkward;
mod convergence;
mod levels;
mod mesh;
mod normals;
mod parts;
mod random_fields;
mod several;
mod specks;
mod sphere;
mod ties;

use ivd_core::{Exec, Grid, Lattice, Mask, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};

/// The lattice of `voxels` on an isotropic grid.
fn cut(dims: [usize; 3], voxels: impl Into<Voxels>, iso: Iso) -> Lattice {
    let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
    cut_volume(&Volume::new(grid, voxels.into()).unwrap(), None, iso)
}

fn cut_volume(volume: &Volume, mask: Option<&Mask>, iso: Iso) -> Lattice {
    extract(volume, mask, &ExtractParams { iso }, &Exec::default()).unwrap().lattice
}

/// Small integers that look random.
fn noise(seed: u64, len: usize, values: u64) -> Vec<u8> {
    (0..len as u64).map(|i| ivd_core::noise::below(seed, i, values) as u8).collect()
}

fn hash(i: u64) -> u64 {
    ivd_core::noise::bits(0, i)
}
