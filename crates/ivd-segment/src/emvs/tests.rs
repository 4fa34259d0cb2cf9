//! EMVS against a plain twin, its invariants, phantoms with a known truth, and awkward volumes.

use std::sync::{Arc, Mutex};

use ivd_core::{Exec, Grid, Iteration, Mask, Observer, Volume, Voxels};

use super::*;
use crate::Within;

mod coupled;

/// A small generator (Marsaglia 2003), so that every run is the same.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Near to normal: variance 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }
}

fn volume(dims: [usize; 3], spacing: [f64; 3], voxels: impl Into<Voxels>) -> Volume {
    Volume::new(Grid::with_spacing(dims, spacing).unwrap(), voxels.into()).unwrap()
}

fn run(volume: &Volume, params: &EmvsParams) -> Emvs {
    emvs(volume, None, params, &Exec::default()).unwrap()
}

fn with_k(k: usize) -> EmvsParams {
    EmvsParams { k: Some(k), ..EmvsParams::default() }
}

/// Values after each iteration, by method.
#[derive(Default)]
struct Trace(Mutex<Vec<Iteration>>);

impl Observer for Trace {
    fn iteration(&self, iteration: Iteration) {
        self.0.lock().unwrap().push(iteration);
    }
}

const SHAPES: [Covariance; 3] = [Covariance::Intensity, Covariance::Diagonal, Covariance::Full];

fn random_volume(noise: &mut Noise) -> Volume {
    let dims = [1 + noise.below(9), 1 + noise.below(7), 1 + noise.below(6)];
    let spacing = [0.5 + noise.uniform(), 1.0, 0.1 + 50.0 * noise.uniform()];
    let n = dims.iter().product::<usize>();
    let levels = 1 + noise.below(5);
    let spread = 10.0 * noise.uniform();
    let mut value = || {
        let level = noise.below(levels) as f64;
        20.0 + 40.0 * level + spread * noise.normal()
    };
    let values: Vec<f64> = (0..n).map(|_| value()).collect();
    match n % 3 {
        0 => volume(dims, spacing, values.iter().map(|v| *v as u8).collect::<Vec<_>>()),
        1 => volume(dims, spacing, values.iter().map(|v| (*v * 50.0) as u16).collect::<Vec<_>>()),
        _ => volume(dims, spacing, values.iter().map(|v| *v as f32).collect::<Vec<_>>()),
    }
}

#[test]
fn the_likelihood_never_falls_in_a_thousand_random_runs() {
    let mut noise = Noise(0x1234_5678_9abc_def1);
    for run in 0..1000 {
        let volume = random_volume(&mut noise);
        let trace = Arc::new(Trace::default());
        let exec = Exec::default().with_observer(trace.clone());
        let params = EmvsParams {
            k: Some(1 + noise.below(5)),
            covariance: SHAPES[run % 3],
            max_iterations: 40,
            tolerance: 0.0,
            ..EmvsParams::default()
        };
        let found = emvs(&volume, None, &params, &exec).unwrap();
        let values: Vec<f64> = trace.0.lock().unwrap().iter().map(|i| i.value).collect();
        for (i, w) in values.windows(2).enumerate() {
            assert!(
                w[1] - w[0] >= -1e-10 * w[0].abs().max(1.0),
                "run {run}, iteration {i}: {w:?} {params:?}"
            );
        }
        assert!(found.log_likelihood.is_finite());
        let sum: f64 = found.mixture.weights.iter().sum();
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }
}

/// EM voxel by voxel, as the textbook has it: weights, means, covariances (4 × 4 or the variance) and mean log-likelihood.
fn plain(data: &[Vec<f64>], start: &Mixture, shape: Covariance, rounds: usize) -> (Mixture, f64) {
    let (k, d) = (start.weights.len(), data[0].len());
    let mut m = start.clone();
    let matrix = |c: &[f64]| -> matrices::Matrix { matrices::from(c, d) };
    let step = |m: &Mixture| -> (Vec<Vec<f64>>, f64) {
        let inverses: Vec<_> = m.covariances.iter().map(|c| matrices::invert(&matrix(c))).collect();
        let mut likelihood = 0.0;
        let shares = data
            .iter()
            .map(|x| {
                let logs: Vec<f64> = (0..k)
                    .map(|j| {
                        let off: Vec<f64> = (0..d).map(|a| x[a] - m.means[j][a]).collect();
                        let (inverse, determinant) = &inverses[j];
                        let mut q = 0.0;
                        for a in 0..d {
                            for b in 0..d {
                                q += off[a] * inverse[a][b] * off[b];
                            }
                        }
                        m.weights[j].ln()
                            - 0.5 * (q + determinant.ln() + d as f64 * std::f64::consts::TAU.ln())
                    })
                    .collect();
                let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let all: f64 = logs.iter().map(|l| (l - most).exp()).sum();
                likelihood += most + all.ln();
                logs.iter().map(|l| (l - most).exp() / all).collect()
            })
            .collect();
        (shares, likelihood / data.len() as f64)
    };
    for _ in 0..rounds {
        let (shares, _) = step(&m);
        for j in 0..k {
            let n: f64 = shares.iter().map(|s| s[j]).sum();
            m.weights[j] = n / data.len() as f64;
            let mean = |a: usize| data.iter().zip(&shares).map(|(x, s)| s[j] * x[a]).sum::<f64>() / n;
            m.means[j] = (0..d).map(mean).collect();
            let means = m.means[j].clone();
            let cov = |a: usize, b: usize| {
                data.iter()
                    .zip(&shares)
                    .map(|(x, s)| s[j] * (x[a] - means[a]) * (x[b] - means[b]))
                    .sum::<f64>()
                    / n
            };
            m.covariances[j] = match shape {
                Covariance::Intensity => vec![cov(0, 0)],
                Covariance::Diagonal => (0..4).map(|a| cov(a, a)).collect(),
                Covariance::Full => (0..16).map(|i| cov(i / 4, i % 4)).collect(),
            };
        }
    }
    let likelihood = step(&m).1;
    (m, likelihood)
}

/// Inverse and determinant by elimination.
mod matrices {
    pub(super) type Matrix = Vec<Vec<f64>>;

    pub(super) fn from(c: &[f64], d: usize) -> Matrix {
        let entry = |a: usize, b: usize| match c.len() {
            16 => c[4 * a + b],
            _ if a == b => c[a],
            _ => 0.0,
        };
        (0..d).map(|a| (0..d).map(|b| entry(a, b)).collect()).collect()
    }

    pub(super) fn invert(m: &Matrix) -> (Matrix, f64) {
        let d = m.len();
        let mut left = m.clone();
        let mut right: Matrix =
            (0..d).map(|a| (0..d).map(|b| f64::from(u8::from(a == b))).collect()).collect();
        let mut determinant = 1.0;
        for i in 0..d {
            let pivot = left[i][i];
            determinant *= pivot;
            for b in 0..d {
                left[i][b] /= pivot;
                right[i][b] /= pivot;
            }
            for a in (0..d).filter(|a| *a != i) {
                let factor = left[a][i];
                for b in 0..d {
                    left[a][b] -= factor * left[i][b];
                    right[a][b] -= factor * right[i][b];
                }
            }
        }
        (right, determinant)
    }
}

/// A phantom of `levels` along slanted layers, with noise.
fn layers(dims: [usize; 3], levels: &[f64], sd: f64, seed: u64) -> (Vec<f64>, Vec<u16>) {
    let mut noise = Noise(seed);
    let n: usize = dims.iter().product();
    let truth: Vec<u16> = (0..n)
        .map(|i| {
            let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
            let far = (0..3).map(|a| at[a] as f64 / dims[a] as f64).sum::<f64>() / 3.0;
            ((far * levels.len() as f64) as usize).min(levels.len() - 1) as u16 + 1
        })
        .collect();
    (truth.iter().map(|t| levels[usize::from(*t) - 1] + sd * noise.normal()).collect(), truth)
}

#[test]
fn all_shapes_follow_the_plain_twin_for_every_storage_type() {
    let (dims, spacing) = ([13, 7, 5], [0.5, 1.25, 6.0]);
    let (values, _) = layers(dims, &[40.0, 100.0, 130.0], 9.0, 77);
    let bytes: Vec<u8> = values.iter().map(|v| v.round() as u8).collect();
    let scaled = |factor: f64, offset: f64| values.iter().map(move |v| v * factor + offset);
    let volumes = [
        volume(dims, spacing, bytes.clone()),
        volume(dims, spacing, scaled(300.0, 0.0).map(|v| v as u16).collect::<Vec<_>>()),
        volume(dims, spacing, scaled(30.0, -9000.0).map(|v| v as i16).collect::<Vec<_>>()),
        volume(dims, spacing, scaled(1.0, 1e7).map(|v| v as f32).collect::<Vec<_>>()),
        volume(dims, spacing, bytes.iter().map(|v| f64::from(*v)).collect::<Vec<_>>()),
        Volume::with_scale(Grid::with_spacing(dims, spacing).unwrap(), bytes.into(), -0.25, 3.0).unwrap(),
    ];
    for volume in &volumes {
        for shape in SHAPES {
            let data: Vec<Vec<f64>> = (0..volume.grid().len())
                .map(|i| {
                    let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
                    let mut x: Vec<f64> = (0..3).map(|a| at[a] as f64 * spacing[a]).collect();
                    x.push(volume.real(volume.voxels().get(i)));
                    if shape == Covariance::Intensity { x.split_off(3) } else { x }
                })
                .collect();
            let begin =
                run(volume, &EmvsParams { covariance: shape, max_iterations: 1, ..with_k(3) }).mixture;
            let params = EmvsParams {
                covariance: shape,
                max_iterations: 7,
                tolerance: 0.0,
                variance_floor: 0.0,
                k: None,
                start: Some(begin.clone()),
                ..EmvsParams::default()
            };
            let found = run(volume, &params);
            let (twin, likelihood) = plain(&data, &begin, shape, 7);
            let deviation = |j: usize, a: usize| twin.variances()[j][a].sqrt();
            assert!((found.log_likelihood - likelihood).abs() < 1e-7, "{shape:?} {likelihood} {found:?}");
            for j in 0..3 {
                assert!((found.mixture.weights[j] - twin.weights[j]).abs() < 1e-7, "{shape:?}");
                for a in 0..shape.dimensions() {
                    let off = (found.mixture.means[j][a] - twin.means[j][a]).abs() / deviation(j, a);
                    assert!(off < 1e-6, "{shape:?} {off}");
                }
                for (i, (a, b)) in found.mixture.covariances[j].iter().zip(&twin.covariances[j]).enumerate() {
                    let scale = if shape == Covariance::Full {
                        deviation(j, i / 4) * deviation(j, i % 4)
                    } else {
                        *b
                    };
                    assert!((a - b).abs() < 1e-5 * scale, "{shape:?} {a} {b}");
                }
            }
        }
    }
}

#[test]
fn labels_are_those_of_the_greatest_posterior() {
    let dims = [40, 11, 9];
    let (values, _) = layers(dims, &[10.0, 30.0, 33.0], 4.0, 5);
    let mut reals: Vec<f32> = values.iter().map(|v| *v as f32).collect();
    reals[17] = f32::NAN;
    reals[100] = f32::INFINITY;
    for volume in [
        volume(dims, [1.0, 1.0, 3.0], reals),
        volume(dims, [1.0; 3], values.iter().map(|v| *v as i8).collect::<Vec<_>>()),
    ] {
        for shape in SHAPES {
            let params = EmvsParams { covariance: shape, ..with_k(3) };
            let (found, maps) = emvs_with_posteriors(&volume, None, &params, &Exec::default()).unwrap();
            let ids = found.segmentation.labels.ids();
            let is_real = volume.voxel_type() == ivd_core::VoxelType::F32;
            assert_eq!(ids.iter().filter(|id| **id == 0).count(), 2 * usize::from(is_real));
            let mut class_of = std::collections::BTreeMap::new();
            for (i, id) in ids.iter().enumerate() {
                let shares: Vec<f32> = maps.iter().map(|map| map[i]).collect();
                if *id == 0 {
                    assert_eq!(shares, [0.0; 3]);
                    continue;
                }
                assert!((shares.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                let most = shares.iter().copied().fold(0.0, f32::max);
                let best = shares.iter().position(|s| *s == most).unwrap();
                let second = shares
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| *j != best)
                    .map(|(_, s)| *s)
                    .fold(0.0, f32::max);
                if most - second > 1e-4 {
                    assert_eq!(*class_of.entry(best).or_insert(*id), *id, "{shape:?} {shares:?}");
                }
            }
        }
    }
}

#[test]
fn the_criterion_finds_the_number_of_well_separated_components() {
    for (levels, seed) in [(vec![50.0], 3), (vec![40.0, 90.0], 1), (vec![20.0, 60.0, 100.0, 200.0], 9)] {
        let (values, _) = layers([24, 24, 24], &levels, 4.0, seed);
        for volume in [
            volume([24; 3], [1.0; 3], values.iter().map(|v| v.round() as u8).collect::<Vec<_>>()),
            volume([24; 3], [1.0; 3], values.iter().map(|v| *v as f32).collect::<Vec<_>>()),
        ] {
            let found = run(&volume, &EmvsParams { k: None, k_max: 6, ..EmvsParams::default() });
            assert_eq!(found.mixture.weights.len(), levels.len(), "{:?}", found.bic);
            assert_eq!(found.bic.len(), 6);
            for (mean, level) in found.mixture.means.iter().zip(&levels) {
                assert!((mean[0] - level).abs() < 0.5, "{mean:?} {level}");
            }
        }
    }
}

/// Blocks of `k` materials with noise; each voxel is the mean of the materials of eight places in it.
fn mixed_blocks(k: usize, noise_sd: f64, seed: u64) -> Volume {
    const N: usize = 40;
    let mut noise = Noise(seed);
    let centres: Vec<([f64; 3], f64)> = (0..6 * k)
        .map(|i| {
            let level = 30.0 + 190.0 * (i % k) as f64 / (k.max(2) - 1) as f64;
            (std::array::from_fn(|_| N as f64 * noise.uniform()), level)
        })
        .collect();
    let level = |at: [f64; 3]| {
        let distance = |c: &[f64; 3]| -> f64 { (0..3).map(|a| (c[a] - at[a]).powi(2)).sum() };
        let nearest = centres.iter().min_by(|a, b| distance(&a.0).total_cmp(&distance(&b.0)));
        nearest.unwrap().1
    };
    let mut values = Vec::new();
    for i in 0..N * N * N {
        let at = [i % N, i / N % N, i / (N * N)];
        let shares =
            (0..8).map(|c| level(std::array::from_fn(|a| at[a] as f64 + 0.5 * f64::from(c >> a & 1))));
        values.push((shares.sum::<f64>() / 8.0 + noise_sd * noise.normal()).round() as u8);
    }
    volume([N; 3], [1.0; 3], values)
}

#[test]
fn mixed_voxels_ask_for_no_components_of_their_own() {
    for k in 2..=6 {
        for noise in [3.0, 6.0, 9.0] {
            let volume = mixed_blocks(k, noise, 77 + 10 * k as u64 + noise as u64);
            let found = run(&volume, &EmvsParams { k: None, ..EmvsParams::default() });
            assert_eq!(found.mixture.weights.len(), k, "noise {noise}: {:?}", found.bic);
            let by_bic = found.bic.iter().min_by(|a, b| a.bic.total_cmp(&b.bic)).unwrap();
            assert!(by_bic.k >= k);
        }
    }
}

fn dice(a: &[u16], b: &[u16], id: u16) -> f64 {
    let both = a.iter().zip(b).filter(|(a, b)| **a == id && **b == id).count();
    let each = a.iter().chain(b).filter(|v| **v == id).count();
    2.0 * both as f64 / each as f64
}

#[test]
fn a_bias_is_taken_out_of_values_of_any_size() {
    let dims = [12, 11, 10];
    let (values, _) = layers(dims, &[60.0, 140.0], 10.0, 4);
    let gain = |i: usize| 0.8 + 0.4 * (i % dims[0]) as f64 / dims[0] as f64;
    let voxels: Vec<u8> = values.iter().enumerate().map(|(i, v)| (v * gain(i)) as u8).collect();
    let of = |slope: f64| {
        let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
        let volume = Volume::with_scale(grid, voxels.clone().into(), slope, 0.0).unwrap();
        run(&volume, &EmvsParams { bias: 15.0, smoothing: 0.5, ..with_k(2) })
    };
    let plain = of(1.0);
    let gains = &plain.bias.as_ref().unwrap().gains;
    assert!(gains.iter().any(|g| *g < 0.95) && gains.iter().any(|g| *g > 1.05), "{gains:?}");
    for slope in [2.0_f64.powi(600), 2.0_f64.powi(-600)] {
        let found = of(slope);
        assert!(found.segmentation.labels.ids() == plain.segmentation.labels.ids(), "{slope}");
        assert_eq!(found.bias, plain.bias, "{slope}");
    }
    let grid = Grid::with_spacing([4, 1, 1], [1.0; 3]).unwrap();
    let beyond = vec![-8e149, 2e209, f64::NAN, 1.0];
    let volume = Volume::with_scale(grid, beyond.into(), 7e140, 0.0).unwrap();
    let found = run(&volume, &EmvsParams { bias: 15.0, ..with_k(2) });
    let labelled: Vec<bool> = found.segmentation.labels.ids().iter().map(|id| *id > 0).collect();
    assert_eq!(labelled, [true, true, false, true]);
}

#[test]
fn a_known_bias_is_found_and_labels_are_mended() {
    let dims = [48, 40, 36];
    let (values, truth) = layers(dims, &[60.0, 100.0, 150.0], 4.0, 8);
    let gain = |i: usize| {
        let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        1.0 + 0.3 * ((at[0] as f64 / 47.0 - 0.5) - (at[1] as f64 / 39.0 - 0.5))
    };
    let biased: Vec<f32> = values.iter().enumerate().map(|(i, v)| (v * gain(i)) as f32).collect();
    let volume = volume(dims, [1.0; 3], biased);
    let plain = run(&volume, &with_k(3));
    let found = run(&volume, &EmvsParams { bias: 15.0, ..with_k(3) });
    let bias = found.bias.as_ref().unwrap();
    let ratios: Vec<f64> = (0..truth.len())
        .map(|i| bias.at([i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]]) / gain(i))
        .collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    let error = (ratios.iter().map(|r| (r / mean - 1.0).powi(2)).sum::<f64>() / ratios.len() as f64).sqrt();
    let known = (0..truth.len()).map(|i| (gain(i) - 1.0).powi(2)).sum::<f64>() / truth.len() as f64;
    assert!(error < 0.25 * known.sqrt(), "{error} of {}", known.sqrt());
    for id in 1..=3 {
        let [before, after] = [&plain, &found].map(|f| dice(f.segmentation.labels.ids(), &truth, id));
        assert!(after > before && after > 0.97, "{before} {after}");
    }
}

#[test]
fn threads_and_storage_types_change_no_bit() {
    let dims = [65, 33, 20];
    let (values, _) = layers(dims, &[30.0, 90.0, 160.0], 12.0, 11);
    let of = |kind: usize| -> Voxels {
        let whole = values.iter().map(|v| v.round().clamp(0.0, 255.0));
        match kind {
            0 => whole.map(|v| v as u8).collect::<Vec<_>>().into(),
            1 => whole.map(|v| v as i16).collect::<Vec<_>>().into(),
            2 => whole.map(|v| v as u16).collect::<Vec<_>>().into(),
            3 => whole.map(|v| v as f32).collect::<Vec<_>>().into(),
            4 => whole.map(|v| v as i32).collect::<Vec<_>>().into(),
            _ => whole.collect::<Vec<_>>().into(),
        }
    };
    let variants = [
        with_k(3),
        EmvsParams { covariance: Covariance::Diagonal, max_iterations: 6, ..with_k(3) },
        EmvsParams { covariance: Covariance::Full, max_iterations: 6, ..with_k(3) },
        EmvsParams { smoothing: 0.7, smoothing_iterations: 4, ..with_k(3) },
        EmvsParams { bias: 20.0, ..with_k(3) },
    ];
    for params in variants {
        let all = |volume: &Volume, threads| {
            emvs_with_posteriors(volume, None, &params, &Exec::default().with_threads(threads)).unwrap()
        };
        let first = all(&volume(dims, [1.0, 1.0, 2.0], of(0)), 2);
        for kind in 0..6 {
            let volume = volume(dims, [1.0, 1.0, 2.0], of(kind));
            for threads in if kind == 0 || kind == 3 { &[1, 2, 3, 8][..] } else { &[2][..] } {
                assert!(all(&volume, *threads) == first, "{threads} threads, type {kind}, {params:?}");
            }
        }
    }
}

#[test]
fn awkward_volumes_give_finite_results_in_order() {
    let n = 4 * 5 * 6;
    let each = |f: &dyn Fn(usize) -> f64| (0..n).map(f).collect::<Vec<f64>>();
    let floats = |v: Vec<f64>| Voxels::from(v.into_iter().map(|v| v as f32).collect::<Vec<_>>());
    let volumes: Vec<Voxels> = vec![
        vec![7_u8; n].into(),
        vec![-2.5_f32; n].into(),
        vec![f32::NAN; n].into(),
        floats(each(&|i| if i == 3 { 4.0 } else { f64::NAN })),
        floats(each(&|i| [1.0, f64::INFINITY, f64::NEG_INFINITY, 5e-45][i % 4])),
        floats(each(&|i| 1e7 + (i % 4) as f64)),
        floats(each(&|i| if i == 50 { 1e30 } else { (i % 7) as f64 })),
        each(&|i| if i == 50 { f64::MAX } else { -f64::MAX * (i % 2) as f64 }).into(),
        each(&|i| 5e-324 * (i % 3) as f64).into(),
        (0..n).map(|i| if i % 20 == 0 { 200_u8 } else { 0 }).collect::<Vec<_>>().into(),
        (0..n).map(|i| ((i * 37 % 4096) << 4) as u16).collect::<Vec<_>>().into(),
        (0..n).map(|i| if i % 3 == 0 { 65_535_u16 } else { (i % 30) as u16 }).collect::<Vec<_>>().into(),
        (0..n).map(|i| if i % 3 == 0 { -2000_i16 } else { (i % 30) as i16 }).collect::<Vec<_>>().into(),
        (0..n).map(|i| ((i + i / 4 + i / 20) % 2) as u8).collect::<Vec<_>>().into(),
        (0..n).map(|i| i as i32).collect::<Vec<_>>().into(),
        (0..n).map(|i| if i % 2 == 0 { u32::MAX } else { i as u32 }).collect::<Vec<_>>().into(),
    ];
    for voxels in volumes {
        for dims in [[4, 5, 6], [1, 20, 6], [n, 1, 1], [1, 1, n]] {
            for shape in SHAPES {
                for smoothing in [0.0, 0.5] {
                    let volume = volume(dims, [1.0, 1.0, 50.0], voxels.clone());
                    let params = EmvsParams { covariance: shape, smoothing, max_iterations: 30, ..with_k(4) };
                    let found = run(&volume, &params);
                    assert_sound(&volume, &found, &params);
                }
            }
        }
    }
}

fn assert_sound(volume: &Volume, found: &Emvs, params: &EmvsParams) {
    let about = format!("{:?} {:?} {:?} {params:?}", volume.voxels(), volume.range(), volume.grid().dims());
    let Mixture { weights, means, covariances } = &found.mixture;
    let numbers = weights.iter().chain(means.iter().flatten()).chain(covariances.iter().flatten());
    assert!(numbers.chain([&found.log_likelihood]).all(|v| v.is_finite()), "{:?} {about}", found.mixture);
    assert!(weights.iter().all(|w| (0.0..=1.0 + 1e-9).contains(w)), "{weights:?} {about}");
    assert!(found.mixture.variances().iter().flatten().all(|v| *v >= 0.0), "{about}");
    let classes = found.segmentation.labels.classes();
    assert!(classes.windows(2).all(|w| w[0].mean <= w[1].mean), "{about}");
    assert!(classes.iter().all(|c| c.mean.is_finite() && c.sd.is_finite()), "{about}");
    let data = (0..volume.grid().len()).filter(|i| volume.voxels().get(*i).is_finite());
    let ids = found.segmentation.labels.ids();
    assert!(data.clone().all(|i| ids[i] > 0), "{about}");
    assert_eq!(classes.iter().map(|c| c.voxels).sum::<u64>(), data.count() as u64, "{about}");
    assert!(
        found.energies.windows(2).all(|w| w[1] <= w[0] + 1e-9 * w[0].abs()),
        "{:?} {about}",
        found.energies
    );
}

#[test]
fn masks_and_ranges_leave_the_rest_alone() {
    let dims = [20, 10, 10];
    let (values, truth) = layers(dims, &[50.0, 150.0], 5.0, 2);
    let mut bytes: Vec<u8> = values.iter().map(|v| *v as u8).collect();
    let inside: Vec<u8> = (0..bytes.len()).map(|i| u8::from(i % 3 != 0)).collect();
    (0..bytes.len()).filter(|i| inside[*i] == 0).for_each(|i| bytes[i] = 255);
    let volume = volume(dims, [1.0; 3], bytes);
    let mask = Mask::new(volume.grid().clone(), inside.clone().into()).unwrap();
    for shape in SHAPES {
        for smoothing in [0.0, 0.5] {
            let params = EmvsParams { covariance: shape, smoothing, ..with_k(2) };
            let masked = emvs(&volume, Some(&mask), &params, &Exec::default()).unwrap();
            let ranged = run(&volume, &EmvsParams { within: Within::range(0.0, 254.0), ..params });
            for (i, id) in masked.segmentation.labels.ids().iter().enumerate() {
                assert_eq!(*id, if inside[i] == 0 { 0 } else { truth[i] }, "{shape:?} {smoothing} {i}");
            }
            assert!(masked == ranged);
        }
    }
    let none = Mask::new(volume.grid().clone(), vec![0; 2000].into()).unwrap();
    let found = emvs(&volume, Some(&none), &EmvsParams { bias: 3.0, ..with_k(2) }, &Exec::default()).unwrap();
    assert_eq!((found.segmentation.k, found.mixture.weights.len()), (0, 0));
    assert!(found.segmentation.labels.ids().iter().all(|id| *id == 0));
}

#[test]
fn an_outlier_does_not_hide_what_floats_say() {
    let (values, truth) = layers([30, 20, 20], &[0.2, 0.8], 0.05, 6);
    let mut reals: Vec<f32> = values.iter().map(|v| *v as f32).collect();
    reals[5] = 1e12;
    reals[6] = -3e9;
    let volume = volume([30, 20, 20], [1.0; 3], reals);
    let found = run(&volume, &with_k(4));
    let near = |level: f64| found.mixture.means.iter().any(|m| (m[0] - level).abs() < 0.02);
    assert!(near(0.2) && near(0.8), "{:?}", found.mixture);
    let ids = found.segmentation.labels.ids();
    let wrong = (7..truth.len()).filter(|i| (ids[*i] == ids[7]) != (truth[*i] == truth[7])).count();
    assert!(wrong < 10, "{wrong}");
}

#[test]
fn bad_parameters_are_named() {
    let start = Mixture { weights: vec![1.0], means: vec![vec![0.0; 4]], covariances: vec![vec![1.0; 4]] };
    let diagonal = EmvsParams {
        k: None,
        covariance: Covariance::Diagonal,
        start: Some(start.clone()),
        ..EmvsParams::default()
    };
    assert!(diagonal.check().is_ok());
    for (params, field) in [
        (with_k(0), "k"),
        (EmvsParams { k_max: 0, ..EmvsParams::default() }, "k_max"),
        (EmvsParams { max_iterations: 0, ..EmvsParams::default() }, "max_iterations"),
        (EmvsParams { tolerance: f64::NAN, ..EmvsParams::default() }, "tolerance"),
        (EmvsParams { smoothing: -1.0, ..EmvsParams::default() }, "smoothing"),
        (EmvsParams { within: Within::range(2.0, 1.0), ..EmvsParams::default() }, "range"),
        (EmvsParams { k: None, start: Some(start), ..EmvsParams::default() }, "start"),
        (EmvsParams { k: Some(2), ..diagonal }, "start"),
    ] {
        assert_eq!(params.check().unwrap_err().field, field);
    }
}
