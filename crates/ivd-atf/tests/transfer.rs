//! The transfer function of small volumes whose answer is known.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use ivd_atf::{Error, OpacityRule, Palette, Params, ValueScale, transfer};
use ivd_core::{Class, Classified, ErrorClass, Exec, Grid, Labels, Modality, Volume, Voxels};

/// A volume of 24³ voxels with `value` and `label` by voxel index.
fn scene(value: impl Fn([usize; 3]) -> f32, label: impl Fn([usize; 3]) -> u16) -> (Volume, Labels) {
    let grid = Grid::with_spacing([24; 3], [1.0, 1.0, 2.0]).unwrap();
    let values: Vec<f32> = (0..grid.len()).map(|i| value(grid.index(i).0)).collect();
    let ids: Vec<u16> = (0..grid.len()).map(|i| label(grid.index(i).0)).collect();
    let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
    (volume, Labels::new(grid, ids.into(), vec![]).unwrap())
}

fn ball(at: [usize; 3], centre: f64, radius: f64) -> bool {
    at.map(|c| (c as f64 - centre).powi(2)).iter().sum::<f64>() < radius * radius
}

fn ripple(at: [usize; 3]) -> f32 {
    ((at[0] * 7 + at[1] * 13 + at[2] * 29) % 11) as f32 - 5.0
}

#[test]
fn two_classes_give_clear_air_and_a_visible_ball() {
    let inside = |at| ball(at, 12.0, 6.0);
    let (volume, labels) =
        scene(|at| if inside(at) { 150.0 } else { 20.0 } + ripple(at), |at| if inside(at) { 2 } else { 1 });
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    let tf = &built.transfer;
    assert_eq!((built.figures.entries, tf.classes()), (2, &[0, 1, 2][..]));
    let figures = &built.figures;
    assert_eq!((&figures.background[..], figures.transitions.len()), (&[1][..], 0));
    assert!(figures.opacity_range[0] == 0.0 && figures.opacity_range[1] > 0.2);
    assert!(figures.visibility[0].class == 2 && figures.visibility[0].visibility > 0.999);
    assert!(figures.background_opacity.unwrap() < 0.02, "{figures:?}");
    assert!(figures.silhouette_difference.unwrap() < 0.05, "{figures:?}");
    assert_eq!(tf.sample(0, 20.0)[3], 0.0, "air");
    assert_eq!(tf.sample(0, 150.0)[3], figures.opacity_range[1], "the ball without labels");
    // Values tell the two apart, so that a label has nothing to say.
    assert!((1..3).all(|row| tf.table()[1024 * row..][..1024] == tf.table()[..1024]));
    // Equal spreads, air is larger: the crossing leans towards the ball.
    assert!(tf.entries()[0].upper > 85.0 && tf.entries()[0].upper < 90.0);
    assert_eq!(tf.entries()[0].upper, tf.entries()[1].lower);
    // 24 * 24 * 48 mm³.
    assert!((tf.reference_mm() - (24.0_f64 * 24.0 * 48.0).cbrt() / 128.0).abs() < 1e-12);
}

#[test]
fn classes_of_equal_mean_keep_rows_of_their_own() {
    // Two balls of the same value and different size.
    let label = |at| {
        if ball(at, 5.0, 3.0) {
            7
        } else if ball(at, 15.0, 6.0) {
            3
        } else {
            1
        }
    };
    let (volume, labels) = scene(|at| if label(at) == 1 { 0.0 } else { 100.0 }, label);
    let border = Params { opacity: OpacityRule::Border, max_opacity: 0.6, ..Params::default() };
    let tf = transfer(&volume, &labels, &border, &Exec::default()).unwrap().transfer;
    let (small, large) = (tf.sample(tf.row(7), 100.0), tf.sample(tf.row(3), 100.0));
    assert_ne!(small[..3], large[..3], "different hues");
    assert!(small[3] > large[3] && large[3] > 0.0, "the smaller one is denser: {small:?} {large:?}");
    let union = tf.sample(0, 100.0);
    assert!(union[3] > large[3].min(small[3]) * 0.99 && union[3] < small[3], "the union lies between");
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    let seen: Vec<_> = built.figures.visibility.iter().map(|seen| (seen.class, seen.visibility)).collect();
    assert!(matches!(seen[..], [(3, _), (7, _)]) && seen.iter().all(|(_, share)| *share > 0.1), "{seen:?}");
    assert!(built.figures.divergence.unwrap() < 0.01, "{:?}", built.figures);
}

#[test]
fn a_constant_volume_of_one_class_is_seen() {
    let (volume, labels) = scene(|_| 42.0, |_| 1);
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    assert_eq!(built.figures.entries, 1);
    assert_eq!(built.transfer.range(), [42.0, 42.0]);
    for row in 0..2 {
        assert!(built.transfer.sample(row, 42.0)[3] > 0.05, "{:?}", built.figures);
    }
    assert!(built.figures.background.is_empty(), "something is always to be seen");
}

#[test]
fn volumes_without_any_data_give_a_clear_table() {
    let (volume, labels) = scene(|_| f32::NAN, |_| 0);
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    assert_eq!((built.figures.entries, built.figures.opacity_range), (0, [0.0, 0.0]));
    assert_eq!(built.transfer.sample(0, 0.0)[3], 0.0);
}

#[test]
fn foreign_labels_over_a_background_need_no_classes_and_leave_the_background_clear() {
    // An organ of value 60 in tissue of value 40: nothing else is labelled.
    let organ = |at| ball(at, 10.0, 5.0);
    let (volume, labels) =
        scene(|at| if organ(at) { 60.0 } else { 40.0 } + 0.2 * ripple(at), |at| u16::from(organ(at)) * 117);
    let tf = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap().transfer;
    assert_eq!(tf.classes(), [0, 117]);
    assert!(tf.sample(tf.row(117), 60.0)[3] > 0.1);
    assert!(tf.sample(0, 60.0)[3] > 0.1);
    assert_eq!(tf.sample(0, 40.0)[3], 0.0);
}

#[test]
fn given_crossings_serve_where_posteriors_have_none() {
    // A tiny class beside a huge one with wide spread: the posterior never crosses between the means.
    let rare = |at: [usize; 3]| at == [12, 12, 12];
    let (volume, unnamed) =
        scene(|at| if rare(at) { 40.0 } else { 4.0 * ripple(at) }, |at| if rare(at) { 2 } else { 1 });
    let class = |id, lower, upper| Class { id, name: None, mean: 0.0, sd: 0.0, voxels: 0, lower, upper };
    let classes = vec![class(1, None, Some(33.0)), class(2, Some(33.0), None)];
    let labels = Labels::new(volume.grid().clone(), unnamed.buffer().clone(), classes).unwrap();
    let tf = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap().transfer;
    let edge = tf.entries()[1].lower;
    assert!(edge > 20.0 && edge < 40.0, "{edge}");
}

#[test]
fn opacities_stay_in_0_to_1_whatever_the_parameters() {
    let (volume, labels) = scene(|at| (at[0] * at[1]) as f32 * 1e-3 + 1e7, |at| (at[0] / 3) as u16 + 1);
    for max_opacity in [0.0, 0.3, 1.0] {
        for size_exponent in [0.0, 1.0, 30.0] {
            let params = Params {
                max_opacity,
                min_opacity: 0.0,
                size_exponent,
                softness: 3.0,
                resolution: 17,
                ..Params::default()
            };
            let built = transfer(&volume, &labels, &params, &Exec::default()).unwrap();
            let table = built.transfer.table();
            assert!(table.iter().all(|c| (0.0..=max_opacity as f32 + 1e-6).contains(&c[3])));
            assert!(
                built.figures.opacity_range[0] >= 0.0 && built.figures.opacity_range[1] <= max_opacity as f32
            );
        }
    }
}

#[test]
fn gas_is_clear_in_hounsfield_units_though_the_body_fills_the_volume() {
    // Tissue of 40 at every side, a lung of -850 and a bone of 900 inside.
    let value = |at: [usize; 3]| {
        if ball(at, 8.0, 5.0) {
            -950.0
        } else if ball(at, 17.0, 4.0) {
            900.0
        } else {
            40.0
        }
    };
    let label = |at| [950.0, 40.0, 900.0].iter().position(|v| f32::abs(value(at)) == *v).unwrap() as u16 + 1;
    let (volume, labels) = scene(|at| value(at) + ripple(at), label);
    let of = |params| transfer(&volume, &labels, &params, &Exec::default()).unwrap();
    let built = of(Params::default());
    assert!(built.figures.hounsfield && built.figures.palette == Palette::Tissue);
    assert_eq!(built.figures.background, [1]);
    let tf = &built.transfer;
    assert_eq!(tf.sample(0, -950.0)[3], 0.0);
    assert!(tf.sample(0, 40.0)[3] > 0.0 && tf.sample(0, 900.0)[3] > tf.sample(0, 40.0)[3]);
    let [r, g, b, _] = tf.sample(0, 40.0);
    assert!(r > 2.0 * g && r > 2.0 * b, "muscle is red");
    let plain = of(Params { values: ValueScale::Plain, ..Params::default() });
    assert!(!plain.figures.hounsfield && plain.figures.palette == Palette::Safe);
    assert!(plain.figures.background.contains(&2), "without a meaning, what lies outside is background");
}

#[test]
fn magnetic_resonance_looks_like_tissue_where_its_file_says_so() {
    let inside = |at| ball(at, 12.0, 6.0);
    // Values as some scanners write them, which reach as far as Hounsfield's.
    let (volume, labels) =
        scene(|at| if inside(at) { 700.0 } else { -950.0 } + ripple(at), |at| if inside(at) { 2 } else { 1 });
    let of = |modality| {
        let volume = volume.clone().with_modality(modality);
        transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap().figures
    };
    let figures = of(Some(Modality::MagneticResonance));
    assert_eq!((figures.palette, figures.hounsfield), (Palette::Tissue, false));
    assert!(of(None).hounsfield && of(Some(Modality::ComputedTomography)).hounsfield);
    let (volume, labels) = scene(|at| ripple(at) + 6.0, |at| 1 + u16::from(inside(at)));
    let of = |modality| {
        let volume = volume.clone().with_modality(modality);
        transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap().figures.palette
    };
    assert_eq!(of(Some(Modality::MagneticResonance)), Palette::Tissue);
    assert_eq!([of(None), of(Some(Modality::ComputedTomography))], [Palette::Safe; 2]);
}

#[test]
fn a_shell_of_partial_volume_has_no_opacity_and_colour_of_its_own() {
    // A ball whose edge passes through the middle of a layer of voxels.
    let far = |at: [usize; 3]| at.map(|c| (c as f64 - 12.0).powi(2)).iter().sum::<f64>().sqrt();
    let value = |at| {
        if far(at) < 7.0 {
            200.0
        } else if far(at) < 8.0 {
            100.0
        } else {
            0.0
        }
    };
    let (volume, labels) = scene(|at| value(at) + 0.3 * ripple(at), |at| (value(at) / 100.0) as u16 + 1);
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    assert_eq!((&built.figures.background[..], &built.figures.transitions[..]), (&[1][..], &[2][..]));
    let (ball, shell) = (built.transfer.sample(0, 200.0), built.transfer.sample(0, 100.0));
    assert_eq!(ball[..3], shell[..3], "the shell has the ball's colour");
    assert!((shell[3] / ball[3] - 0.5).abs() < 0.05, "half way: {shell:?} {ball:?}");
    assert_eq!(built.figures.visibility.len(), 1);
}

#[test]
fn a_class_keeps_its_colour_when_another_is_split() {
    let part = |at: [usize; 3]| at[2] / 6;
    let value = |at| [0.0, 100.0, 180.0, 220.0][part(at)];
    let colours = |of: &dyn Fn([usize; 3]) -> u16, palette| {
        let (volume, labels) = scene(|at| value(at) + ripple(at), of);
        let params = Params { palette, ..Params::default() };
        transfer(&volume, &labels, &params, &Exec::default()).unwrap().transfer.entries().to_vec()
    };
    let three = |at| [1, 2, 3, 3][part(at)];
    let four = |at| part(at) as u16 + 1;
    for palette in [Palette::Safe, Palette::Tissue, Palette::Thesis] {
        let (few, more) = (colours(&three, palette), colours(&four, palette));
        assert_eq!(few[1].rgb, more[1].rgb, "{palette:?}");
        assert_ne!(more[2].rgb, more[3].rgb);
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let (volume, labels) = scene(|at| ripple(at) * 0.37 + at[2] as f32, |at| (at[2] / 5) as u16 + 1);
    let one = transfer(&volume, &labels, &Params::default(), &Exec::default().with_threads(1)).unwrap();
    let four = transfer(&volume, &labels, &Params::default(), &Exec::default().with_threads(4)).unwrap();
    assert_eq!(one, four);
}

#[test]
fn wrong_inputs_are_refused_by_kind() {
    let (volume, labels) = scene(|_| 1.0, |_| 1);
    let bad = Params { resolution: 0, ..Params::default() };
    let error = transfer(&volume, &labels, &bad, &Exec::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Usage);
    let other = Labels::new(Grid::with_spacing([1; 3], [1.0; 3]).unwrap(), vec![1].into(), vec![]).unwrap();
    assert!(matches!(transfer(&volume, &other, &Params::default(), &Exec::default()), Err(Error::Core(_))));
    let ids: Vec<u16> = (0..24_u16.pow(3)).collect();
    let many = Labels::new(volume.grid().clone(), ids.into(), vec![]).unwrap();
    let error = transfer(&volume, &many, &Params::default(), &Exec::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Limit);
    let cancelled = Exec::default();
    cancelled.cancel.cancel();
    let error = transfer(&volume, &labels, &Params::default(), &cancelled).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Cancelled);
}

#[test]
fn values_whose_squares_overflow_are_refused_with_the_range() {
    let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
    let labels = Labels::new(grid.clone(), vec![1, 2].into(), vec![]).unwrap();
    for values in [vec![f64::MIN, f64::MAX], vec![0.0, 1e200]] {
        let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let (params, exec) = (Params::default(), Exec::default());
        let error = transfer(&volume, &labels, &params, &exec).unwrap_err();
        assert!(
            matches!(error, Error::TooWide { .. }) && error.error_class() == ErrorClass::Limit,
            "{error}"
        );
        assert!(ivd_atf::from_isovalue(&volume, 1.0, &params, &exec).is_err());
    }
}

/// Values and labels on a grid of `dims`, whose label is 2 where `inside` says and 1 elsewhere.
fn slab(dims: [usize; 3], inside: impl Fn([usize; 3]) -> bool) -> (Volume, Labels) {
    let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
    let is_inside = |i: usize| inside(grid.index(i).0);
    let values: Vec<f32> = (0..grid.len()).map(|i| if is_inside(i) { 100.0 } else { 0.0 }).collect();
    let ids: Vec<u16> = (0..grid.len()).map(|i| if is_inside(i) { 2 } else { 1 }).collect();
    (Volume::new(grid.clone(), Voxels::from(values)).unwrap(), Labels::new(grid, ids.into(), vec![]).unwrap())
}

#[test]
fn in_thin_volumes_the_frame_is_the_outside_and_not_every_voxel() {
    // An object that fills most of one slice, or of two, within a frame.
    for layers in [1, 2] {
        let inside = |[x, y, _]: [usize; 3]| (1..31).contains(&x) && (1..31).contains(&y);
        let (volume, labels) = slab([32, 32, layers], inside);
        let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
        assert_eq!(built.figures.background, [1], "{layers} layers");
        assert!(built.transfer.sample(0, 100.0)[3] > 0.1, "{:?}", built.figures);
    }
    // Nothing is outside along axes of one or two voxels.
    for dims in [[1, 1, 1], [2, 2, 2], [1, 2, 1], [1, 1, 40]] {
        let (volume, labels) = slab(dims, |[x, _, z]| x == 0 && z == 0);
        let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
        assert!(built.transfer.sample(0, 100.0)[3] > 0.1, "{dims:?}: {:?}", built.figures);
        assert!(!built.figures.background.contains(&2), "{dims:?}");
    }
}

#[test]
fn a_few_stray_voxels_without_label_change_no_rule() {
    // A ball with a shell of partial volume in air; one voxel of the air has lost its label.
    let far = |at: [usize; 3]| at.map(|c| (c as f64 - 12.0).powi(2)).iter().sum::<f64>().sqrt();
    let value = |at| [200.0, 100.0, 0.0][usize::from(far(at) >= 7.0) + usize::from(far(at) >= 8.0)];
    let label = |at: [usize; 3]| if at == [1, 1, 1] { 0 } else { (value(at) / 100.0) as u16 + 1 };
    let (volume, labels) = scene(|at| value(at) + 0.3 * ripple(at), label);
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    assert_eq!((&built.figures.background[..], &built.figures.transitions[..]), (&[0, 1][..], &[2][..]));
}

#[test]
fn under_a_mask_the_parts_are_materials_and_gas_is_clear_all_the_same() {
    // Outside the mask muscle; inside it a lung and a bone.
    let label = |at| if ball(at, 8.0, 5.0) { 3 } else { u16::from(ball(at, 17.0, 4.0)) * 9 };
    let value = |at| match label(at) {
        3 => -950.0,
        9 => 900.0,
        _ => 40.0,
    };
    let (volume, labels) = scene(|at| value(at) + ripple(at), label);
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    assert_eq!(built.figures.background, [3, 0]);
    assert_eq!((built.transfer.sample(0, -950.0)[3], built.transfer.sample(0, 40.0)[3]), (0.0, 0.0));
    assert!(built.transfer.sample(0, 900.0)[3] > 0.1);
    // Without Hounsfield units the lung is a part like any other.
    let plain = Params { values: ValueScale::Plain, ..Params::default() };
    let built = transfer(&volume, &labels, &plain, &Exec::default()).unwrap();
    assert_eq!(built.figures.background, [0]);
    assert!(built.transfer.sample(built.transfer.row(3), -950.0)[3] > 0.1);
}

#[test]
fn air_alone_is_seen_where_there_is_nothing_else() {
    let inside = |at| ball(at, 12.0, 6.0);
    let (volume, labels) = scene(
        |at| if inside(at) { -920.0 } else { -990.0 } + ripple(at),
        |at| if inside(at) { 2 } else { 1 },
    );
    let params = Params { values: ValueScale::Hounsfield, ..Params::default() };
    let built = transfer(&volume, &labels, &params, &Exec::default()).unwrap();
    assert!(built.figures.background.is_empty() && built.figures.hounsfield);
    assert!(built.transfer.sample(0, -920.0)[3] > 0.0 && built.transfer.sample(0, -990.0)[3] > 0.0);
}

#[test]
fn noise_that_is_split_into_classes_is_all_background_whatever_share_of_them_there_is() {
    // A thin bar in noise: k-means of a few classes or more divides the noise, as the bar is too small to matter to it.
    let grid = Grid::with_spacing([32; 3], [1.0; 3]).unwrap();
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    // Sums of twelve uniform numbers: deviation 1.
    let noise: Vec<f32> = (0..grid.len()).map(|_| (0..12).map(|_| uniform()).sum::<f32>() - 6.0).collect();
    let in_bar = |i: usize| {
        let [x, y, z] = grid.index(i).0;
        (15..18).contains(&x) && (14..17).contains(&y) && (4..28).contains(&z)
    };
    for (classes, sign) in [(2, 1.0), (3, 1.0), (4, 1.0), (6, 1.0), (8, 1.0), (32, 1.0), (4, -1.0), (8, -1.0)]
    {
        // Classes of the noise are 1 deviation wide at most, and evenly round 0.
        let width = 1.0_f32.min(6.0 / (classes - 1) as f32);
        let class = |i: usize| {
            let at = (noise[i] / width + (classes - 1) as f32 / 2.0).clamp(0.0, (classes - 2) as f32);
            if in_bar(i) { classes } else { at as u16 + 1 }
        };
        let values: Vec<f32> =
            (0..grid.len()).map(|i| sign * (noise[i] + if in_bar(i) { 50.0 } else { 0.0 })).collect();
        let ids: Vec<u16> = (0..grid.len()).map(class).collect();
        let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
        let figures = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap().figures;
        let mut background = figures.background.clone();
        background.sort_unstable();
        assert_eq!(background, (1..classes).collect::<Vec<_>>(), "{classes} classes, {sign}: {figures:?}");
        assert!(figures.silhouette_difference.unwrap() < 0.03, "{figures:?}");
    }
}

#[test]
fn a_hot_voxel_leaves_the_table_to_the_rest() {
    let inside = |at| ball(at, 12.0, 6.0);
    let value = |at: [usize; 3]| match at {
        [3, 3, 3] => 1e6,
        _ => (if inside(at) { 1.0 } else { 0.1 }) + 0.01 * ripple(at),
    };
    let label = |at: [usize; 3]| if at == [3, 3, 3] { 3 } else { u16::from(inside(at)) + 1 };
    let (volume, labels) = scene(value, label);
    let built = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap();
    let tf = &built.transfer;
    assert!(tf.range()[0] > -1.0 && tf.range()[1] < 3.0, "{:?}", tf.range());
    assert_eq!(tf.sample(0, 0.1)[3], 0.0);
    assert!(tf.sample(0, 1.0)[3] > 0.1 && tf.sample(0, 1e6)[3] > 0.1);
    assert!(built.figures.visibility[0].visibility > 0.99, "{:?}", built.figures);
}

#[test]
fn a_needle_of_voxels_takes_no_more_rays_than_a_cube_of_them() {
    // One voxel is 10⁴ times as long as wide; and a thin slab of wide voxels, looked through at its own thickness.
    for spacing in [[1.0, 1.0, 1e4], [1e4, 1.0, 1.0], [1.0, 1e-4, 1.0], [5.0, 5.0, 0.1]] {
        let grid = Grid::with_spacing([24, 24, 24], spacing).unwrap();
        let is_inside = |i: usize| ball(grid.index(i).0, 12.0, 6.0);
        let values: Vec<f32> = (0..grid.len()).map(|i| f32::from(u8::from(is_inside(i)))).collect();
        let ids: Vec<u16> = (0..grid.len()).map(|i| u16::from(is_inside(i)) + 1).collect();
        let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
        // Fourteen views of 24² rays of at most 42 samples.
        let exec = Exec::default().with_memory_limit(Some(4 << 20));
        let params = Params { views: 14, ..Params::default() };
        let built = transfer(&volume, &labels, &params, &exec).unwrap();
        assert!(built.figures.divergence.unwrap() < 0.01, "{spacing:?}: {:?}", built.figures);
        assert!(built.figures.visibility[0].coverage > 0.1, "{spacing:?}: {:?}", built.figures);
    }
}

#[test]
fn thin_parts_of_the_outside_are_seen_as_far_as_the_inside_lets_them() {
    // A core in six voxels of rind, which has a brim two voxels thin.
    let within = |at: [usize; 3], from: usize, to: usize| at.iter().all(|c| (from..to).contains(c));
    let in_brim = |[x, y, z]: [usize; 3]| within([x, y, x], 1, 63) && (31..33).contains(&z);
    let label = |at: [usize; 3]| {
        if within(at, 14, 50) {
            3
        } else if within(at, 8, 56) || in_brim(at) {
            2
        } else {
            1
        }
    };
    let grid = Grid::with_spacing([64; 3], [1.0; 3]).unwrap();
    let ids: Vec<u16> = (0..grid.len()).map(|i| label(grid.index(i).0)).collect();
    let values: Vec<f32> = ids.iter().map(|&id| 100.0 * f32::from(id)).collect();
    let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
    let labels = Labels::new(grid, ids.into(), vec![]).unwrap();
    let figures = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap().figures;
    assert!(figures.silhouette_difference.unwrap() < 0.03, "{figures:?}");
    let core = figures.visibility.iter().find(|seen| seen.class == 3).unwrap();
    assert!(core.visibility > 0.05 && figures.divergence.unwrap() < 0.01, "{figures:?}");
}

#[test]
fn a_second_view_looks_along_the_same_rays_from_the_back() {
    // A block whose halves differ, in air; all is as opaque as the other. Seen from its left alone, and from both sides.
    let label = |[x, y, z]: [usize; 3]| match (x, [y, z].iter().all(|c| (4..20).contains(c))) {
        (4..12, true) => 2,
        (12..20, true) => 3,
        _ => 1,
    };
    let (volume, labels) = scene(|at| 100.0 * f32::from(label(at)), label);
    let seen = |views: usize| {
        let params = Params { max_opacity: 0.5, min_opacity: 0.5, views, ..Params::default() };
        let figures = transfer(&volume, &labels, &params, &Exec::default()).unwrap().figures;
        assert_eq!(figures.views, views as u32);
        [0, 1].map(|i| (figures.visibility[i].visibility, figures.visibility[i].coverage))
    };
    let [[(left, covers), (right, _)], [(left_of_both, covers_both), (right_of_both, _)]] =
        [seen(1), seen(2)];
    assert!(left > 0.95 && right < 0.05, "{left} {right}");
    assert!((left_of_both - right_of_both).abs() < 0.02, "{left_of_both} {right_of_both}");
    assert!((covers - covers_both).abs() < 1e-6, "{covers} {covers_both}");
    // A third looks along other rays, from one side.
    let [(third, _), _] = seen(3);
    assert!((third - left_of_both).abs() < 0.05, "{third}");
}

#[test]
fn a_thin_slab_is_looked_through_at_its_own_thickness() {
    // Looked at from its broad side alone, a slab of half a reference length: what is seen there is what its thickness lets through.
    let (volume, labels) = slab([64, 64, 3], |[x, y, _]| (8..56).contains(&x) && (8..56).contains(&y));
    let params = Params { max_opacity: 0.5, min_opacity: 0.5, ..Params::default() };
    let built = transfer(&volume, &labels, &params, &Exec::default()).unwrap();
    let through = |mm: f64| 1.0 - 0.5_f64.powf(mm / built.transfer.reference_mm());
    // Rays that meet matter: from four sides through 48 mm, eight of them over the thickness; from two through 3 mm.
    let (wide, narrow) = (through(48.0), through(3.0));
    let rays = [4.0 * 8.0 * 48.0, 2.0 * 48.0 * 48.0];
    let expected = (rays[0] * wide + rays[1] * narrow) / (rays[0] + rays[1]);
    let found = built.figures.visibility[0].coverage;
    assert!((found - expected).abs() < 0.01, "{found} for {expected}");
}

#[test]
fn many_narrow_classes_with_rows_of_their_own_are_all_met() {
    // 300 classes of a spread far below the distance of even bins, two by two of one value.
    let label = |at: [usize; 3]| {
        let of_row = (at[1] * 24 + at[2]) as u16;
        if of_row < 300 { of_row + 1 } else { 301 }
    };
    let value = |at: [usize; 3]| if label(at) == 301 { 0.0 } else { 10.0 + f32::from(label(at) / 2) };
    let (volume, labels) = scene(value, label);
    let params = Params { values: ValueScale::Plain, ..Params::default() };
    let built = transfer(&volume, &labels, &params, &Exec::default()).unwrap();
    let unmet: Vec<_> = built.figures.visibility.iter().filter(|seen| seen.coverage <= 0.0).collect();
    assert!(unmet.is_empty(), "{} of {}", unmet.len(), built.figures.visibility.len());
}

#[test]
fn the_older_rule_has_no_figures_of_visibility() {
    let inside = |at| ball(at, 12.0, 6.0);
    let (volume, labels) =
        scene(|at| if inside(at) { 150.0 } else { 20.0 }, |at| if inside(at) { 2 } else { 1 });
    let border = Params { opacity: OpacityRule::Border, ..Params::default() };
    let figures = transfer(&volume, &labels, &border, &Exec::default()).unwrap().figures;
    assert_eq!(
        (figures.divergence, figures.background_opacity, figures.silhouette_difference),
        (None, None, None)
    );
    // Where there is no background no ray meets it alone.
    let (volume, labels) = scene(|_| 42.0, |_| 1);
    let figures = transfer(&volume, &labels, &Params::default(), &Exec::default()).unwrap().figures;
    assert_eq!(figures.background_opacity, None);
}

#[test]
fn a_table_beyond_the_memory_limit_is_refused() {
    let (volume, labels) = scene(|at| at[0] as f32, |at| at[0] as u16 + 1);
    let exec = Exec::default().with_memory_limit(Some(8 << 20));
    let params = Params { resolution: 65_536, ..Params::default() };
    let error = transfer(&volume, &labels, &params, &exec).unwrap_err();
    assert!(matches!(error, Error::Core(ivd_core::Error::MemoryLimit { .. })), "{error}");
}

/// Two organs in something else, of given Hounsfield values.
///
/// - `rest`: the label of what is no organ.
fn organs(hounsfield: [f32; 3], rest: impl Fn([usize; 3]) -> u16) -> Palette {
    let organ = |at: [usize; 3]| if ball(at, 6.0, 4.0) { Some(1) } else { ball(at, 16.0, 6.0).then_some(2) };
    let value = |at| hounsfield[organ(at).map_or(2, |organ| usize::from(organ) - 1)] + ripple(at);
    let (volume, labels) = scene(value, |at| organ(at).unwrap_or_else(|| rest(at)));
    let params = Params { values: ValueScale::Hounsfield, ..Params::default() };
    transfer(&volume, &labels, &params, &Exec::default()).unwrap().figures.palette
}

#[test]
fn chosen_parts_that_values_do_not_tell_apart_have_colours_of_their_own() {
    let unlabelled = |_| 0;
    for rest in [-300.0, 40.0, 60.5] {
        assert_eq!(organs([60.0, 61.0, rest], unlabelled), Palette::Safe, "alike, in {rest}");
        // What has no colour may be like one of them.
        assert_eq!(organs([700.0, 61.0, rest], unlabelled), Palette::Tissue, "told apart, in {rest}");
    }
    // A segmentation of everything, and one with strays.
    assert_eq!(organs([60.0, 61.0, -300.0], |_| 3), Palette::Tissue);
    assert_eq!(organs([60.0, 61.0, -300.0], |at| if at[1..] == [0, 0] { 0 } else { 3 }), Palette::Tissue);
}
