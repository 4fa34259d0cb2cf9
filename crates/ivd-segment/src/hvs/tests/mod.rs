//! What the tests of trees share: volumes, and plain twins that are slow and obviously right.

mod awkward;
mod cuts;
mod grown;
mod single;
mod ward;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Linkage, Mask, Tree, Volume, Voxels};

use super::{CutParams, Hvs, HvsParams, Ranking, cut, region_tree};
use crate::Within;

/// Numbers that look random, 0…2³² − 1.
fn noise(seed: u64) -> impl FnMut() -> u32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32 ^ (state >> 20) as u32
    }
}

fn volume(dims: [usize; 3], voxels: impl Into<Voxels>) -> Volume {
    Volume::new(Grid::with_spacing(dims, [1.0; 3]).unwrap(), voxels.into()).unwrap()
}

/// Bell-shaped noise of standard deviation 1 or so.
fn bell(next: &mut impl FnMut() -> u32) -> f64 {
    (0..12).map(|_| f64::from(next()) / f64::from(u32::MAX)).sum::<f64>() - 6.0
}

/// Nested tissues (air, skin, skull, brain with two ventricles) with noise, and which tissue each voxel is.
fn head(n: usize, sigma: f64) -> (Volume, Vec<usize>) {
    let means = [5.0, 150.0, 30.0, 110.0, 70.0];
    let mut next = noise(5);
    let tissue = |i: usize| {
        let p = [i % n, i / n % n, i / n / n].map(|v| (v as f64 + 0.5) / n as f64 - 0.5);
        let r = |c: [f64; 3], s: [f64; 3]| (0..3).map(|a| ((p[a] - c[a]) / s[a]).powi(2)).sum::<f64>();
        let skull = r([0.0; 3], [0.36, 0.44, 0.4]);
        let ventricle = |x: f64| r([x, 0.02, 0.03], [0.06, 0.15, 0.09]) < 1.0;
        match skull {
            _ if ventricle(-0.1) || ventricle(0.1) => 4,
            v if v < 0.6 => 3,
            v if v < 0.8 => 2,
            v if v < 1.0 => 1,
            _ => 0,
        }
    };
    let truth: Vec<usize> = (0..n * n * n).map(tissue).collect();
    let voxels: Vec<u8> =
        truth.iter().map(|&t| (means[t] + sigma * bell(&mut next)).clamp(0.0, 255.0) as u8).collect();
    (volume([n; 3], voxels), truth)
}

fn single() -> HvsParams {
    HvsParams { linkage: Linkage::Single, ..HvsParams::default() }
}

fn grow(volume: &Volume, params: &HvsParams) -> Hvs {
    region_tree(volume, None, params, &Exec::default()).unwrap()
}

fn heights(tree: &Tree) -> Vec<f64> {
    (0..tree.merges.len()).map(|merge| tree.height(merge)).collect()
}

fn classes(k: usize, order: Ranking) -> CutParams {
    CutParams { k, ranking: order, ..CutParams::default() }
}

/// The pairs of neighbouring voxels with data.
fn neighbours(volume: &Volume, mask: Option<&Mask>) -> Vec<[usize; 2]> {
    let [nx, ny, nz] = volume.grid().dims();
    let present = |i: usize| volume.voxels().get(i).is_finite() && mask.is_none_or(|m| m.inside()[i] != 0);
    let mut pairs = Vec::new();
    for i in 0..nx * ny * nz {
        let at = [i % nx, i / nx % ny, i / nx / ny];
        for (axis, step) in [1, nx, nx * ny].into_iter().enumerate() {
            if at[axis] + 1 < [nx, ny, nz][axis] && present(i) && present(i + step) {
                pairs.push([i, i + step]);
            }
        }
    }
    pairs
}

fn real(volume: &Volume, voxel: usize) -> f64 {
    volume.real(volume.voxels().get(voxel))
}

/// Sum of squared deviations of the values of each label but 0.
fn inertia(volume: &Volume, ids: &[u16]) -> f64 {
    let k = usize::from(ids.iter().copied().max().unwrap_or(0));
    let mut sums = vec![[0.0; 2]; k + 1];
    for (i, id) in ids.iter().enumerate() {
        sums[usize::from(*id)][0] += 1.0;
        sums[usize::from(*id)][1] += real(volume, i);
    }
    let deviation = |(i, id): (usize, &u16)| {
        let [count, sum] = sums[usize::from(*id)];
        if *id == 0 { 0.0 } else { (real(volume, i) - sum / count).powi(2) }
    };
    ids.iter().enumerate().map(deviation).sum()
}
