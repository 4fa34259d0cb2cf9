//! Against mean shift of every datum over every datum, analytic mixtures, and awkward volumes.

use ivd_core::{Classified, ErrorClass, Exec, Grid, Mask, Volume, Voxels};
use rayon::prelude::*;

use super::*;
use crate::Within;

/// Uniform in 0…1.
fn uniform(i: u64) -> f64 {
    ivd_core::noise::unit(0, i)
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
            assert!(
                class.lower.is_none_or(|l| l <= real) && class.upper.is_none_or(|u| real < u),
                "{class:?}"
            );
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
    let sum =
        |t: &std::collections::BTreeMap<(usize, usize), f64>| t.values().map(|n| pairs(*n)).sum::<f64>();
    let expected = sum(&rows) * sum(&columns) / pairs(a.len() as f64);
    let most = 0.5 * (sum(&rows) + sum(&columns));
    if most == expected { 1.0 } else { (sum(&table) - expected) / (most - expected) }
}

fn assert_as_plain(name: &str, volume: &Volume, range: f64, spatial: f64) {
    let params = MsvsParams {
        range_bandwidth: range,
        spatial_bandwidth: spatial,
        persistence: 0.0,
        k_max: 1024,
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
    let blob = |i: u64| {
        [(10.0, 2.0), (30.0, 4.0), (55.0, 3.0), (90.0, 6.0)][[0, 0, 1, 1, 1, 2, 3, 3][i as usize % 8]]
    };
    (0..n).map(|i| blob(i).0 + blob(i).1 * normal(i)).collect()
}

/// Two balls of one value and a third of another, noisy.
fn balls(dims: [usize; 3], noise: f64) -> Vec<f32> {
    let n: usize = dims.iter().product();
    (0..n)
        .map(|i| {
            let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
            let near = |c: [f64; 3]| {
                (0..3).map(|a| (at[a] as f64 / dims[a] as f64 - c[a]).powi(2)).sum::<f64>() < 0.04
            };
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
        (0..12_u64.pow(3)).map(|i| if i % 12 < 5 { 50.0 } else { 120.0 } + 8.0 * normal(i) as f32).collect();
    assert_as_plain("halves", &volume([12; 3], [1.0; 3], halves), 20.0, 4.0);
    let thick = volume([16, 16, 5], [1.0, 1.0, 3.0], balls([16, 16, 5], 6.0));
    assert_as_plain("thick slices", &thick, 20.0, 4.0);
    assert_as_plain("balls", &volume([12; 3], [1.0; 3], balls([12; 3], 8.0)), 25.0, 3.0);
}

/// The same with 10⁴ points, by `just stress`.
#[test]
#[ignore = "minutes: every point moves over every other; run it in release, with --ignored"]
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

#[test]
fn modes_of_a_mixture_are_found_within_a_fiftieth_of_the_bandwidth() {
    // Quantiles of two normal distributions; the blurred density is a mixture with the variance grown by the bandwidth's.
    let n = 20_000;
    let quantile = |p: f64| {
        // Bisection on the error function's series is long; the logistic's quantile has a density of its own: sech².
        (p / (1.0 - p)).ln()
    };
    let values: Vec<f64> = (0..n)
        .map(|i| {
            let p = ((i / 2) as f64 + 0.5) / (n / 2) as f64;
            if i % 2 == 0 { 40.0 + quantile(p) } else { 70.0 + 3.0 * quantile(p) }
        })
        .collect();
    let h = 2.0;
    for kernel in [Kernel::Gaussian, Kernel::Flat] {
        let params = MsvsParams { range_bandwidth: h, kernel, ..MsvsParams::default() };
        let found = run(&line(values.clone()), &params);
        assert_eq!(found.modes.len(), 2);
        // Symmetric, and too far apart to pull at each other.
        assert!((found.modes[0].value - 40.0).abs() < h / 50.0, "{:?}", found.modes[0]);
        assert!((found.modes[1].value - 70.0).abs() < h / 10.0, "{:?}", found.modes[1]);
        let weight = |d: f64| match kernel {
            Kernel::Gaussian => (-0.5 * d * d).exp(),
            Kernel::Flat => (1.0 - d * d).max(0.0),
        };
        for mode in &found.modes {
            let direct = values.iter().map(|v| weight((v - mode.value) / h)).sum::<f64>() / n as f64;
            assert!((mode.density / direct - 1.0).abs() < 0.002, "{} for {direct}", mode.density);
        }
        assert_eq!(
            found.segmentation.labels.classes()[0].voxels + found.segmentation.labels.classes()[1].voxels,
            n as u64
        );
    }
}

#[test]
fn ranks_go_by_height_above_the_saddle_and_the_rest_joins_its_neighbour() {
    // Peaks of 400, 300 and 100 voxels; the small one hangs on to the middle one.
    let values: Vec<u8> = [vec![20; 400], vec![80; 300], vec![89; 100]].concat();
    let params = MsvsParams { range_bandwidth: 2.0, ..MsvsParams::default() };
    let found = run(&line(values.clone()), &params);
    let ranked: Vec<f64> = found.modes.iter().map(|m| m.value.round()).collect();
    assert_eq!((ranked, found.k_proposed), (vec![20.0, 80.0, 89.0], 3));
    assert_eq!(found.modes[0].persistence, 1.0);
    let two = run(&line(values.clone()), &MsvsParams { k_max: 2, ..params.clone() });
    assert_eq!((two.modes.len(), two.k_proposed), (2, 3));
    assert_eq!(two.segmentation.labels.ids()[799], two.segmentation.labels.ids()[400], "89 joins 80");
    let all = run(&line(values), &MsvsParams { persistence: 1.0, ..params });
    assert_eq!(all.modes.len(), 1, "everything is given up to the highest");
}

#[test]
fn chance_makes_no_modes() {
    // Noise about two levels, few voxels for the bandwidth: bumps, but none that counts could not explain.
    let values: Vec<f64> =
        (0..3000).map(|i| if i % 3 == 0 { 100.0 } else { 0.0 } + 10.0 * normal(i)).collect();
    let loose = MsvsParams { range_bandwidth: 1.0, persistence: 0.0, ..MsvsParams::default() };
    let found = run(&line(values.clone()), &loose);
    assert!(found.modes.len() > 4, "{}", found.modes.len());
    let found = run(&line(values), &MsvsParams { persistence: 0.05, ..loose });
    assert_eq!(found.modes.len(), 2);
}

#[test]
fn plateaus_have_one_mode_and_two_blobs_of_a_value_are_two_classes_only_in_space() {
    for spatial in [0.0, 3.0] {
        let params = MsvsParams { spatial_bandwidth: spatial, ..MsvsParams::default() };
        assert_eq!(run(&volume([16; 3], [1.0; 3], vec![7_u8; 4096]), &params).segmentation.k, 1);
    }
    let two: Vec<u8> =
        (0..40 * 12 * 12).map(|i| if (12..28).contains(&(i % 40)) { 200 } else { 50 }).collect();
    let two = volume([40, 12, 12], [1.0; 3], two);
    let alone = MsvsParams { range_bandwidth: 20.0, ..MsvsParams::default() };
    assert_eq!(run(&two, &alone).segmentation.k, 2);
    let found = run(&two, &MsvsParams { spatial_bandwidth: 6.0, ..alone });
    assert_eq!(found.segmentation.k, 3, "{:?}", found.modes);
    let ids = found.segmentation.labels.ids();
    assert!(ids[0] != ids[20] && ids[20] != ids[39] && ids[0] != ids[39]);
    assert_eq!(found.modes.iter().map(|m| m.voxels).max(), Some(16 * 144));
}

#[test]
fn threads_and_storage_types_do_not_change_a_byte() {
    let bytes: Vec<u8> = balls([16, 14, 12], 9.0).iter().map(|v| v.clamp(0.0, 255.0) as u8).collect();
    let dims = [16, 14, 12];
    for (spatial, kernel) in [(0.0, Kernel::Gaussian), (3.0, Kernel::Gaussian), (3.0, Kernel::Flat)] {
        let params =
            MsvsParams { range_bandwidth: 12.0, spatial_bandwidth: spatial, kernel, ..MsvsParams::default() };
        let with = |threads, voxels: Voxels| {
            let exec = Exec::default().with_threads(threads);
            msvs(&volume(dims, [1.0, 1.2, 0.9], voxels), None, &params, &exec).unwrap()
        };
        let first = with(1, bytes.clone().into());
        for threads in [2, 3, 8] {
            assert_eq!(with(threads, bytes.clone().into()), first);
        }
        assert_eq!(with(2, bytes.iter().map(|v| f32::from(*v)).collect::<Vec<_>>().into()), first);
        assert_eq!(with(2, bytes.iter().map(|v| i16::from(*v)).collect::<Vec<_>>().into()), first);
        assert_eq!(with(2, bytes.iter().map(|v| u32::from(*v)).collect::<Vec<_>>().into()), first);
    }
}

#[test]
fn awkward_volumes_give_ordered_finite_classes() {
    let board: Vec<u8> = (0..512).map(|i| ((i + i / 8 + i / 64) & 1) as u8 * 255).collect();
    let ramp: Vec<u16> = (0..512).map(|i| i * 16).collect();
    let air: Vec<f32> = (0..512).map(|i| if i % 20 == 0 { 100.0 } else { 0.0 }).collect();
    let mut missing = air.clone();
    missing[3..6].copy_from_slice(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
    let far: Vec<f32> = (0..512).map(|i| 1e7 + (i % 5) as f32).collect();
    let mut outlier: Vec<f32> = (0..512).map(|i| (i % 7) as f32).collect();
    outlier[100] = 1e30;
    let padded: Vec<i16> = (0..512).map(|i| if i % 4 == 0 { -2000 } else { 900 + i % 30 }).collect();
    let tiny: Vec<f64> = (0..512).map(|i| f64::from(i % 3) * 1e-310).collect();
    let huge: Vec<f64> = (0..512).map(|i| [f64::MIN, 0.0, f64::MAX][i % 3]).collect();
    let all: [Voxels; 9] = [
        board.into(),
        ramp.into(),
        air.into(),
        missing.into(),
        far.into(),
        outlier.into(),
        padded.into(),
        tiny.into(),
        huge.into(),
    ];
    for voxels in all {
        for (dims, spacing) in [
            ([8; 3], [1.0; 3]),
            ([1, 32, 16], [1.0; 3]),
            ([8; 3], [1.0, 1.0, 50.0]),
            ([512, 1, 1], [1e-3; 3]),
        ] {
            for spatial in [0.0, 2.5 * spacing[0]] {
                for kernel in [Kernel::Gaussian, Kernel::Flat] {
                    let params = MsvsParams {
                        spatial_bandwidth: spatial,
                        kernel,
                        persistence: 0.0,
                        ..MsvsParams::default()
                    };
                    let found = run(&volume(dims, spacing, voxels.clone()), &params);
                    assert!(found.segmentation.k >= 1);
                }
            }
        }
    }
    assert_eq!(run(&line(vec![5_u8]), &MsvsParams::default()).modes[0].density, 1.0);
}

#[test]
fn falling_slopes_masks_and_ranges_are_kept() {
    let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
    let falling =
        Volume::with_scale(grid.clone(), vec![0_u8, 1, 200, 201, 0, 200].into(), -2.0, 10.0).unwrap();
    let params = MsvsParams { range_bandwidth: 8.0, persistence: 0.0, ..MsvsParams::default() };
    let found = run(&falling, &params);
    assert_eq!(found.segmentation.labels.ids(), [2, 2, 1, 1, 2, 1]);
    let mask = Mask::new(grid.clone(), vec![1, 1, 0, 1, 1, 0].into()).unwrap();
    for spatial in [0.0, 50.0] {
        let params = MsvsParams { spatial_bandwidth: spatial, ..params.clone() };
        let found = msvs(&falling, Some(&mask), &params, &Exec::default()).unwrap();
        assert_eq!(found.segmentation.labels.ids(), [2, 2, 0, 1, 2, 0]);
    }
    let ranged = MsvsParams { within: Within::range(0.0, 10.0), ..params.clone() };
    assert_eq!(run_loose(&falling, &ranged).segmentation.labels.ids(), [1, 1, 0, 0, 1, 0]);
    let empty = Mask::new(grid, vec![0; 6].into()).unwrap();
    let found = msvs(&falling, Some(&empty), &params, &Exec::default()).unwrap();
    assert_eq!((found.segmentation.k, found.k_proposed), (0, 0));
    assert_eq!(run(&line(vec![f32::NAN; 9]), &params).segmentation.k, 0);
}

fn run_loose(volume: &Volume, params: &MsvsParams) -> Msvs {
    msvs(volume, None, params, &Exec::default()).unwrap()
}

#[test]
fn bad_parameters_limits_and_too_many_cells_are_named() {
    let small = line(vec![1_u8, 2, 3]);
    let fails = |params: MsvsParams| msvs(&small, None, &params, &Exec::default()).unwrap_err().to_string();
    assert!(
        fails(MsvsParams { range_bandwidth: -1.0, ..MsvsParams::default() }).contains("`range_bandwidth`")
    );
    assert!(
        fails(MsvsParams { spatial_bandwidth: f64::NAN, ..MsvsParams::default() })
            .contains("`spatial_bandwidth`")
    );
    assert!(
        fails(MsvsParams { spatial_bandwidth: 1e-300, ..MsvsParams::default() })
            .contains("`spatial_bandwidth`")
    );
    assert!(fails(MsvsParams { k_max: 0, ..MsvsParams::default() }).contains("`k_max`"));
    assert!(
        fails(MsvsParams { cells_per_bandwidth: 0.5, ..MsvsParams::default() })
            .contains("`cells_per_bandwidth`")
    );
    assert!(fails(MsvsParams { persistence: 1.5, ..MsvsParams::default() }).contains("`persistence`"));
    let noise: Vec<f32> = (0..40_u64.pow(3)).map(|i| uniform(i) as f32).collect();
    let noise = volume([40; 3], [1.0; 3], noise);
    let narrow = MsvsParams { range_bandwidth: 1e-4, spatial_bandwidth: 1.0, ..MsvsParams::default() };
    let error = msvs(&noise, None, &narrow, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("bandwidth`") && error.error_class() == ErrorClass::Usage, "{error}");
    let wide = MsvsParams { range_bandwidth: 0.2, spatial_bandwidth: 3.0, ..MsvsParams::default() };
    let tight = Exec::default().with_memory_limit(Some(1 << 20));
    let error = msvs(&noise, None, &wide, &tight).unwrap_err();
    assert!(
        error.to_string().contains("spatial_bandwidth") && error.error_class() == ErrorClass::Limit,
        "{error}"
    );
    let stopped = Exec::default();
    stopped.cancel.cancel();
    assert_eq!(msvs(&noise, None, &wide, &stopped).unwrap_err().error_class(), ErrorClass::Cancelled);
}

#[test]
fn the_chain_keeps_what_is_there_and_reports_every_number() {
    use super::chain::{ChainParams, msvs_kmvs};
    let values: Vec<u8> =
        (0..30_000).map(|i| ([40.0, 90.0, 170.0][i as usize % 3] + 8.0 * normal(i)) as u8).collect();
    let params = ChainParams { k_min: 1, ..ChainParams::default() };
    for voxels in
        [Voxels::from(values.clone()), values.iter().map(|v| f32::from(*v)).collect::<Vec<_>>().into()]
    {
        let found = msvs_kmvs(&line(voxels), None, &params, &Exec::default()).unwrap();
        assert_eq!((found.k_proposed, found.k_kept, found.segmentation.k), (3, 3, 3));
        assert_eq!(found.curve.iter().map(|p| p.k).collect::<Vec<_>>(), [1, 2, 3]);
        assert!(found.curve.windows(2).all(|w| w[1].objective < w[0].objective));
        let error = found.curve[2].objective / found.segmentation.objective - 1.0;
        assert!(error.abs() < 0.01, "{error}");
    }
    // One broad class, notched: two modes, which are one class.
    let notched: Vec<f64> =
        (0..40_000).map(|i| 100.0 + 10.0 * normal(i)).filter(|v| (v - 103.0).abs() > 0.6).collect();
    let narrow = MsvsParams { range_bandwidth: 1.0, ..MsvsParams::default() };
    let found =
        msvs_kmvs(&line(notched), None, &ChainParams { msvs: narrow, k_min: 1 }, &Exec::default()).unwrap();
    assert!(found.k_proposed >= 2 && found.k_kept == 1, "{} {:?}", found.k_proposed, found.curve);
    let none = msvs_kmvs(&line(vec![f32::NAN; 4]), None, &params, &Exec::default()).unwrap();
    assert_eq!((none.k_proposed, none.k_kept, none.curve.len()), (0, 0, 0));
    assert!(ChainParams { k_min: 0, ..ChainParams::default() }.check().is_err());
}

#[test]
fn integers_whose_real_values_lie_beyond_f64_have_their_cells() {
    let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
    let voxels = vec![-30_000_i16, 30_000, 0, 1, -1, 30_000];
    let volume = Volume::with_scale(grid, voxels.into(), 1e305, 0.0).unwrap();
    for range_bandwidth in [0.0, 1e290, 1e300] {
        let params = MsvsParams { range_bandwidth, ..MsvsParams::default() };
        let found = msvs(&volume, None, &params, &Exec::default()).unwrap();
        assert!(found.segmentation.labels.ids().iter().all(|id| *id > 0), "{range_bandwidth}");
    }
}
