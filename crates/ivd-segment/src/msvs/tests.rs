//! Against mean shift of every datum over every datum, analytic mixtures, and awkward volumes.

use ivd_core::{Exec, Fault, Grid, Mask, Volume, Voxels};

use super::*;

/// Uniform in 0…1, from a hash.
fn uniform(i: u64) -> f64 {
    let mut x = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Standard normal.
fn normal(i: u64) -> f64 {
    let radius = (-2.0 * (1.0 - uniform(2 * i)).ln()).sqrt();
    radius * (2.0 * std::f64::consts::PI * uniform(2 * i + 1)).cos()
}

fn volume(dims: [usize; 3], spacing: [f64; 3], voxels: impl Into<Voxels>) -> Volume {
    Volume::new(Grid::with_spacing(dims, spacing).unwrap(), voxels.into()).unwrap()
}

fn line(voxels: impl Into<Voxels>) -> Volume {
    let voxels = voxels.into();
    volume([voxels.len(), 1, 1], [1.0; 3], voxels)
}

fn run(volume: &Volume, params: &MsvsParams) -> Msvs {
    let found = msvs(volume, None, params, &Exec::default()).unwrap();
    assert_consistent(volume, &found);
    found
}

/// What must hold of every result.
fn assert_consistent(volume: &Volume, found: &Msvs) {
    let labels = &found.segmentation.labels;
    assert_eq!(found.segmentation.k, labels.classes().len());
    assert_eq!(found.modes.len(), found.segmentation.k);
    assert!(labels.classes().windows(2).all(|w| w[0].mean <= w[1].mean && w[0].id + 1 == w[1].id));
    for (i, id) in labels.ids().iter().enumerate() {
        let value = volume.voxels().get(i);
        let class = labels.class(*id);
        assert!(class.is_some() || (*id == 0 && !value.is_finite()), "voxel {i} = {value} has label {id}");
        let real = volume.real(value);
        if let Some(class) = class.filter(|_| found.spatial_bandwidth == 0.0) {
            assert!(class.lower.is_none_or(|l| l <= real) && class.upper.is_none_or(|u| real < u), "{class:?}");
        }
    }
    for mode in &found.modes {
        let numbers = [mode.value, mode.density, mode.persistence, mode.position[0], mode.position[2]];
        assert!(numbers.iter().all(|v| v.is_finite()), "{mode:?}");
        assert_eq!(labels.class(mode.class).unwrap().voxels, mode.voxels);
        assert!(mode.density > 0.0 && (0.0..=1.0).contains(&mode.persistence), "{mode:?}");
    }
    let height = |m: &Mode| m.density * m.persistence;
    assert!(found.modes.windows(2).all(|w| height(&w[0]) >= height(&w[1]) * 0.99));
    assert!(found.segmentation.objective.is_finite());
}

/// The plain twin: every datum moves over all data until it stands still, then data whose ends are close are one class.
struct Plain {
    labels: Vec<usize>,
    /// Density of each class's highest end.
    density: Vec<f64>,
}

fn plain(volume: &Volume, range: f64, spatial: f64) -> Plain {
    let points: Vec<[f64; 4]> = (0..volume.grid().len())
        .map(|i| {
            let at = volume.grid().index(i).0;
            let place = |a: usize| {
                if spatial > 0.0 { at[a] as f64 * volume.grid().spacing()[a] / spatial } else { 0.0 }
            };
            [place(0), place(1), place(2), volume.real(volume.voxels().get(i)) / range]
        })
        .collect();
    let shifted = |from: &[f64; 4]| {
        let (mut sum, mut weights) = ([0.0; 4], 0.0);
        for p in &points {
            let square: f64 = (0..4).map(|a| (p[a] - from[a]).powi(2)).sum();
            if square < 60.0 {
                let w = (-0.5 * square).exp();
                weights += w;
                (0..4).for_each(|a| sum[a] += w * p[a]);
            }
        }
        (sum.map(|s| s / weights), weights)
    };
    use rayon::prelude::*;
    let ends: Vec<([f64; 4], f64)> = points
        .par_iter()
        .map(|p| {
            let mut at = *p;
            loop {
                let (next, density) = shifted(&at);
                let moved = (0..4).map(|a| (next[a] - at[a]).powi(2)).sum::<f64>().sqrt();
                at = next;
                if moved < 1e-4 {
                    return (at, density / points.len() as f64);
                }
            }
        })
        .collect();
    let (mut modes, mut density, mut labels) = (Vec::<[f64; 4]>::new(), Vec::<f64>::new(), Vec::new());
    for (end, height) in ends {
        let near = |m: &[f64; 4]| (0..4).map(|a| (m[a] - end[a]).powi(2)).sum::<f64>() < 0.04;
        let label = modes.iter().position(near).unwrap_or_else(|| {
            modes.push(end);
            density.push(0.0);
            modes.len() - 1
        });
        density[label] = height.max(density[label]);
        labels.push(label);
    }
    Plain { labels, density }
}

/// Adjusted Rand index (Hubert & Arabie 1985).
fn rand_index(a: &[usize], b: &[u16]) -> f64 {
    let pairs = |n: f64| n * (n - 1.0) / 2.0;
    let mut table = std::collections::BTreeMap::new();
    let (mut rows, mut columns) = (table.clone(), table.clone());
    for (x, y) in a.iter().zip(b) {
        *table.entry((*x, usize::from(*y))).or_insert(0.0) += 1.0;
        *rows.entry((*x, 0)).or_insert(0.0) += 1.0;
        *columns.entry((0, usize::from(*y))).or_insert(0.0) += 1.0;
    }
    let sum = |t: &std::collections::BTreeMap<(usize, usize), f64>| t.values().map(|n| pairs(*n)).sum::<f64>();
    let expected = sum(&rows) * sum(&columns) / pairs(a.len() as f64);
    let most = 0.5 * (sum(&rows) + sum(&columns));
    if most == expected { 1.0 } else { (sum(&table) - expected) / (most - expected) }
}

fn assert_as_plain(name: &str, volume: &Volume, range: f64, spatial: f64) {
    let params = MsvsParams {
        range_bandwidth: range,
        spatial_bandwidth: spatial,
        persistence: 0.0,
        k_max: MOST_MODES,
        ..MsvsParams::default()
    };
    let found = run(volume, &params);
    let twin = plain(volume, range, spatial);
    let index = rand_index(&twin.labels, found.segmentation.labels.ids());
    let worst = (0..twin.density.len())
        .map(|m| {
            // The class that most of the twin's class went to.
            let mut votes = std::collections::BTreeMap::new();
            let ids = found.segmentation.labels.ids().iter().zip(&twin.labels);
            ids.filter(|(_, l)| **l == m).for_each(|(id, _)| *votes.entry(*id).or_insert(0) += 1);
            let (id, _) = votes.into_iter().max_by_key(|(_, n)| *n).unwrap();
            let mode = found.modes.iter().find(|mode| mode.class == id).unwrap();
            (mode.density / twin.density[m] - 1.0).abs()
        })
        .fold(0.0, f64::max);
    println!(
        "{name}: rand index {index:.4}, {} modes for {}, densities within {worst:.4}",
        found.modes.len(),
        twin.density.len()
    );
    assert!(index >= 0.98, "{name}: {index}");
    assert!(worst <= 0.01, "{name}: {worst}");
}

/// Blobs along the value, of unequal size and width.
fn blobs(n: u64) -> Vec<f64> {
    let blob = |i: u64| [(10.0, 2.0), (30.0, 4.0), (55.0, 3.0), (90.0, 6.0)][[0, 0, 1, 1, 1, 2, 3, 3][i as usize % 8]];
    (0..n).map(|i| blob(i).0 + blob(i).1 * normal(i)).collect()
}

/// Two balls of one value and a third of another, noisy.
fn balls(dims: [usize; 3], noise: f64) -> Vec<f32> {
    let n: usize = dims.iter().product();
    (0..n)
        .map(|i| {
            let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
            let near = |c: [f64; 3]| (0..3).map(|a| (at[a] as f64 / dims[a] as f64 - c[a]).powi(2)).sum::<f64>() < 0.04;
            let level = if near([0.27, 0.27, 0.3]) || near([0.75, 0.7, 0.7]) {
                100.0
            } else if near([0.75, 0.25, 0.5]) {
                180.0
            } else {
                20.0
            };
            (level + noise * normal(i as u64)) as f32
        })
        .collect()
}

#[test]
fn blobs_of_values_end_where_brute_force_says() {
    assert_as_plain("blobs", &line(blobs(4000)), 3.0, 0.0);
    let bytes: Vec<u8> = blobs(4000).iter().map(|v| v.clamp(0.0, 255.0) as u8).collect();
    assert_as_plain("bytes", &line(bytes), 2.5, 0.0);
}

#[test]
fn small_volumes_end_where_brute_force_says() {
    let halves: Vec<f32> =
        (0..14_u64.pow(3)).map(|i| if i % 14 < 6 { 50.0 } else { 120.0 } + 8.0 * normal(i) as f32).collect();
    assert_as_plain("halves", &volume([14; 3], [1.0; 3], halves), 20.0, 4.0);
    let thick = volume([18, 18, 6], [1.0, 1.0, 3.0], balls([18, 18, 6], 6.0));
    assert_as_plain("thick slices", &thick, 20.0, 4.0);
    assert_as_plain("balls", &volume([15; 3], [1.0; 3], balls([15; 3], 8.0)), 25.0, 3.5);
}

/// The same with 10⁴ points: minutes, so by hand (`--ignored`, in release).
#[test]
#[ignore = "minutes"]
fn ten_thousand_points_end_where_brute_force_says() {
    assert_as_plain("blobs", &line(blobs(10_000)), 3.0, 0.0);
    assert_as_plain("narrow", &line(blobs(10_000)), 1.5, 0.0);
    let side = 22_usize;
    let halves: Vec<f32> = (0..side.pow(3) as u64)
        .map(|i| if i % 22 < 9 { 50.0 } else { 120.0 } + 10.0 * normal(i) as f32)
        .collect();
    assert_as_plain("halves", &volume([side; 3], [1.0; 3], halves), 20.0, 4.0);
    for (spatial, noise) in [(3.0, 8.0), (5.0, 8.0), (4.0, 20.0)] {
        let name = format!("balls, bandwidth {spatial} and noise {noise}");
        assert_as_plain(&name, &volume([side; 3], [1.0; 3], balls([side; 3], noise)), 25.0, spatial);
    }
    let thick = volume([32, 32, 10], [1.0, 1.0, 3.0], balls([32, 32, 10], 8.0));
    assert_as_plain("thick slices", &thick, 20.0, 5.0);
    let fine = volume([22; 3], [0.5; 3], balls([22; 3], 8.0));
    assert_as_plain("cells of two voxels", &fine, 20.0, 4.0);
}
