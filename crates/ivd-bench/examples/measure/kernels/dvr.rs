//! Time of a 512² picture of a 128³ volume: opaque, see-through, shaded, maximum.

use ivd_core::{Exec, Grid, TransferFunction, Volume, Voxels};
use ivd_render::{Mode, RenderParams, Scene, View, radiance};

use super::timing::Kernels;
use crate::anything::Anything;

/// A ball with a shell, and noise from an integer hash.
fn volume(n: usize) -> Anything<Volume> {
    let grid = Grid::with_spacing([n; 3], [1.0; 3])?;
    let value = |i: usize| {
        let radius = grid.index(i).0.map(|c| (c as f64 - n as f64 / 2.0).powi(2)).iter().sum::<f64>().sqrt();
        let noise = (i as u32).wrapping_mul(2_654_435_761) >> 20;
        let level = match radius / n as f64 {
            r if r < 0.3 => 30_000,
            r if r < 0.36 => 50_000,
            _ => 1_000,
        };
        (level + noise) as u16
    };
    let voxels: Vec<u16> = (0..grid.len()).map(value).collect();
    Ok(Volume::new(grid, Voxels::from(voxels))?)
}

fn transfer(opacity: f32) -> Anything<TransferFunction> {
    let ramp =
        (0..64).map(|i| [0.8, 0.6, 0.4, if i < 10 { 0.0 } else { opacity * i as f32 / 64.0 }]).collect();
    Ok(TransferFunction::new([0.0, 65535.0], 64, 1.0, vec![0], ramp, vec![])?)
}

pub(super) fn run(kernels: &Kernels<'_>) -> Anything<()> {
    let volume = volume(128)?;
    let _ = volume.bricks();
    let view = View { angles: [30.0, 15.0], ..View::FRONT };
    for (name, mode, opacity, shading) in [
        ("opaque", Mode::Dvr, 0.9, false),
        ("see-through", Mode::Dvr, 0.01, false),
        ("see-through, shaded", Mode::Dvr, 0.01, true),
        ("mip", Mode::Mip, 0.0, false),
    ] {
        let transfer = transfer(opacity)?;
        let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
        let params = RenderParams { mode, shading, view, step: 1.0, ..RenderParams::default() };
        kernels.time(&format!("dvr {name}"), || radiance(&scene, &params, &Exec::default()));
    }
    Ok(())
}
