//! Time to cut a lattice out of 128³ voxels: a smooth closed surface, one that fills space, and noise.

use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};

use super::timing::Kernels;
use crate::anything::Anything;

const N: usize = 128;

fn volume(value: impl Fn([f32; 3]) -> f32) -> Anything<Volume> {
    let at = |i: usize| [i % N, i / N % N, i / N / N].map(|v| v as f32 - 63.3);
    let voxels: Vec<f32> = (0..N * N * N).map(|i| value(at(i))).collect();
    Ok(Volume::new(Grid::with_spacing([N; 3], [1.0; 3])?, Voxels::from(voxels))?)
}

fn gyroid(p: [f32; 3]) -> f32 {
    let [(sx, cx), (sy, cy), (sz, cz)] = p.map(|v| (v * 0.2).sin_cos());
    sx * cy + sy * cz + sz * cx
}

fn noise(p: [f32; 3]) -> f32 {
    ((p[0] * 12.9898 + p[1] * 78.233 + p[2] * 37.719).sin() * 43_758.547).fract()
}

pub(super) fn run(kernels: &Kernels<'_>) -> Anything<()> {
    let exec = Exec::default();
    for (name, volume, iso) in [
        ("sphere", volume(|p| 45.0 - p[0].hypot(p[1]).hypot(p[2]))?, 0.0),
        ("gyroid", volume(gyroid)?, 0.0),
        ("noise", volume(noise)?, 0.5),
    ] {
        let params = ExtractParams { iso: Iso::Value(iso) };
        volume.bricks();
        kernels.time(&format!("extract {name}, index at hand"), || extract(&volume, None, &params, &exec));
        // The voxels are shared, what was found out about them is not.
        let unseen = || Volume::new(volume.grid().clone(), volume.voxels().clone());
        kernels.time_prepared(&format!("extract {name}, index built"), unseen, |volume| {
            volume.map(|volume| extract(&volume, None, &params, &exec))
        });
    }
    Ok(())
}
