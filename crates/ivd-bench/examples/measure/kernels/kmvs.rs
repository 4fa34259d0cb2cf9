//! k-means on intensity, 128³ voxels of each fast type.

use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_segment::{KmvsParams, kmvs};

use super::timing::Kernels;
use crate::anything::Anything;

const SIDE: u64 = 128;

/// Four noisy levels, from integer hashes.
fn level(i: u64) -> f64 {
    let hash =
        |i: u64| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (i << 13)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let noise: f64 = (1..5).map(|n| (hash(i * 4 + n) >> 11) as f64 / (1_u64 << 53) as f64).sum();
    0.1 + 0.2 * (i / 4096 % 4) as f64 + 0.03 * (noise - 2.0)
}

pub(super) fn run(kernels: &Kernels<'_>) -> Anything<()> {
    let values: Vec<f64> = (0..SIDE.pow(3)).map(level).collect();
    let of = |voxels: Voxels| -> Anything<Volume> {
        Ok(Volume::new(Grid::with_spacing([SIDE as usize; 3], [1.0; 3])?, voxels)?)
    };
    let params = KmvsParams { k: 4, ..KmvsParams::default() };
    for (name, volume) in [
        ("u8", of(values.iter().map(|v| (v * 255.0) as u8).collect::<Vec<_>>().into())?),
        ("u16", of(values.iter().map(|v| (v * 65535.0) as u16).collect::<Vec<_>>().into())?),
        ("f32", of(values.iter().map(|v| *v as f32).collect::<Vec<_>>().into())?),
    ] {
        kernels.time(&format!("kmvs {name}"), || kmvs(&volume, None, &params, &Exec::default()).map(drop));
    }
    Ok(())
}
