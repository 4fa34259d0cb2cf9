//! Surfaces on shapes that are known, from awkward starts, and on random volumes.
// The helpers of these tests may unwrap as the tests do.
#![allow(clippy::unwrap_used)]

use ivd_boundary::{
    AreaMeasure, DataTerm, Distribution, Error, StartShape, Surface, SurfaceParams, active_surface,
};
use ivd_core::{Classified, ErrorClass, Exec, Grid, Mask, Volume, noise};

fn gauss(seed: u64, i: u64) -> f64 {
    let (u, v) = (noise::unit(seed, 2 * i).max(1e-300), noise::unit(seed, 2 * i + 1));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A volume of a shape, told by its signed distance (mm) from the volume's middle, whose edge is a step from 0 to 1.
fn shape(
    dims: [usize; 3],
    spacing: [f64; 3],
    sigma: f64,
    distance: &dyn Fn([f64; 3]) -> f64,
) -> (Volume, Vec<bool>) {
    let grid = Grid::with_spacing(dims, spacing).unwrap();
    let shift = [0.13, -0.21, 0.37];
    let inside: Vec<bool> = (0..grid.len())
        .map(|i| {
            let at = grid.index(i).0;
            let q = std::array::from_fn(|a| {
                (at[a] as f64 - (dims[a] as f64 - 1.0) / 2.0 - shift[a]) * spacing[a]
            });
            distance(q) < 0.0
        })
        .collect();
    let value = |i: usize| (f64::from(u8::from(inside[i])) + sigma * gauss(7, i as u64)) as f32;
    let voxels: Vec<f32> = (0..grid.len()).map(value).collect();
    (Volume::new(grid, voxels.into()).unwrap(), inside)
}

fn length(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn ball(n: f64) -> impl Fn([f64; 3]) -> f64 {
    move |q| length(&q) - 0.35 * n
}

fn torus(n: f64) -> impl Fn([f64; 3]) -> f64 {
    move |q| length(&[length(&q[..2]) - 0.28 * n, q[2]]) - 0.12 * n
}

fn find(volume: &Volume, params: &SurfaceParams) -> Result<Surface, Error> {
    active_surface(volume, None, None, params, &Exec::default())
}

fn dice(mask: &Mask, truth: &[bool]) -> f64 {
    let both = mask.inside().iter().zip(truth).filter(|(m, t)| **m != 0 && **t).count();
    2.0 * both as f64 / (mask.count() as usize + truth.iter().filter(|t| **t).count()) as f64
}

/// Mean distance of the level function's zeros along the axes from a surface, without and with its sign.
fn distances(mask: &Mask, distance: &dyn Fn([f64; 3]) -> f64) -> [f64; 2] {
    let dims = mask.grid().dims();
    let (inside, level) = (mask.inside(), mask.level().unwrap());
    let shift = [0.13, -0.21, 0.37];
    let (mut sum, mut signed, mut count) = (0.0, 0.0, 0.0);
    for i in 0..inside.len() {
        let at = mask.grid().index(i).0;
        for (a, stride) in [1, dims[0], dims[0] * dims[1]].into_iter().enumerate() {
            if at[a] + 1 < dims[a] && inside[i] != inside[i + stride] {
                let (from, to) = (f64::from(level[i]), f64::from(level[i + stride]));
                let mut q: [f64; 3] =
                    std::array::from_fn(|b| at[b] as f64 - (dims[b] as f64 - 1.0) / 2.0 - shift[b]);
                q[a] += from / (from - to);
                sum += distance(q).abs();
                signed += distance(q);
                count += 1.0;
            }
        }
    }
    [sum / count, signed / count]
}

fn distance(mask: &Mask, of: &dyn Fn([f64; 3]) -> f64) -> f64 {
    distances(mask, of)[0]
}

#[test]
fn balls_and_tori_are_found_in_noise() {
    type Shape = (&'static str, fn([f64; 3]) -> f64, [(f64, f64, f64); 2]);
    let n = 80;
    // Least Dice and greatest mean distance (voxels) by noise: those asked at 128³, where a shape has less surface for its volume.
    let cases: [Shape; 2] = [
        ("ball", |q| ball(80.0)(q), [(0.5, 0.993, 0.15), (1.0, 0.988, 0.22)]),
        ("torus", |q| torus(80.0)(q), [(0.5, 0.985, 0.16), (1.0, 0.968, 0.27)]),
    ];
    for (name, of, limits) in cases {
        for (sigma, least, greatest) in limits {
            let (volume, truth) = shape([n; 3], [1.0; 3], sigma, &of);
            let found = find(&volume, &SurfaceParams::default()).unwrap();
            let (dice, far) = (dice(&found.mask, &truth), distance(&found.mask, &of));
            assert!(
                dice >= least && far <= greatest,
                "{name} in noise of {sigma}: Dice {dice:.4}, {far:.3} voxels"
            );
            assert!(found.energies.windows(2).all(|e| e[1] < e[0]), "{name}: {:?}", found.energies);
            assert_eq!(found.voxels, found.mask.count());
        }
    }
}

/// Values fall from 1 to 0 over eight voxels about the border; noise is normal, or that of magnitudes, of which those above 1 are cut off.
#[test]
fn a_mixture_finds_a_blurred_border_where_voxels_hold_half_of_either_side() {
    type Shape = (&'static str, fn([f64; 3]) -> f64);
    let n = 80;
    let shapes: [Shape; 2] = [("ball", |q| ball(80.0)(q)), ("torus", |q| torus(80.0)(q))];
    for (name, of) in shapes {
        for sigma in [0.05, 0.2] {
            for distribution in [Distribution::GaussianMixture, Distribution::RicianMixture] {
                let (plain, truth) = shape([n; 3], [1.0; 3], 0.0, &of);
                let grid = plain.grid().clone();
                let middle = (n as f64 - 1.0) / 2.0;
                let voxels: Vec<f32> = (0..grid.len())
                    .map(|i| {
                        let at = grid.index(i).0;
                        let q = std::array::from_fn(|a| at[a] as f64 - middle - [0.13, -0.21, 0.37][a]);
                        let clean = (0.5 - of(q) / 8.0).clamp(0.0, 1.0);
                        let [a, b] = [7, 8].map(|seed| sigma * gauss(seed, i as u64));
                        let noisy = match distribution {
                            Distribution::RicianMixture => (clean + a).hypot(b).min(1.0),
                            _ => clean + a,
                        };
                        noisy as f32
                    })
                    .collect();
                let volume = Volume::new(grid, voxels.into()).unwrap();
                let params = SurfaceParams {
                    data: DataTerm::Likelihood,
                    distribution: Some(distribution),
                    ..SurfaceParams::default()
                };
                let found = find(&volume, &params).unwrap();
                let [far, bias] = distances(&found.mask, &of);
                let told =
                    format!("{name}, {distribution:?} of {sigma}: {far:.3} voxels, {bias:.3} with its sign");
                assert!(far <= if sigma < 0.1 { 0.2 } else { 0.3 } && bias.abs() <= 0.15, "{told}");
                assert!(dice(&found.mask, &truth) > 0.95, "{told}");
            }
        }
    }
}

#[test]
fn the_bytes_are_the_same_for_any_number_of_threads_and_any_registers() {
    let (volume, _) = shape([70, 66, 75], [1.0, 1.2, 0.9], 0.5, &torus(70.0));
    let params = SurfaceParams::default();
    let by = |exec: &Exec| active_surface(&volume, None, None, &params, exec).unwrap();
    let one = by(&Exec::default().with_threads(1).with_simd(false));
    assert_eq!(one, by(&Exec::default().with_threads(3)));
}

#[test]
fn a_surface_in_thick_slices_is_that_of_space() {
    let of = |q: [f64; 3]| length(&q) - 22.0;
    let (volume, truth) = shape([60, 60, 13], [1.0, 1.0, 10.0], 0.3, &of);
    let found = find(&volume, &SurfaceParams::default()).unwrap();
    assert!(dice(&found.mask, &truth) > 0.98, "{}", dice(&found.mask, &truth));
}

/// Start, and whether the ball or what surrounds it is what is right; `None`: no answer is.
fn start(n: usize, holds: impl Fn([usize; 3]) -> bool) -> Mask {
    let grid = Grid::with_spacing([n; 3], [1.0; 3]).unwrap();
    let inside: Vec<u8> = (0..grid.len()).map(|i| u8::from(holds(grid.index(i).0))).collect();
    Mask::new(grid, inside.into()).unwrap()
}

#[test]
fn any_start_finds_the_part_it_lies_in_or_says_that_there_is_none() {
    let n = 40;
    let (volume, truth) = shape([n; 3], [1.0; 3], 0.2, &ball(40.0));
    let outside: Vec<bool> = truth.iter().map(|t| !t).collect();
    let from = |start: &Mask| {
        active_surface(&volume, None, Some(start), &SurfaceParams::default(), &Exec::default())
    };
    let sees = |start: &Mask, truth: &[bool]| {
        let found = from(start).unwrap();
        let dice = dice(&found.mask, truth);
        assert!(dice > 0.99, "{dice}");
    };
    let params = |fill: bool| SurfaceParams { fill_holes: fill, ..SurfaceParams::default() };
    sees(&start(n, |at| at == [20, 20, 20]), &truth);
    sees(&start(n, |at| at[0] < 20 && at.iter().all(|&c| (6..34).contains(&c))), &truth);
    sees(&start(n, |at| at.iter().all(|&c| (3..37).contains(&c))), &truth);
    sees(&start(n, |_| true), &truth);
    // A start in the corner takes what surrounds the ball, where the hole that this is may stay.
    let corner = start(n, |at| at.iter().all(|&c| c < 6));
    let found = active_surface(&volume, None, Some(&corner), &params(false), &Exec::default()).unwrap();
    assert!(dice(&found.mask, &outside) > 0.99);
    let empty = from(&start(n, |_| false)).unwrap_err();
    assert_eq!(empty.error_class(), ErrorClass::Untrusted, "{empty}");

    let inverted: Vec<f32> = (0..volume.grid().len()).map(|i| 5.0 - volume.voxels().get(i) as f32).collect();
    let inverted = Volume::new(volume.grid().clone(), inverted.into()).unwrap();
    assert!(dice(&find(&inverted, &SurfaceParams::default()).unwrap().mask, &truth) > 0.99);

    let even = Volume::new(volume.grid().clone(), vec![3.0_f32; volume.grid().len()].into()).unwrap();
    let error = find(&even, &SurfaceParams::default()).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}");

    let seed = SurfaceParams { seed: Some([500.0, 0.0, 0.0]), ..SurfaceParams::default() };
    assert!(matches!(find(&volume, &seed), Err(Error::SeedOutside { .. })));
}

/// A volume of other values where a shape lies.
fn valued(volume: &Volume, truth: &[bool], sigma: f64, value: &dyn Fn([usize; 3], bool) -> f64) -> Volume {
    let voxel = |i: usize| value(volume.grid().index(i).0, truth[i]) + sigma * gauss(3, i as u64);
    let voxels: Vec<f32> = (0..truth.len()).map(|i| voxel(i) as f32).collect();
    Volume::new(volume.grid().clone(), voxels.into()).unwrap()
}

#[test]
fn a_start_tells_an_organ_from_body_and_air() {
    let n = 48;
    let (volume, organ) = shape([n; 3], [1.0; 3], 0.0, &|q| length(&q) - 8.0);
    let body = |at: [usize; 3]| at.iter().all(|&c| (6..42).contains(&c));
    let scan = valued(&volume, &organ, 8.0, &|at, is_organ| match (is_organ, body(at)) {
        (true, _) => 100.0,
        (false, true) => 60.0,
        (false, false) => -1000.0,
    });
    let of = |data: DataTerm| {
        let middle = scan.grid().world(ivd_core::VoxelCoord(nalgebra::Vector3::repeat(23.5))).0.into();
        let params = SurfaceParams { seed: Some(middle), data, ..SurfaceParams::default() };
        dice(&find(&scan, &params).unwrap().mask, &organ)
    };
    let [means, start] = [of(DataTerm::Means), of(DataTerm::Start)];
    assert!(means < 0.2, "two means tell the body from the air: {means}");
    assert!(start > 0.97, "{start}");
}

#[test]
fn local_means_follow_brightness_that_changes_across_a_part() {
    let n = 48;
    let (volume, truth) = shape([n; 3], [1.0; 3], 0.0, &ball(48.0));
    let scan = valued(&volume, &truth, 0.1, &|at, inside| {
        f64::from(u8::from(inside)) + 1.5 * at[0] as f64 / n as f64
    });
    let means = find(&scan, &SurfaceParams::default()).map_or(0.0, |found| dice(&found.mask, &truth));
    let near = SurfaceParams { data: DataTerm::Local, radius: Some(14.0), ..SurfaceParams::default() };
    let local = find(&scan, &near).unwrap();
    assert!(means < 0.95, "{means}");
    assert!(dice(&local.mask, &truth) > 0.985, "{}", dice(&local.mask, &truth));
    assert!(local.energies.windows(2).all(|e| e[1] < e[0]), "{:?}", local.energies);
}

#[test]
fn area_that_weighs_less_in_steep_places_is_the_same_where_nothing_is_steep() {
    let n = 40;
    let (volume, truth) = shape([n; 3], [1.0, 0.8, 1.3], 0.3, &|q| length(&q) - 11.0);
    let of = |edge: Option<f64>| find(&volume, &SurfaceParams { edge, ..SurfaceParams::default() }).unwrap();
    let (alike, flat, steep) = (of(None), of(Some(1e12)), of(Some(0.4)));
    assert_eq!(alike.mask, flat.mask);
    assert!(dice(&steep.mask, &truth) > 0.97 && steep.mask != alike.mask, "{}", dice(&steep.mask, &truth));
}

#[test]
fn voxels_without_data_belong_to_nothing() {
    let n = 40;
    let (volume, truth) = shape([n; 3], [1.0; 3], 0.2, &ball(40.0));
    let missing = |i: usize| i % 7 == 3 || (volume.grid().index(i).0[2] == 20 && i % 40 < 20);
    let voxels: Vec<f32> = (0..volume.grid().len())
        .map(|i| if missing(i) { f32::NAN } else { volume.voxels().get(i) as f32 })
        .collect();
    let holed = Volume::new(volume.grid().clone(), voxels.into()).unwrap();
    let top = SurfaceParams { fill_holes: false, ..SurfaceParams::default() };
    let found = find(&holed, &top).unwrap();
    assert!((0..truth.len()).filter(|&i| missing(i)).all(|i| found.mask.inside()[i] == 0));
    let there = |i: &usize| !missing(*i);
    let right = (0..truth.len()).filter(there).filter(|&i| (found.mask.inside()[i] != 0) == truth[i]).count();
    assert!(right as f64 > 0.995 * (0..truth.len()).filter(there).count() as f64, "{right}");
}

#[test]
fn the_leak_guard_cuts_a_bridge() {
    let of = |q: [f64; 3]| {
        let balls = [-16.0, 16.0].map(|s| length(&[q[0] - s, q[1], q[2]]) - 11.0);
        let bridge = f64::max(length(&q[1..]) - 3.0, q[0].abs() - 16.0);
        balls[0].min(balls[1]).min(bridge)
    };
    let (volume, _) = shape([64, 40, 40], [1.0; 3], 0.1, &of);
    let middle = volume.grid().world(ivd_core::VoxelCoord(nalgebra::Vector3::new(16.0, 19.5, 19.5))).0;
    let seeded = SurfaceParams { seed: Some(middle.into()), ..SurfaceParams::default() };
    let leaked = find(&volume, &seeded).unwrap();
    let guarded = find(&volume, &SurfaceParams { open: 4.5, ..seeded.clone() }).unwrap();
    let one_ball = 4.0 / 3.0 * std::f64::consts::PI * 11.0_f64.powi(3);
    assert!(leaked.voxels as f64 > 2.0 * one_ball, "{}", leaked.voxels);
    assert!((guarded.voxels as f64 / one_ball - 1.0).abs() < 0.05, "{} of {one_ball}", guarded.voxels);
    let nothing = find(&volume, &SurfaceParams { open: 30.0, ..seeded }).unwrap_err();
    assert_eq!(nothing.error_class(), ErrorClass::Untrusted, "{nothing}");
}

/// Random volumes: energies fall, masks are one piece and hold data, or there is an error that says why.
fn random_case(case: u64) -> bool {
    let dims: [usize; 3] = std::array::from_fn(|a| 1 + noise::below(case, a as u64, 20) as usize);
    let spacing = std::array::from_fn(|a| [0.3, 1.0, 1.0, 3.0][noise::below(case, 5 + a as u64, 4) as usize]);
    let grid = Grid::with_spacing(dims, spacing).unwrap();
    let kind = noise::below(case, 9, 4);
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| {
            let value = noise::unit(case + 1, i as u64) as f32;
            let [x, y, _] = grid.index(i).0;
            match kind {
                0 => value,
                1 => value + 3.0 * f32::from(u8::from(x > dims[0] / 2)),
                2 if noise::below(case + 2, i as u64, 5) == 0 => f32::NAN,
                2 => value.powi(4) * 1e6 - 1e3,
                _ => f32::from(u8::from((x / 3 + y / 4) % 2 == 0)),
            }
        })
        .collect();
    let volume = Volume::new(grid, voxels.into()).unwrap();
    let distribution = [
        None,
        Some(Distribution::Histogram),
        Some(Distribution::Gaussian),
        Some(Distribution::Rician),
        Some(Distribution::GaussianMixture),
        Some(Distribution::RicianMixture),
    ][noise::below(case, 12, 6) as usize];
    let params = SurfaceParams {
        phi: (noise::below(case, 10, 2) == 0).then(|| 0.01 + 0.9 * noise::unit(case, 11)),
        data: if distribution.is_none() { DataTerm::default() } else { DataTerm::Likelihood },
        distribution,
        open: [0.0, 0.0, 1.0][noise::below(case, 13, 3) as usize],
        ..SurfaceParams::default()
    };
    match find(&volume, &params) {
        Ok(found) => {
            assert!(!found.energies.is_empty(), "case {case}");
            assert!(found.energies.windows(2).all(|e| e[1] <= e[0]), "case {case}: {:?}", found.energies);
            assert!(found.voxels > 0, "case {case}");
            let inside = found.mask.inside();
            assert!(
                (0..inside.len()).all(|i| inside[i] == 0 || !volume.voxels().get(i).is_nan()),
                "case {case}"
            );
            true
        }
        Err(error) => {
            assert_eq!(error.error_class(), ErrorClass::Untrusted, "case {case}: {error}");
            false
        }
    }
}

#[test]
fn energies_never_rise_on_random_volumes() {
    let found = (0..400).filter(|&case| random_case(case)).count();
    assert!(found > 100, "{found} of 400 volumes have a surface");
}

/// As above, by the ten thousand: part of `just stress`.
#[test]
#[ignore = "takes minutes; `just stress` runs it"]
fn energies_never_rise_on_ten_thousand_volumes() {
    let found = (1000..11_000).filter(|&case| random_case(case)).count();
    assert!(found > 2500, "{found}");
}

#[test]
fn noise_has_no_boundary() {
    for (case, n) in [16, 24, 40, 72].into_iter().enumerate() {
        for phi in [None, Some(0.05), Some(0.3), Some(0.6), Some(0.9)] {
            let grid = Grid::with_spacing([n; 3], [[1.0; 3], [1.0, 1.0, 3.0]][case % 2]).unwrap();
            let noise = |i: u64| match case % 3 {
                0 => gauss(n as u64, i) as f32,
                1 => noise::unit(n as u64, i) as f32,
                _ => noise::below(n as u64, i, 2) as f32,
            };
            let volume =
                Volume::new(grid.clone(), (0..grid.len() as u64).map(noise).collect::<Vec<_>>().into());
            let volume = volume.unwrap();
            for data in [DataTerm::Means, DataTerm::Local] {
                if data == DataTerm::Local && n > 24 {
                    continue;
                }
                let error = find(&volume, &SurfaceParams { phi, data, ..SurfaceParams::default() });
                assert!(matches!(error, Err(Error::NoBoundary { .. })), "{n} {phi:?} {data:?}: {error:?}");
            }
        }
    }
}

#[test]
fn parts_of_little_volume_are_told_from_noise() {
    type Shape = fn([f64; 3]) -> f64;
    let shapes: [(Shape, f64, f64); 5] = [
        (|q| length(&q) - 14.0, 1.0, 0.95),
        (|q| length(&[length(&q[..2]) - 11.0, q[2]]) - 4.8, 1.0, 0.85),
        (|q| length(&q) - 6.0, 0.5, 0.9),
        (|q| q[0].abs() - 1.5, 0.5, 0.98),
        (|q| length(&q[..2]) - 3.0, 0.5, 0.95),
    ];
    for (i, (of, sigma, least)) in shapes.into_iter().enumerate() {
        let (volume, truth) = shape([40; 3], [1.0; 3], sigma, &of);
        let found = find(&volume, &SurfaceParams::default()).unwrap_or_else(|e| panic!("shape {i}: {e}"));
        assert!(dice(&found.mask, &truth) > least, "shape {i}: {}", dice(&found.mask, &truth));
    }
}

#[test]
fn cuts_hold_no_voxels_without_data() {
    let (volume, _) = shape([24; 3], [1.0; 3], 0.2, &|q| length(&q) - 7.0);
    let missing = |i: usize| i % 7 == 3;
    let voxels: Vec<f32> = (0..volume.grid().len())
        .map(|i| if missing(i) { f32::NAN } else { volume.voxels().get(i) as f32 })
        .collect();
    let holed = Volume::new(volume.grid().clone(), voxels.into()).unwrap();
    for area in [AreaMeasure::Faces, AreaMeasure::Corners] {
        let found = find(&holed, &SurfaceParams { area, ..SurfaceParams::default() }).unwrap();
        assert!(found.voxels > 800, "{area:?}: {}", found.voxels);
        assert!((0..volume.grid().len()).all(|i| !missing(i) || found.mask.inside()[i] == 0), "{area:?}");
    }
}

/// A disc of radius 14 in noise, on a slice across an axis.
fn disc(across: usize, edge: f64) -> (Volume, Vec<bool>) {
    let (mut dims, mut spacing) = ([48; 3], [1.0; 3]);
    (dims[across], spacing[across]) = (1, edge);
    let [a, b] = [[1, 2], [0, 2], [0, 1]][across];
    shape(dims, spacing, 0.5, &|q| q[a].hypot(q[b]) - 14.0)
}

#[test]
fn slices_are_planes() {
    // The third edge counts for nothing, whichever axis it is.
    for across in 0..3 {
        for edge in [0.2, 1.0, 30.0] {
            for open in [0.0, 4.0] {
                let (volume, truth) = disc(across, edge);
                let found = find(&volume, &SurfaceParams { open, ..SurfaceParams::default() }).unwrap();
                let dice = dice(&found.mask, &truth);
                assert!(dice > 0.97, "across {across}, {edge} mm thick, open {open}: {dice}");
                assert!((found.noise - 0.5).abs() < 0.1, "{}", found.noise);
            }
        }
    }
    let of = |edge: f64| find(&disc(2, edge).0, &SurfaceParams::default()).unwrap();
    assert_eq!(of(0.2).mask.inside(), of(30.0).mask.inside());
    let (thin, thick) = (of(0.2), of(30.0));
    assert!((thin.mu / thick.mu - 1.0).abs() < 1e-9);
}

#[test]
fn thin_starts_are_kept_at_coarse_resolutions() {
    // At 80³ the coarsest resolution halves every axis: sheets between and at the middles of its voxels.
    let n = 80;
    let (volume, truth) = shape([n; 3], [1.0; 3], 0.2, &ball(80.0));
    for layer in [40, 41] {
        let sheet = start(n, |[x, y, z]| z == layer && x.abs_diff(40) < 10 && y.abs_diff(40) < 10);
        let params = SurfaceParams::default();
        let found = active_surface(&volume, None, Some(&sheet), &params, &Exec::default());
        let found = found.unwrap_or_else(|e| panic!("layer {layer}: {e}"));
        assert!(dice(&found.mask, &truth) > 0.99, "layer {layer}");
    }
}

#[test]
fn extreme_parameters_are_right_or_refused() {
    let (volume, truth) = shape([24; 3], [1.0; 3], 0.1, &|q| length(&q) - 7.0);
    let plain = SurfaceParams::default();
    let far = SurfaceParams { data: DataTerm::Local, reach: Some(1e30), ..plain.clone() };
    assert!(dice(&find(&volume, &far).unwrap().mask, &truth) > 0.97);
    let all_steep = SurfaceParams { edge: Some(1e-200), ..plain.clone() };
    match find(&volume, &all_steep) {
        Ok(found) => assert!(found.mu.is_finite() && found.voxels > 0),
        Err(error) => assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}"),
    }
    for phi in [1e-40, 1e-7, 1.0 - 1e-12] {
        let error = find(&volume, &SurfaceParams { phi: Some(phi), ..plain.clone() }).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Usage, "{error}");
        assert!(error.to_string().contains("phi"), "{error}");
    }
    for phi in [1e-6, 0.999_999] {
        match find(&volume, &SurfaceParams { phi: Some(phi), ..plain.clone() }) {
            Ok(found) => assert!(found.energies.iter().all(|e| e.is_finite())),
            Err(error) => assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}"),
        }
    }
}

#[test]
fn what_a_surface_does_not_read_is_refused_by_name() {
    let (volume, _) = shape([16; 3], [1.0; 3], 0.1, &|q| length(&q) - 5.0);
    let drawn = start(16, |at| at == [8, 8, 8]);
    let plain = SurfaceParams::default();
    for (field, params) in [
        ("seed", SurfaceParams { seed: Some([0.0; 3]), ..plain.clone() }),
        ("radius", SurfaceParams { radius: Some(2.0), ..plain.clone() }),
        ("start", SurfaceParams { start: Some(StartShape::Ball), ..plain.clone() }),
        ("distribution", SurfaceParams { distribution: Some(Distribution::Histogram), ..plain.clone() }),
    ] {
        let error = active_surface(&volume, None, Some(&drawn), &params, &Exec::default()).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Usage, "{error}");
        assert!(error.to_string().contains(field), "{error}");
    }
    assert!(active_surface(&volume, None, Some(&drawn), &plain, &Exec::default()).is_ok());
    let densest = SurfaceParams { class: Some(ivd_core::ClassChoice::Densest), ..plain };
    let error = find(&volume, &densest).unwrap_err();
    assert!(error.to_string().contains("class") && !error.to_string().contains("above"), "{error}");
}
