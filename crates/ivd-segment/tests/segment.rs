//! Segmentation through its public interface: brute force, invariants, awkward volumes.
// The helpers of these tests may unwrap as the tests do.
#![allow(clippy::unwrap_used)]

use ivd_core::noise::below;
use ivd_core::{Classified, ErrorClass, Exec, Grid, Mask, Volume, Voxels, with_voxels};
use ivd_segment::{KmvsParams, Segmentation, ThresholdParams, kmvs, threshold};

fn line(voxels: impl Into<Voxels>) -> Volume {
    let voxels = voxels.into();
    Volume::new(Grid::with_spacing([voxels.len(), 1, 1], [1.0; 3]).unwrap(), voxels).unwrap()
}

fn classes(volume: &Volume, k: usize) -> Segmentation {
    kmvs(volume, None, &KmvsParams { k, ..KmvsParams::default() }, &Exec::default()).unwrap()
}

/// Inertia of labels, summed directly from the voxels.
fn inertia(volume: &Volume, found: &Segmentation) -> f64 {
    let mut total = 0.0;
    for class in found.labels.classes() {
        let of = (0..volume.grid().len()).filter(|&i| found.labels.ids()[i] == class.id);
        let values: Vec<f64> = of.map(|i| volume.real(volume.voxels().get(i))).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!((mean - class.mean).abs() <= 1e-12 * mean.abs().max(1.0), "{mean} for {class:?}");
        assert_eq!(values.len() as u64, class.voxels);
        let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        assert!(((squares / values.len() as f64).sqrt() - class.sd).abs() <= 1e-6 * class.sd.max(1e-6));
        total += squares;
    }
    total
}

/// What must hold of every segmentation: label = c exactly where lower ≤ v < upper, classes ascend, counts add up.
fn assert_consistent(volume: &Volume, found: &Segmentation) {
    assert_eq!(found.k, found.labels.classes().len());
    assert!(found.labels.classes().windows(2).all(|w| w[0].mean < w[1].mean && w[0].id < w[1].id));
    let mut counted = 0;
    for (i, &id) in found.labels.ids().iter().enumerate() {
        let v = volume.real(volume.voxels().get(i));
        let Some(class) = found.labels.class(id) else {
            assert!(id == 0 && !v.is_finite(), "voxel {i} = {v} has label {id}");
            continue;
        };
        counted += 1;
        assert!(class.lower.is_none_or(|l| l <= v) && class.upper.is_none_or(|u| v < u), "{v} in {class:?}");
    }
    assert_eq!(counted, found.labels.classes().iter().map(|c| c.voxels).sum::<u64>());
    for class in found.labels.classes() {
        assert!(class.mean.is_finite() && class.sd.is_finite() && class.sd >= 0.0, "{class:?}");
    }
    assert!(found.objective.is_finite() && found.gap >= 0.0);
}

/// Least inertia of sorted values over every partition into at most `k` runs.
fn brute_force(values: &[f64], k: usize) -> f64 {
    let direct = |part: &[f64]| {
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        part.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
    };
    if k == 1 || values.len() == 1 {
        return direct(values);
    }
    (1..values.len())
        .map(|c| direct(&values[..c]) + brute_force(&values[c..], k - 1))
        .fold(direct(values), f64::min)
}

fn assert_optimal(volume: &Volume, k: usize) {
    let found = classes(volume, k);
    assert_consistent(volume, &found);
    let mut values: Vec<f64> =
        (0..volume.grid().len()).map(|i| volume.real(volume.voxels().get(i))).collect();
    values.sort_by(f64::total_cmp);
    let best = brute_force(&values, k);
    let tolerance = 1e-11 * best.max(1.0);
    assert!((found.objective - best).abs() <= tolerance, "{} for {best} of {values:?}", found.objective);
    assert!((inertia(volume, &found) - best).abs() <= tolerance, "{values:?}");
    assert_eq!(found.gap, 0.0);
}

#[test]
fn small_volumes_of_every_type_reach_the_optimum() {
    for case in 0..64 {
        let values: Vec<u8> = (0..=below(case, 0, 10)).map(|i| below(case, 10 + i, 60) as u8).collect();
        let (k, scale) = (1 + below(case, 1, 4) as usize, [-2.5, 1.0, 0.1][below(case, 2, 3) as usize]);
        let grid = Grid::with_spacing([values.len(), 1, 1], [1.0; 3]).unwrap();
        let each = |f: fn(u8) -> f64| values.iter().map(|&v| f(v)).collect::<Vec<f64>>();
        let all: [Voxels; 8] = [
            values.clone().into(),
            each(|v| f64::from(v) - 30.0).iter().map(|&v| v as i8).collect::<Vec<_>>().into(),
            each(|v| f64::from(v) * 1000.0).iter().map(|&v| v as u16).collect::<Vec<_>>().into(),
            each(|v| f64::from(v) * 900.0 - 30000.0).iter().map(|&v| v as i16).collect::<Vec<_>>().into(),
            each(|v| f64::from(v) * 1e4).iter().map(|&v| v as u32).collect::<Vec<_>>().into(),
            each(|v| f64::from(v) * 1e4 - 3e5).iter().map(|&v| v as i32).collect::<Vec<_>>().into(),
            each(|v| f64::from(v) / 7.0).iter().map(|&v| v as f32).collect::<Vec<_>>().into(),
            each(|v| f64::from(v) / 7.0).into(),
        ];
        for voxels in all {
            let volume = Volume::with_scale(grid.clone(), voxels, scale, 3.0).unwrap();
            assert_optimal(&volume, k);
        }
    }
}

#[test]
fn more_classes_than_values_give_a_class_a_value() {
    for volume in [line(vec![5_u8, 9, 5, 5]), line(vec![5.0_f32, 9.0, 5.0, 5.0])] {
        let found = classes(&volume, 4);
        assert_eq!((found.k, found.objective), (2, 0.0));
        assert_eq!(found.labels.ids(), [1, 2, 1, 1]);
        assert_eq!(found.labels.classes()[0].upper, Some(7.0));
        assert_consistent(&volume, &found);
    }
}

#[test]
fn constant_volumes_have_one_class_and_empty_ones_none() {
    for volume in [line(vec![7_u16; 30]), line(vec![0.1_f32; 30]), line(vec![-1e-310_f64; 30])] {
        let found = classes(&volume, 3);
        assert_eq!((found.k, found.objective, found.labels.classes()[0].sd), (1, 0.0, 0.0));
        assert_eq!(found.labels.classes()[0].mean, volume.voxels().get(0));
        assert_consistent(&volume, &found);
    }
    let empty = line(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
    let found = classes(&empty, 3);
    assert_eq!((found.k, found.labels.ids()), (0, &[0, 0, 0][..]));
    let found = threshold(&empty, None, &ThresholdParams { values: vec![1.0] }, &Exec::default()).unwrap();
    assert_eq!((found.k, found.labels.ids()), (0, &[0, 0, 0][..]));
}

#[test]
fn missing_voxels_and_outliers_do_not_move_the_classes() {
    let mut voxels: Vec<f32> =
        (0..20_000).map(|i| (i * 7919 % 1000) as f32 / 1000.0 + (i % 2 * 10) as f32).collect();
    let clean = classes(&line(voxels.clone()), 2);
    voxels.extend([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
    let volume = line(voxels.clone());
    let found = classes(&volume, 2);
    assert_eq!(found.labels.classes(), clean.labels.classes());
    assert_eq!(found.labels.ids()[20_000..], [0, 0, 0]);
    voxels.push(1e30);
    let volume = line(voxels);
    let found = classes(&volume, 3);
    assert_consistent(&volume, &found);
    assert_eq!(found.labels.classes().iter().map(|c| c.voxels).collect::<Vec<_>>(), [10_000, 10_000, 1]);
}

#[test]
fn padding_values_and_gaps_are_values_like_others() {
    let volume = line([vec![-2000_i16; 50], vec![0; 20], vec![16; 20], vec![32767; 3]].concat());
    let found = classes(&volume, 3);
    assert_consistent(&volume, &found);
    assert_eq!(found.labels.classes()[2].voxels, 3);
    let board: Vec<u8> = (0..4096).map(|i| (i & 1) as u8 * 255).collect();
    assert_consistent(&line(board.clone()), &classes(&line(board), 2));
}

#[test]
fn negative_slope_turns_the_order_of_stored_values_round() {
    let grid = Grid::with_spacing([4, 1, 1], [1.0; 3]).unwrap();
    let volume = Volume::with_scale(grid, vec![0_u8, 1, 200, 201].into(), -1.0, 100.0).unwrap();
    let found = classes(&volume, 2);
    assert_eq!(found.labels.ids(), [2, 2, 1, 1]);
    assert_consistent(&volume, &found);
    let cut =
        threshold(&volume, None, &ThresholdParams { values: vec![-100.0, 99.0] }, &Exec::default()).unwrap();
    assert_eq!(cut.labels.ids(), [3, 3, 2, 1], "a value on a threshold belongs above");
    assert_consistent(&volume, &cut);
}

#[test]
fn outside_the_mask_is_label_0_and_does_not_count() {
    let mask_values = vec![1, 1, 0, 1, 0];
    for volume in [line(vec![1_u8, 2, 200, 90, 201]), line(vec![1.0_f32, 2.0, 200.0, 90.0, 201.0])] {
        let mask = Mask::new(volume.grid().clone(), mask_values.clone().into()).unwrap();
        let found =
            kmvs(&volume, Some(&mask), &KmvsParams { k: 2, ..KmvsParams::default() }, &Exec::default())
                .unwrap();
        assert_eq!(found.labels.ids(), [1, 1, 0, 2, 0]);
        assert_eq!(found.visited_fraction, 0.6);
        let cut = threshold(&volume, Some(&mask), &ThresholdParams { values: vec![50.0] }, &Exec::default())
            .unwrap();
        assert_eq!(cut.labels.ids(), [1, 1, 0, 2, 0]);
        assert_eq!(cut.labels.classes()[0].mean, 1.5);
    }
    let other = Mask::new(Grid::with_spacing([5, 1, 1], [2.0; 3]).unwrap(), vec![1; 5].into()).unwrap();
    let error =
        kmvs(&line(vec![0_u8; 5]), Some(&other), &KmvsParams::default(), &Exec::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Usage);
}

#[test]
fn thresholds_through_the_histogram_and_voxel_by_voxel_agree() {
    let stored: Vec<i16> = (0..5000).map(|i| (i * 7919 % 4001 - 2000) as i16).collect();
    let wide: Vec<f64> = stored.iter().map(|&v| f64::from(v)).collect();
    let grid = Grid::with_spacing([50, 10, 10], [0.4, 1.0, 6.5]).unwrap();
    for slope in [0.1, -0.3] {
        let params = ThresholdParams { values: vec![-150.0, -0.1, 0.3, 77.7, 1e9] };
        let narrow = Volume::with_scale(grid.clone(), stored.clone().into(), slope, 0.05).unwrap();
        let broad = Volume::with_scale(grid.clone(), wide.clone().into(), slope, 0.05).unwrap();
        let a = threshold(&narrow, None, &params, &Exec::default()).unwrap();
        let b = threshold(&broad, None, &params, &Exec::default()).unwrap();
        assert_eq!(a.labels.ids(), b.labels.ids());
        assert_consistent(&narrow, &a);
        assert_consistent(&broad, &b);
        assert!((a.objective / b.objective - 1.0).abs() < 1e-12);
        assert!(a.labels.class(6).is_none(), "an interval without voxels isn't listed");
    }
}

#[test]
fn no_thresholds_split_in_two_at_least_inertia() {
    let volume = line(vec![1_u8, 2, 3, 40, 50]);
    let split = threshold(&volume, None, &ThresholdParams::default(), &Exec::default()).unwrap();
    assert_eq!(split.labels.ids(), [1, 1, 1, 2, 2]);
}

#[test]
fn threads_do_not_change_a_byte() {
    let voxels: Vec<f32> = (0..300_000_u64).map(|i| (i.wrapping_mul(2_654_435_761) >> 8) as f32).collect();
    let narrow: Vec<u16> = voxels.iter().map(|&v| (v as u64 % 3000) as u16).collect();
    for volume in [line(voxels), line(narrow)] {
        let with = |threads| {
            kmvs(
                &volume,
                None,
                &KmvsParams { k: 5, ..KmvsParams::default() },
                &Exec::default().with_threads(threads),
            )
            .unwrap()
        };
        assert_eq!(with(1), with(3));
        let params = ThresholdParams { values: vec![100.0, 1000.0] };
        let with =
            |threads| threshold(&volume, None, &params, &Exec::default().with_threads(threads)).unwrap();
        assert_eq!(with(1), with(3));
    }
}

#[test]
fn bad_parameters_name_their_field_and_limits_stop_the_work() {
    let volume = line(vec![1.0_f32; 1000]);
    let error =
        kmvs(&volume, None, &KmvsParams { k: 0, ..KmvsParams::default() }, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("`k`") && error.error_class() == ErrorClass::Usage);
    for values in [vec![2.0, 1.0], vec![1.0, 1.0], vec![f64::NAN]] {
        let error = threshold(&volume, None, &ThresholdParams { values }, &Exec::default()).unwrap_err();
        assert!(error.to_string().contains("`values`"));
    }
    let tight = Exec::default().with_memory_limit(Some(10));
    assert_eq!(
        kmvs(&volume, None, &KmvsParams::default(), &tight).unwrap_err().error_class(),
        ErrorClass::Limit
    );
    let stopped = Exec::default();
    stopped.cancel.cancel();
    assert_eq!(
        kmvs(&volume, None, &KmvsParams::default(), &stopped).unwrap_err().error_class(),
        ErrorClass::Cancelled
    );
}

#[test]
fn real_values_are_what_the_voxels_say() {
    let volume = line(vec![3_u8, 4]);
    assert_eq!(with_voxels!(volume.voxels(), s => s.len()), 2);
    assert_eq!(inertia(&volume, &classes(&volume, 1)), 0.5);
}
