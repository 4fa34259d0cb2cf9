//! Tables by value and gradient, on phantoms whose boundaries are known.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use ivd_atf::{Axes, Built, Error, Palette, Params, transfer};
use ivd_core::{Classified, ErrorClass, Exec, Grid, Labels, Volume, Voxels};
use nalgebra::Vector3;

/// Deviation of the blur of every boundary [mm].
const BLUR: f64 = 1.5;
/// Values of air, and of two materials.
const VALUES: [f64; 3] = [0.0, 100.0, 200.0];

/// Two balls in air, of values 100 and 200: the rim of the second passes through the value of the first. On voxels of 1 × 1 × 1.25 mm.
struct Balls {
    volume: Volume,
    labels: Labels,
    /// Distance outwards from the surface of each ball [mm], by voxel.
    outside: Vec<[f64; 2]>,
}

/// Share of a blurred half space at a distance outside of it.
fn blurred(outside: f64) -> f64 {
    // Its derivative is the Gaussian: summed over thin layers, by the middle of each.
    let z = -outside / BLUR;
    let steps = 400;
    let width = (z + 8.0) / f64::from(steps);
    let bell = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    (0..steps).map(|i| bell(-8.0 + width * (f64::from(i) + 0.5)) * width).sum::<f64>().clamp(0.0, 1.0)
}

fn balls() -> Balls {
    let grid = Grid::with_spacing([72, 40, 32], [1.0, 1.0, 1.25]).unwrap();
    let centres = [Vector3::new(18.0, 19.5, 19.5), Vector3::new(53.0, 19.5, 19.5)];
    let at = |i: usize| grid.world(grid.index(i).into()).0;
    let outside: Vec<[f64; 2]> =
        (0..grid.len()).map(|i| centres.map(|centre| (at(i) - centre).norm() - 13.0)).collect();
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        4.0 * (f64::from(state >> 8) / f64::from(1 << 24) - 0.5)
    };
    let values: Vec<f64> =
        outside.iter().map(|[a, b]| VALUES[1] * blurred(*a) + VALUES[2] * blurred(*b) + noise()).collect();
    let ids: Vec<u16> = values
        .iter()
        .map(|&v| {
            if v < 50.0 {
                1
            } else if v < 150.0 {
                2
            } else {
                3
            }
        })
        .collect();
    let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
    Balls { volume, labels: Labels::new(grid, ids.into(), vec![]).unwrap(), outside }
}

fn params() -> Params {
    Params { axes: Axes::ValueGradient, palette: Palette::Safe, ..Params::default() }
}

fn built(balls: &Balls, exec: &Exec) -> Built {
    transfer(&balls.volume, &balls.labels, &params(), exec).unwrap()
}

/// Magnitude of the central differences at a voxel.
fn steepness(volume: &Volume, i: usize) -> f64 {
    let [nx, ny, _] = volume.grid().dims();
    let (strides, spacing) = ([1, nx, nx * ny], volume.grid().spacing());
    let value = |i: usize| volume.voxels().get(i);
    let slope = |a: usize| (value(i + strides[a]) - value(i - strides[a])) / (2.0 * spacing[a]);
    (0..3).map(|a| slope(a).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn the_rim_of_one_material_is_not_drawn_as_another_whose_value_it_passes() {
    let balls = balls();
    let transfer = built(&balls, &Exec::default()).transfer;
    let [first, second] =
        [2, 3].map(|class| transfer.entries().iter().find(|e| e.class == class).unwrap().rgb);
    let near = |seen: [f32; 4], rgb: [f32; 3]| (0..3).all(|c| (seen[c] - rgb[c]).abs() < 0.1);
    let (mut rim, mut by_value, mut by_both) = (0, 0, 0);
    let (mut inside, mut kept) = (0, 0);
    for i in 0..balls.outside.len() {
        let [x, y, z] = balls.volume.grid().index(i).0;
        if x == 0 || y == 0 || z == 0 || x == 71 || y == 39 || z == 31 {
            continue;
        }
        let value = balls.volume.voxels().get(i);
        let seen = [transfer.sample(0, value), transfer.sample_steep(value, steepness(&balls.volume, i))];
        // On the second ball's rim at the value of the first; and inside the first.
        if balls.outside[i][1].abs() < 3.0 * BLUR && (80.0..120.0).contains(&value) {
            rim += 1;
            by_value += u32::from(near(seen[0], first));
            // Outside of half way there is air.
            let is_air = value < 0.5 * VALUES[2] && seen[1][3] < 0.01;
            by_both += u32::from(is_air || near(seen[1], second));
        } else if balls.outside[i][0] < -3.0 * BLUR {
            inside += 1;
            kept += u32::from(near(seen[1], first) && (seen[1][3] / seen[0][3] - 1.0).abs() < 0.1);
        }
    }
    assert!(rim > 500 && inside > 1000);
    assert!(by_value as f64 > 0.95 * f64::from(rim), "values alone mistake {by_value} of {rim}");
    assert!(by_both as f64 > 0.95 * f64::from(rim), "{by_both} of {rim} look like their own material");
    assert!(kept as f64 > 0.98 * f64::from(inside), "{kept} of {inside} inside keep their look");
}

#[test]
fn the_arcs_are_those_of_the_boundaries_with_their_blur() {
    let figures = built(&balls(), &Exec::default()).figures;
    let classes: Vec<[u16; 2]> = figures.boundaries.iter().map(|boundary| boundary.classes).collect();
    assert_eq!(classes, [[1, 2], [1, 3]], "{:?}", figures.boundaries);
    for boundary in &figures.boundaries {
        // Central differences over two voxels of up to 1.25 mm see a wider blur.
        let seen = (BLUR * BLUR + 1.1 * 1.1 / 3.0_f64).sqrt();
        assert!((boundary.blur_mm / seen - 1.0).abs() < 0.1, "{boundary:?} for {seen}");
    }
}

#[test]
fn a_table_by_gradient_leaves_that_by_value_as_it_is_and_goes_by_no_thread() {
    let balls = balls();
    let one = built(&balls, &Exec::default().with_threads(1));
    assert_eq!(one, built(&balls, &Exec::default().with_threads(3)));
    let by_value =
        transfer(&balls.volume, &balls.labels, &Params { axes: Axes::Value, ..params() }, &Exec::default());
    assert_eq!(by_value.unwrap().transfer.table(), one.transfer.table());
}

#[test]
fn classes_that_only_a_label_tells_apart_have_no_table_by_gradient() {
    let balls = balls();
    let ids: Vec<u16> =
        balls.outside.iter().map(|[a, b]| 1 + u16::from(*a < 0.0) + 2 * u16::from(*b < 0.0)).collect();
    let halves: Vec<u16> =
        ids.iter().enumerate().map(|(i, &id)| if id == 2 && i % 2 == 0 { 4 } else { id }).collect();
    let labels = Labels::new(balls.volume.grid().clone(), halves.into(), vec![]).unwrap();
    let error = transfer(&balls.volume, &labels, &params(), &Exec::default()).unwrap_err();
    assert_eq!((&error, error.error_class()), (&Error::RowsDiffer, ErrorClass::Usage));
}
