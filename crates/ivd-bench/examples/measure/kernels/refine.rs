//! Refinement of a torus to a tenth of its triangles, and its measuring.

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{RefineParams, Target, collapse};

use super::timing::Kernels;
use crate::anything::Anything;

/// A torus in a cube of `n` voxels.
fn torus(n: usize) -> Anything<Lattice> {
    let grid = Grid::with_spacing([n; 3], [1.0; 3])?;
    let size = n as f64;
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, z] = grid.index(i).0.map(|c| c as f64 - 0.5 * size + 0.4);
            (0.12 * size - (x.hypot(y) - 0.28 * size).hypot(z)) as f32
        })
        .collect();
    let volume = Volume::new(grid, Voxels::from(voxels))?;
    let params = ExtractParams { iso: Iso::Value(0.0) };
    Ok(extract(&volume, None, &params, &Exec::default())?.lattice)
}

pub(super) fn run(kernels: &Kernels<'_>) -> Anything<()> {
    let lattice = torus(128)?;
    for threads in [1, 2] {
        let exec = Exec::default().with_threads(threads);
        let params = RefineParams { target: Target::Ratio(0.1).into(), ..RefineParams::default() };
        kernels.time(&format!("refine to a tenth, {threads} threads"), || collapse(&lattice, &params, &exec));
    }
    kernels.time("refine measure", || measure(&lattice));
    Ok(())
}
