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

/// Small integers that look random: a hash of the index and a seed.
fn noise(seed: u64, len: usize, values: u64) -> Vec<u8> {
    (0..len as u64).map(|i| (hash(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ i) % values) as u8).collect()
}

fn hash(mut x: u64) -> u64 {
    for _ in 0..2 {
        x = (x ^ (x >> 32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    }
    x ^ (x >> 32)
}
