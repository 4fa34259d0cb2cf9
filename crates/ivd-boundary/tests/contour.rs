//! Contours on slices.
#![allow(clippy::unwrap_used)]

use ivd_boundary::{ContourEnergy, ContourParams, active_contour};
use ivd_core::{Classified, ErrorClass, Exec, Grid, Volume, noise};

/// A cylinder of 10 along z, of radius 15 (mm), in 2, with noise.
fn cylinder() -> Volume {
    let grid = Grid::with_spacing([60, 50, 5], [1.0, 1.2, 2.0]).unwrap();
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, _] = grid.index(i).0;
            let inside = (x as f64 - 30.0).hypot((y as f64 - 25.0) * 1.2) < 15.0;
            (if inside { 10.0 } else { 2.0 }) + noise::unit(5, i as u64) as f32
        })
        .collect();
    Volume::new(grid, voxels.into()).unwrap()
}

fn params(energy: ContourEnergy, radius: f64) -> ContourParams {
    ContourParams { energy, radius: Some(radius), slice: Some(2), ..ContourParams::default() }
}

#[test]
fn contours_find_a_disc_and_their_energy_falls() {
    let volume = cylinder();
    let area = std::f64::consts::PI * 15.0_f64.powi(2) / 1.2;
    for (energy, radius, off) in [(ContourEnergy::Region, 8.0, 0.02), (ContourEnergy::Edge, 17.0, 0.06)] {
        let found = active_contour(&volume, &params(energy, radius), &Exec::default()).unwrap();
        assert!((found.voxels as f64 / area - 1.0).abs() < off, "{energy:?}: {} of {area:.0}", found.voxels);
        assert!(found.energies.windows(2).all(|e| e[1] < e[0]), "{energy:?}: {:?}", found.energies);
        assert!((0..found.mask.inside().len()).all(|i| found.mask.inside()[i] == 0 || i / 3000 == 2));
    }
}

#[test]
fn the_equations_as_they_stand_collapse() {
    let found = active_contour(&cylinder(), &params(ContourEnergy::Literal, 12.0), &Exec::default()).unwrap();
    assert!(found.energies.windows(2).all(|e| e[1] < e[0]), "{:?}", found.energies);
    assert!(found.voxels == 0 || found.voxels == 3000, "{}", found.voxels);
}

#[test]
fn slices_of_one_value_and_slices_that_are_not_there_are_refused() {
    let grid = Grid::with_spacing([5, 5, 5], [1.0; 3]).unwrap();
    let even = Volume::new(grid, vec![1_u8; 125].into()).unwrap();
    let of = |params: &ContourParams| active_contour(&even, params, &Exec::default()).unwrap_err();
    assert_eq!(of(&ContourParams::default()).error_class(), ErrorClass::Untrusted);
    let beyond = of(&ContourParams { slice: Some(5), ..ContourParams::default() });
    assert_eq!(beyond.error_class(), ErrorClass::Usage, "{beyond}");
}

#[test]
fn a_contours_weight_does_not_depend_on_the_unit_of_length() {
    // The cylinder with edges of millimetres and of metres: the same voxels, and a weight in proportion.
    let of = |scale: f64| {
        let small = cylinder();
        let grid = Grid::with_spacing(small.grid().dims(), [1.0, 1.2, 2.0].map(|e| e * scale)).unwrap();
        let volume = Volume::new(grid, small.voxels().clone()).unwrap();
        let params = ContourParams { phi: Some(0.7), ..params(ContourEnergy::Region, 8.0 * scale) };
        active_contour(&volume, &params, &Exec::default()).unwrap()
    };
    let (small, large) = (of(1.0), of(1000.0));
    assert_eq!(small.mask.inside(), large.mask.inside());
    let [a, b] = [&small, &large].map(|found| *found.energies.last().unwrap());
    assert!((b / a / 1e9 - 1.0).abs() < 1e-6, "{a} {b}");
}

#[test]
fn noise_has_no_contour() {
    let grid = Grid::with_spacing([80, 60, 3], [1.0; 3]).unwrap();
    let voxels: Vec<f32> = (0..grid.len() as u64).map(|i| noise::unit(9, i) as f32).collect();
    let volume = Volume::new(grid, voxels.into()).unwrap();
    let error = active_contour(&volume, &ContourParams::default(), &Exec::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}");
}

#[test]
fn extreme_curves_are_refused_by_name() {
    let plain = params(ContourEnergy::Edge, 17.0);
    for (field, params) in [
        ("radius", ContourParams { radius: Some(1e-200), ..plain.clone() }),
        ("radius", ContourParams { radius: Some(1e200), ..plain.clone() }),
        ("stretch", ContourParams { stretch: Some(1e308), ..plain.clone() }),
        ("bend", ContourParams { bend: Some(1e308), ..plain }),
    ] {
        let error = active_contour(&cylinder(), &params, &Exec::default()).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Usage, "{error}");
        assert!(error.to_string().contains(field), "{error}");
    }
}

#[test]
fn what_an_energy_does_not_read_is_refused_by_name() {
    let of = |params: &ContourParams| active_contour(&cylinder(), params, &Exec::default()).unwrap_err();
    let plain = ContourParams::default();
    for (field, params) in [
        ("stretch", ContourParams { stretch: Some(0.02), ..plain.clone() }),
        ("bend", ContourParams { bend: Some(0.05), energy: ContourEnergy::Literal, ..plain.clone() }),
        ("scale", ContourParams { scale: Some(2.0), ..plain }),
    ] {
        let error = of(&params);
        assert_eq!(error.error_class(), ErrorClass::Usage, "{error}");
        assert!(error.to_string().contains(field), "{error}");
    }
}
