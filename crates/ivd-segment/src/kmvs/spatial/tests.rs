#[path = "../../../tests/plain/kmvs_spatial.rs"]
mod plain;

use super::*;
use crate::Within;
use ivd_core::noise;
use ivd_core::{Grid, Voxels};
use std::sync::{Arc, Mutex};

/// Hears the inertia of every iteration.
#[derive(Default)]
struct Heard(Mutex<Vec<f64>>);

impl ivd_core::Observer for Heard {
    fn iteration(&self, iteration: Iteration) {
        assert_eq!(iteration.method, "kmvs");
        self.0.lock().unwrap().push(iteration.value);
    }
}

fn grid(dims: [usize; 3], spacing: [f64; 3]) -> Grid {
    Grid::with_spacing(dims, spacing).unwrap()
}

fn params(k: usize, weight: f64) -> KmvsParams {
    KmvsParams { k, spatial_weight: weight, ..KmvsParams::default() }
}

fn found(volume: &Volume, mask: Option<&Mask>, params: &KmvsParams) -> SpatialKmvs {
    kmvs_spatial(volume, mask, params, &Exec::default()).unwrap()
}

/// Looks at every voxel with every centroid.
fn every_voxel() -> Exec {
    let mut exec = Exec::default();
    exec.skip = false;
    exec
}

/// A hash of an index, for noise that is the same everywhere.
fn hash(i: u64) -> u64 {
    noise::bits(0, i) >> 17
}

/// Slabs of different levels with noise of a given amplitude.
fn noisy(dims: [usize; 3], seed: u64, levels: u64, noise: u64) -> Vec<u16> {
    (0..dims.iter().product::<usize>() as u64)
        .map(|i| {
            let [x, y] = [i % dims[0] as u64, i / dims[0] as u64 % dims[1] as u64];
            let level = (x * levels / dims[0] as u64 + y / 7) % levels;
            (level * 40 + hash(i.wrapping_mul(31) + seed) % (noise + 1)) as u16
        })
        .collect()
}

/// Start centroids at voxels of the volume.
fn start_at(volume: &Volume, k: usize, seed: u64) -> Vec<[f64; 4]> {
    (0..k as u64)
        .map(|i| {
            let linear = (hash(seed * 1000 + i) % volume.grid().len() as u64) as usize;
            let index = volume.grid().index(linear).0;
            let mm: [f64; 3] = std::array::from_fn(|a| volume.grid().spacing()[a] * index[a] as f64);
            let value = volume.voxels().get(linear);
            [mm[0], mm[1], mm[2], volume.real(if value.is_finite() { value } else { 0.0 })]
        })
        .collect()
}

/// The twin's labels under the numbers of the classes: its clusters by mean value, the larger first, then the first.
fn renumbered(volume: &Volume, plain: &plain::Plain) -> Vec<u16> {
    let k = plain.centroids.len();
    let mut sums = vec![(0_u64, 0_i128); k + 1];
    for (i, id) in plain.ids.iter().enumerate().filter(|(_, id)| **id > 0) {
        let sum = &mut sums[usize::from(*id)];
        sum.0 += 1;
        sum.1 += (volume.voxels().get(i) * 1024.0 * volume.slope().signum()) as i128;
    }
    let mut order: Vec<usize> = (1..=k).filter(|id| sums[*id].0 > 0).collect();
    order.sort_by(|&a, &b| {
        let product = |a: usize, b: usize| sums[a].1 * i128::from(sums[b].0);
        product(a, b).cmp(&product(b, a)).then(sums[b].0.cmp(&sums[a].0)).then(a.cmp(&b))
    });
    let mut classes = vec![0; k + 1];
    order.iter().enumerate().for_each(|(i, id)| classes[*id] = i as u16 + 1);
    plain.ids.iter().map(|id| classes[usize::from(*id)]).collect()
}

/// Holds the fast path against the twin: labels, centroids, inertia after every iteration.
fn assert_plain(volume: &Volume, mask: Option<&Mask>, weight: f64, k: usize, seed: u64) {
    let start = start_at(volume, k, seed);
    let plain = plain::lloyd(volume, mask, weight, &start, 300);
    let heard = Arc::new(Heard::default());
    let exec = Exec::default().with_observer(heard.clone());
    let params = KmvsParams { start: Some(start), ..params(k, weight) };
    let fast = kmvs_spatial(volume, mask, &params, &exec).unwrap();
    let expected = renumbered(volume, &plain);
    let differ = expected.iter().zip(fast.segmentation.labels.ids()).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "of {} labels differ, {} ties", expected.len(), fast.ties);
    assert_eq!(fast.reseeded, plain.reseeded);
    for centroid in &fast.centroids {
        assert!(plain.centroids.contains(centroid), "{centroid:?} in {:?}", plain.centroids);
    }
    let heard = heard.0.lock().unwrap();
    assert_eq!(heard.len(), plain.inertia.len());
    for (fast, plain) in heard.iter().zip(&plain.inertia) {
        assert!((fast - plain).abs() <= 1e-10 * plain.abs() + 1e-9, "{fast} for {plain}");
    }
    assert!(heard.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-12)), "{heard:?}");
    assert_eq!(fast.segmentation.objective, *heard.last().unwrap());
    let every = kmvs_spatial(volume, mask, &params, &every_voxel()).unwrap();
    assert_eq!(every.segmentation.labels, fast.segmentation.labels);
    assert_eq!((every.centroids, every.ties), (fast.centroids, fast.ties));
}

#[test]
fn labels_are_plain_lloyds_on_random_integer_volumes() {
    let dims = [[33, 17, 9], [7, 41, 13], [50, 50, 1], [1, 90, 20], [201, 1, 1], [21, 22, 23]];
    let spacings = [[1.0; 3], [0.7, 0.7, 2.5], [1.0, 1.0, 50.0], [3.0, 0.4, 1.1]];
    let weights = [0.25, 0.05, 2.0, 30.0];
    for case in 0..24_u64 {
        let (dims, spacing) = (dims[case as usize % 6], spacings[case as usize % 4]);
        let k = [1, 2, 3, 4, 5, 7, 11, 16][case as usize % 8];
        let weight = weights[(case / 4) as usize % 4];
        let voxels = noisy(dims, case, 1 + case % 5, [0, 3, 25, 120][(case / 3) as usize % 4]);
        let grid = grid(dims, spacing);
        let bits = |i: usize| u8::from(hash(i as u64 + case) % 10 > 2);
        let mask = Mask::new(grid.clone(), (0..grid.len()).map(bits).collect::<Vec<_>>().into()).unwrap();
        let mask = (case % 3 == 1).then_some(&mask);
        let voxels: Voxels = match case % 4 {
            0 => voxels.iter().map(|v| *v as u8).collect::<Vec<_>>().into(),
            1 => voxels.into(),
            2 => voxels.iter().map(|v| *v as i16 - 100).collect::<Vec<_>>().into(),
            _ => voxels.iter().map(|v| i32::from(*v) * 3 - 100).collect::<Vec<_>>().into(),
        };
        let (slope, intercept) = [(1.0, 0.0), (-0.5, 1000.0), (2.0, -7.0)][case as usize % 3];
        let volume = Volume::with_scale(grid, voxels, slope, intercept).unwrap();
        assert_plain(&volume, mask, weight, k, case);
    }
}

#[test]
fn labels_are_plain_lloyds_on_floats_with_holes() {
    for case in 0..6_u64 {
        let dims = [19, 18 + case as usize, 21];
        let voxels: Vec<f32> = noisy(dims, case, 3, 30)
            .iter()
            .enumerate()
            .map(|(i, v)| match hash(i as u64 * 7 + case) % 40 {
                0 => f32::NAN,
                1 => f32::INFINITY,
                n => f32::from(*v) / 8.0 + n as f32 / 1024.0,
            })
            .collect();
        let volume = Volume::new(grid(dims, [0.5, 1.0, 1.5]), voxels.into()).unwrap();
        assert_plain(&volume, None, 0.1 * (1 + case) as f64, 2 + case as usize, case);
    }
}

#[test]
fn bricks_of_one_value_are_plain_lloyds() {
    let dims = [66, 48, 49];
    let block = |i: usize| [i % 66 / 20, i / 66 % 48 / 16, i / (66 * 48) / 33];
    let voxels: Vec<i16> =
        (0..66 * 48 * 49).map(|i| block(i).iter().sum::<usize>() as i16 * 30 - 50).collect();
    let volume = Volume::new(grid(dims, [1.0; 3]), voxels.into()).unwrap();
    for (k, weight) in [(2, 0.1), (4, 1.0), (9, 5.0)] {
        assert_plain(&volume, None, weight, k, 7);
    }
}

#[test]
fn ties_go_to_the_first_centroid_and_are_counted() {
    // A constant row: two centroids at its ends are equally far from the middle voxel.
    let volume = Volume::new(grid([5, 1, 1], [2.0; 3]), vec![7_u8; 5].into()).unwrap();
    for (start, expected) in [([0.0, 8.0], [3, 2]), ([8.0, 0.0], [3, 2])] {
        let start = Some(start.map(|x| [x, 0.0, 0.0, 7.0]).to_vec());
        let of = found(&volume, None, &KmvsParams { start, max_iterations: 1, ..params(2, 1.0) });
        let sizes: Vec<u64> = of.segmentation.labels.classes().iter().map(|c| c.voxels).collect();
        assert_eq!(sizes, expected);
    }
    // A checkerboard and a ramp, where ties are everywhere.
    let dims = [17, 18, 19];
    let board: Vec<u8> =
        (0..17 * 18 * 19).map(|i| ((i % 17 + i / 17 % 18 + i / 306) % 2 * 50) as u8).collect();
    let ramp: Vec<u8> = (0..17 * 18 * 19).map(|i| (i % 17 * 8) as u8).collect();
    for voxels in [board, ramp] {
        let volume = Volume::new(grid(dims, [1.0; 3]), voxels.into()).unwrap();
        for k in [2, 4, 8] {
            assert_plain(&volume, None, 1.0, k, k as u64);
        }
    }
}

#[test]
fn empty_clusters_begin_anew_at_the_farthest_voxel() {
    let dims = [40, 30, 20];
    let volume = Volume::new(grid(dims, [1.0, 2.0, 3.0]), noisy(dims, 5, 4, 9).into()).unwrap();
    let mut start = vec![[10.0, 10.0, 10.0, 60.0]; 5];
    start.push([1e9, 1e9, -1e9, 1e9]);
    let plain = plain::lloyd(&volume, None, 0.5, &start, 300);
    assert!(plain.reseeded >= 5);
    let params = KmvsParams { start: Some(start), ..params(6, 0.5) };
    let fast = found(&volume, None, &params);
    assert_eq!(fast.segmentation.labels.ids(), renumbered(&volume, &plain));
    assert_eq!((fast.reseeded, fast.segmentation.k), (plain.reseeded, 6));
}

#[test]
fn two_blocks_of_equal_value_come_apart_by_place() {
    let dims = [64, 16, 16];
    let voxels: Vec<u8> =
        (0..64 * 256_u64).map(|i| if (i % 64).abs_diff(32) > 16 { 200 } else { 50 }).collect();
    let volume = Volume::new(grid(dims, [1.0; 3]), voxels.into()).unwrap();
    let start = [[10.0, 8.0, 8.0, 200.0], [30.0, 8.0, 8.0, 50.0], [50.0, 8.0, 8.0, 200.0]];
    let of = found(&volume, None, &KmvsParams { start: Some(start.to_vec()), ..params(3, 3.0) });
    let class = |x: usize| of.segmentation.labels.ids()[x];
    assert_eq!(of.segmentation.k, 3);
    assert!(class(0) != class(63) && class(32) == 1 && class(20) == 1, "{:?}", of.centroids);
    // Columns 0…15 and 49…63 hold the bright value.
    let mut at: Vec<f64> = of.centroids.iter().map(|c| c[0]).collect();
    at.sort_by(f64::total_cmp);
    assert_eq!(at, [7.5, 32.0, 56.0]);
    assert!(of.segmentation.converged && of.ties == 0);
    // Intensity alone can't tell the blocks apart.
    assert_eq!(super::super::kmvs(&volume, None, &params(3, 0.0), &Exec::default()).unwrap().k, 2);
}

#[test]
fn threads_and_storage_types_give_the_same_bytes() {
    let dims = [45, 38, 51];
    let values = noisy(dims, 11, 4, 60);
    let grid = grid(dims, [0.9, 0.9, 1.7]);
    let types: [Voxels; 6] = [
        values.iter().map(|v| *v as u8).collect::<Vec<_>>().into(),
        values.clone().into(),
        values.iter().map(|v| *v as i16).collect::<Vec<_>>().into(),
        values.iter().map(|v| i32::from(*v)).collect::<Vec<_>>().into(),
        values.iter().map(|v| f32::from(*v)).collect::<Vec<_>>().into(),
        values.iter().map(|v| f64::from(*v)).collect::<Vec<_>>().into(),
    ];
    let params = params(6, 0.4);
    let reference = found(&Volume::new(grid.clone(), types[0].clone()).unwrap(), None, &params);
    assert!(reference.segmentation.k == 6 && reference.segmentation.converged);
    for voxels in types {
        let volume = Volume::new(grid.clone(), voxels).unwrap();
        for threads in [1, 2, 3, 8] {
            let exec = Exec::default().with_threads(threads);
            let of = kmvs_spatial(&volume, None, &params, &exec).unwrap();
            assert_eq!(of, reference, "{:?}, {threads} threads", volume.voxel_type());
        }
    }
}

#[test]
fn a_power_of_two_in_the_scale_changes_no_label() {
    let dims = [30, 31, 32];
    let values = noisy(dims, 3, 3, 40);
    let at = |scale: f64, spacing: f64| {
        let grid = grid(dims, [spacing, spacing, 2.0 * spacing]);
        let volume = Volume::with_scale(grid, values.clone().into(), scale, 0.0).unwrap();
        found(&volume, None, &params(5, 0.5 * scale / spacing))
    };
    let reference = at(1.0, 1.0);
    for (scale, spacing) in [(4.0, 1.0), (1.0, 0.125), (2.0_f64.powi(-300), 1024.0), (2.0_f64.powi(300), 1.0)]
    {
        let of = at(scale, spacing);
        assert_eq!(of.segmentation.labels.ids(), reference.segmentation.labels.ids(), "{scale} {spacing}");
    }
}

/// What must hold of every result.
fn assert_sound(volume: &Volume, mask: Option<&Mask>, of: &SpatialKmvs) {
    let found = &of.segmentation;
    let classes = found.labels.classes();
    assert_eq!((found.k, found.k), (classes.len(), of.centroids.len()));
    let mut counts = vec![0; found.k + 1];
    for (i, id) in found.labels.ids().iter().enumerate() {
        counts[usize::from(*id)] += 1_u64;
        let counts = volume.voxels().get(i).is_finite() && mask.is_none_or(|m| m.inside()[i] != 0);
        assert_eq!(*id > 0, counts);
    }
    for (class, count) in classes.iter().zip(&counts[1..]) {
        assert!(class.voxels == *count && *count > 0);
        assert!(class.mean.is_finite() && class.sd.is_finite() && class.sd >= 0.0, "{class:?}");
        assert!(class.lower.is_none_or(f64::is_finite) && class.upper.is_none_or(f64::is_finite));
    }
    assert!(classes.windows(2).all(|w| w[0].mean <= w[1].mean));
    assert!(of.centroids.iter().flatten().all(|v| v.is_finite()), "{:?}", of.centroids);
    assert!(found.objective.is_finite() && found.gap.is_finite() && found.objective >= 0.0);
    assert!((0.0..=1.0).contains(&found.visited_fraction));
}

#[test]
fn awkward_volumes_survive() {
    let n = 12 * 13 * 14;
    let pick = |values: &[f64]| -> Vec<f64> {
        (0..n).map(|i| values[(hash(i as u64) % values.len() as u64) as usize]).collect()
    };
    let air: Vec<f64> = (0..n).map(|i| if i % 20 == 0 { 300.0 + (i % 7) as f64 } else { 0.0 }).collect();
    let offset: Vec<f64> = (0..n).map(|i| 1e7 + (hash(i as u64) % 5) as f64).collect();
    let cases: Vec<Vec<f64>> = vec![
        vec![5.5; n],
        vec![f64::NAN; n],
        pick(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0, 2.0]),
        pick(&[1e-310, 3e-310, 0.0]),
        pick(&[f64::MIN, f64::MAX, 0.0]),
        pick(&[-2000.0, 30.0, 40.0, 50.0]),
        pick(&[65535.0, 16.0, 32.0, 48.0]),
        air,
        offset,
    ];
    for (case, values) in cases.into_iter().enumerate() {
        for (spacing, weight) in [([1.0; 3], 0.5), ([1.0, 1.0, 50.0], 1e-6), ([1e-6, 1e6, 1.0], 1e6)] {
            for k in [1, 3, 16] {
                let grid = grid([12, 13, 14], spacing);
                let volume = Volume::new(grid, values.clone().into()).unwrap();
                let of = found(&volume, None, &params(k, weight));
                assert_sound(&volume, None, &of);
                assert!(of.segmentation.k <= k, "case {case}");
            }
        }
    }
    for dims in [[1, 1, 1], [2, 1, 1], [1, 40, 50], [1, 1, 5000]] {
        let volume = Volume::new(grid(dims, [1.0; 3]), noisy(dims, 1, 2, 3).into()).unwrap();
        let of = found(&volume, None, &params(4, 0.1));
        assert_sound(&volume, None, &of);
        assert_eq!(of.segmentation.k, 4.min(volume.grid().len()));
    }
}

#[test]
fn nothing_inside_the_mask_is_no_class_and_a_range_leaves_the_rest_out() {
    let dims = [9, 8, 7];
    let grid = grid(dims, [1.0; 3]);
    let volume = Volume::new(grid.clone(), noisy(dims, 1, 3, 9).into()).unwrap();
    let none = Mask::new(grid, vec![0; 9 * 8 * 7].into()).unwrap();
    let of = found(&volume, Some(&none), &params(3, 1.0));
    assert_eq!((of.segmentation.k, of.centroids.len()), (0, 0));
    assert!(of.segmentation.labels.ids().iter().all(|id| *id == 0));
    let of = found(&volume, None, &KmvsParams { within: Within::range(40.0, 60.0), ..params(2, 1.0) });
    for (i, id) in of.segmentation.labels.ids().iter().enumerate() {
        assert_eq!(*id > 0, (40.0..=60.0).contains(&volume.voxels().get(i)));
    }
}

#[test]
fn bad_parameters_are_named() {
    let field = |params: KmvsParams| params.check().unwrap_err().field;
    assert_eq!(field(params(2, f64::NAN)), "spatial_weight");
    assert_eq!(field(params(2, -1.0)), "spatial_weight");
    assert_eq!(field(KmvsParams { tolerance: 2.0, ..params(2, 1.0) }), "tolerance");
    assert_eq!(field(KmvsParams { max_iterations: 0, ..params(2, 1.0) }), "max_iterations");
    assert_eq!(field(KmvsParams { start: Some(vec![[0.0; 4]]), ..params(2, 1.0) }), "start");
    assert_eq!(field(KmvsParams { start: Some(vec![[f64::NAN; 4]; 2]), ..params(2, 1.0) }), "start");
}

#[test]
fn a_tolerance_stops_early_and_a_cancelled_run_stops_at_once() {
    let dims = [40, 40, 40];
    let volume = Volume::new(grid(dims, [1.0; 3]), noisy(dims, 2, 3, 90).into()).unwrap();
    let full = found(&volume, None, &params(6, 0.5));
    let early = found(&volume, None, &KmvsParams { tolerance: 1e-2, ..params(6, 0.5) });
    assert!(early.segmentation.converged && early.segmentation.iterations < full.segmentation.iterations);
    assert!(early.segmentation.objective >= full.segmentation.objective);
    let cut = found(&volume, None, &KmvsParams { max_iterations: 2, ..params(6, 0.5) });
    assert!(!cut.segmentation.converged && cut.segmentation.iterations == 2);
    let exec = Exec::default();
    exec.cancel.cancel();
    assert!(kmvs_spatial(&volume, None, &params(6, 0.5), &exec).is_err());
}

#[test]
fn a_volume_of_a_few_values_is_plain_lloyds() {
    for case in 0..24_u64 {
        let roll = |i: u64, below: u64| noise::below(case, i, below);
        let dims = [0, 1, 2].map(|axis| 1 + roll(axis, 11) as usize);
        let values: Vec<u8> = (0..=roll(3, 8)).map(|i| roll(10 + i, 20) as u8).collect();
        let (k, seed) = (1 + roll(4, 6) as usize, roll(5, 1000));
        let weight = 0.01 + 3.99 * noise::unit(case, 6);
        let n = dims.iter().product::<usize>() as u64;
        let voxels: Vec<u8> =
            (0..n).map(|i| values[(hash(i + seed) % values.len() as u64) as usize]).collect();
        let volume = Volume::new(grid(dims, [1.0, 0.5, 3.0]), voxels.into()).unwrap();
        assert_plain(&volume, None, weight, k, seed);
    }
}
