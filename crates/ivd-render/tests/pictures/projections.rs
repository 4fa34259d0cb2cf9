//! Projections against plain loops over a ray's samples, and what must not change them.

use ivd_core::{Displacement, Exec, Grid, Volume, VoxelCoord, Voxels, World, srgb};
use ivd_render::{Fit, Mode, Prepared, RenderParams, Scene, View, radiance};
use nalgebra::Vector3;

use super::common::{displacement, hills, twisted};

const SIZE: [usize; 2] = [46, 38];
const STEP: f64 = 0.4;

/// All projections.
fn modes() -> [Mode; 7] {
    [
        Mode::Mip,
        Mode::Minip,
        Mode::Mean,
        Mode::Lmip { threshold: None },
        Mode::Lmip { threshold: Some(60.0) },
        Mode::AttenuatedMip { attenuation: 12.0 },
        Mode::AttenuatedMip { attenuation: 0.0 },
    ]
}

fn params(mode: Mode) -> RenderParams {
    let view = View { angles: [33.0, 21.0], zoom: 1.2, ..View::FRONT };
    RenderParams {
        mode,
        view,
        size: SIZE,
        step: STEP,
        fit: Fit::Volume,
        annotate: false,
        ..RenderParams::default()
    }
}

/// Smooth hills on a plain that isn't black, and missing voxels.
fn landscape() -> Volume {
    let values = hills::<f32>().to_array();
    let value = |(i, &v): (usize, &f64)| {
        if i % 613 < 2 { f32::NAN } else { (20.0 + 0.8 * v + (i % 7) as f64) as f32 }
    };
    let values: Vec<f32> = values.t().iter().enumerate().map(value).collect();
    Volume::new(hills::<f32>().grid().clone(), Voxels::from(values)).unwrap()
}

/// Samples along every pixel's ray, real values by their own interpolation, each with the steps that it stands for.
fn rays(volume: &Volume, shift: Vector3<f64>) -> Vec<Vec<(Option<f64>, f64)>> {
    let grid = volume.grid();
    let array = volume.to_array();
    let dims = grid.dims().map(|n| n as f64);
    let value = |at: Vector3<f64>| {
        if (0..3).any(|a| at[a] < -0.5 || at[a] > dims[a] - 0.5) {
            return None;
        }
        let inner = Vector3::from_fn(|a, _| at[a].clamp(0.0, dims[a] - 1.0));
        let cell = inner.map(f64::floor);
        let mut sum = 0.0;
        for corner in 0..8 {
            let up = Vector3::from_fn(|a, _| f64::from(corner >> a & 1));
            let weight: f64 = (0..3).map(|a| 1.0 - (inner[a] - cell[a] - up[a]).abs()).product();
            let [x, y, z] = [0, 1, 2].map(|a| ((cell[a] + up[a]) as usize).min(grid.dims()[a] - 1));
            sum += weight * array[[x, y, z]];
        }
        sum.is_finite().then_some(sum)
    };
    // The picture's axes, by the angles of `params`.
    let ([sin_a, sin_e], [cos_a, cos_e]) =
        ([33.0_f64, 21.0].map(|d| d.to_radians().sin()), [33.0_f64, 21.0].map(|d| d.to_radians().cos()));
    let eye = Vector3::new(-sin_a * cos_e, cos_a * cos_e, sin_e);
    let up = Vector3::new(sin_a * sin_e, -cos_a * sin_e, cos_e);
    let right = up.cross(&eye);
    let corner = |x: f64, y: f64, z: f64| grid.world(VoxelCoord(Vector3::new(x, y, z))).0;
    let middle = corner(0.5 * (dims[0] - 1.0), 0.5 * (dims[1] - 1.0), 0.5 * (dims[2] - 1.0));
    let radius = (corner(dims[0], dims[1], dims[2]) - corner(0.0, 0.0, 0.0)).norm() / 2.0;
    let pixel = 2.0 * radius / SIZE[1] as f64 / 1.2;
    let step = STEP * 0.8;
    let ray = |i: usize| {
        let (x, y) = ((i % SIZE[0]) as f64 - 22.5, 18.5 - (i / SIZE[0]) as f64);
        let from = middle + pixel * (x * right + y * up) + 3.0 * radius * eye;
        let place = |t: f64| grid.voxel(World(from - t * eye)).0;
        let (a, b) = (place(0.0), place(1.0) - place(0.0));
        let (mut near, mut far) = (0.0_f64, 1e9_f64);
        for axis in 0..3 {
            let ends = [-0.5, dims[axis] - 0.5].map(|end| (end - a[axis]) / b[axis]);
            (near, far) = (near.max(ends[0].min(ends[1])), far.min(ends[0].max(ends[1])));
        }
        let mut samples = Vec::new();
        let mut start = near;
        while start < far - 1e-9 {
            let length = step.min(far - start);
            let at = grid.voxel(World(from - (start + 0.5 * length) * eye + shift)).0;
            samples.push((value(at), length / step));
            start += length;
        }
        samples
    };
    (0..SIZE[0] * SIZE[1]).map(ray).collect()
}

/// What a mode makes of a ray's samples: the share of the window that is shown.
fn projected(
    mode: Mode,
    samples: &[(Option<f64>, f64)],
    [low, high]: [f64; 2],
    diagonal: f64,
) -> Option<f64> {
    let known: Vec<(f64, f64)> = samples.iter().filter_map(|&(value, steps)| Some((value?, steps))).collect();
    let share = |value: f64| (value - low) / (high - low);
    let greatest = known.iter().map(|k| k.0).reduce(f64::max)?;
    Some(match mode {
        Mode::Minip => share(known.iter().map(|k| k.0).fold(f64::INFINITY, f64::min)),
        Mode::Mean => {
            share(known.iter().map(|k| k.0 * k.1).sum::<f64>() / known.iter().map(|k| k.1).sum::<f64>())
        }
        Mode::Lmip { threshold } => {
            let threshold = threshold.unwrap();
            let first = samples.iter().position(|s| s.0.is_some_and(|value| value >= threshold));
            let peak = first.map(|mut i| {
                while i + 1 < samples.len() && samples[i + 1].0 >= samples[i].0 {
                    i += 1;
                }
                samples[i].0.unwrap()
            });
            share(peak.unwrap_or(greatest))
        }
        Mode::AttenuatedMip { attenuation } => {
            let (mut before, mut best) = (0.0, 0.0_f64);
            for (value, steps) in known {
                let own = share(value).clamp(0.0, 1.0) * steps * STEP * 0.8 / diagonal;
                best = best.max(share(value).clamp(0.0, 1.0) * (-attenuation * (before + 0.5 * own)).exp());
                before += own;
            }
            best
        }
        _ => share(greatest),
    })
}

/// A mode whose threshold, the middle of the range where nothing is said, is said.
fn with_threshold(mode: Mode, volume: &Volume) -> Mode {
    let middle = volume.range().map(|[low, high]| 0.5 * (low + high));
    match mode {
        Mode::Lmip { threshold } => Mode::Lmip { threshold: threshold.or(middle) },
        mode => mode,
    }
}

/// Pixels that are more than a level of 255 beside a plain loop.
fn strays(
    volume: &Volume,
    displacement: Option<&Displacement>,
    shift: Vector3<f64>,
    params: &RenderParams,
) -> usize {
    let mode = with_threshold(params.mode, volume);
    let window = params.window.or(volume.range()).unwrap();
    let dims = volume.grid().dims();
    let diagonal = Vector3::new(0.8 * dims[0] as f64, dims[1] as f64, 1.3 * dims[2] as f64).norm();
    let scene = Scene { displacement, ..Scene::new(volume) };
    let picture = radiance(&scene, params, &Exec::default()).unwrap();
    let mut strays = 0;
    for (samples, found) in rays(volume, shift).iter().zip(&picture.rgba) {
        let truth = projected(mode, samples, window, diagonal);
        assert_eq!(found[3], f32::from(u8::from(truth.is_some())), "{mode:?}");
        let truth = srgb::byte(srgb::linear(truth.unwrap_or(0.0).clamp(0.0, 1.0) as f32));
        strays += usize::from(truth.abs_diff(srgb::byte(found[0])) > 1);
    }
    strays
}

#[test]
fn every_projection_is_that_of_a_plain_loop() {
    let volume = landscape();
    // All of it from somewhat aside: what a linear displacement is between voxels is known.
    let shift = Vector3::new(1.7, -2.3, 0.9);
    let aside = displacement(volume.grid(), |_| Some(shift));
    for mode in modes() {
        // Which of two peaks comes first, and whether a sample beside missing data has a value, is a matter of rounding in a few pixels; a narrow window shows the latter.
        let few = SIZE[0] * SIZE[1] / 200;
        for (displacement, shift) in [(None, Vector3::zeros()), (Some(&aside), shift)] {
            for window in [None, Some([30.0, 90.0])] {
                let strays = strays(&volume, displacement, shift, &RenderParams { window, ..params(mode) });
                let most = if window.is_some() || matches!(mode, Mode::Lmip { .. }) { few } else { 0 };
                assert!(strays <= most, "{mode:?} {window:?}: {strays} pixels");
            }
        }
    }
}

#[test]
fn passing_over_bricks_changes_no_bit_of_a_projection() {
    let grid = landscape().grid().clone();
    let twisted = twisted(&grid);
    // Half of the volume has no data, so that a mean has something to pass over.
    let half: Vec<f32> = landscape()
        .to_array()
        .t()
        .iter()
        .enumerate()
        .map(|(i, &v)| if i % 45 < 22 { v as f32 } else { f32::NAN })
        .collect();
    let half = Volume::new(grid.clone(), Voxels::from(half)).unwrap();
    for volume in [&landscape(), &hills::<u8>(), &half] {
        for displacement in [None, Some(&twisted)] {
            let scene = Scene { displacement, ..Scene::new(volume) };
            for mode in modes() {
                let on = radiance(&scene, &params(mode), &Exec::default()).unwrap();
                for exec in [Exec::default(), {
                    let mut exec = Exec::default();
                    exec.simd = false;
                    exec
                }] {
                    let off = RenderParams { skip: false, ..params(mode) };
                    let off = radiance(&scene, &off, &exec).unwrap();
                    assert!(on.rgba == off.rgba, "{mode:?}");
                    assert!(off.skipped == 0 && on.samples <= off.samples, "{mode:?}");
                }
                // A mean passes over what has no data, an undimmed maximum in a landscape without black over nothing.
                let passes = match mode {
                    Mode::Mean => std::ptr::eq(volume, &raw const half),
                    Mode::AttenuatedMip { attenuation } => attenuation > 0.0,
                    _ => true,
                };
                assert!(on.skipped > 0 || !passes, "{mode:?}");
            }
        }
    }
}

#[test]
fn a_falling_scale_is_projected_alike() {
    let volume = hills::<u8>();
    let flipped: Vec<u8> = volume.to_array().t().iter().map(|&v| 255 - v as u8).collect();
    let flipped = Volume::with_scale(volume.grid().clone(), Voxels::from(flipped), -1.0, 255.0).unwrap();
    for mode in modes() {
        let picture = |volume| radiance(&Scene::new(volume), &params(mode), &Exec::default()).unwrap();
        let (a, b) = (picture(&volume), picture(&flipped));
        let far = a.rgba.iter().zip(&b.rgba).filter(|(p, q)| (p[0] - q[0]).abs() > 1e-2 || p[3] != q[3]);
        assert!(far.count() <= a.rgba.len() / 200, "{mode:?}");
    }
}

#[test]
fn all_lengths_together_change_no_attenuated_picture() {
    let volume = landscape();
    let grid = Grid::with_spacing([45, 37, 29], [0.8, 1.0, 1.3]).unwrap();
    let large = Grid::with_spacing([45, 37, 29], [8.0, 10.0, 13.0]).unwrap();
    let of = |grid| Volume::new(grid, volume.voxels().clone()).unwrap();
    let mode = Mode::AttenuatedMip { attenuation: 12.0 };
    let picture = |volume: &Volume| radiance(&Scene::new(volume), &params(mode), &Exec::default()).unwrap();
    let (a, b) = (picture(&of(grid)), picture(&of(large)));
    assert!(a.rgba.iter().zip(&b.rgba).all(|(p, q)| (p[0] - q[0]).abs() < 1e-4));
}

#[test]
fn volumes_without_data_are_clear_and_constant_ones_white() {
    let grid = Grid::with_spacing([9, 9, 9], [1.0; 3]).unwrap();
    let of = |value: f32| Volume::new(grid.clone(), Voxels::from(vec![value; 729])).unwrap();
    for mode in modes() {
        let picture = |value| radiance(&Scene::new(&of(value)), &params(mode), &Exec::default()).unwrap();
        assert!(picture(f32::NAN).rgba.iter().all(|c| *c == [0.0; 4]), "{mode:?}");
        let constant = picture(5.0);
        assert!(constant.rgba.iter().any(|c| c[3] > 0.0));
        let white = |c: &[f32; 4]| {
            c[3] == 0.0 || c[0] == 1.0 || matches!(mode, Mode::AttenuatedMip { .. }) && c[0] > 0.5
        };
        assert!(constant.rgba.iter().all(white), "{mode:?}");
    }
}

#[test]
fn a_projection_is_picked_at_the_sample_that_it_shows() {
    let volume = landscape();
    let [low, high] = volume.range().unwrap();
    for mode in modes().into_iter().filter(|mode| *mode != Mode::Mean) {
        let params = params(mode);
        let scene = Scene::new(&volume);
        let prepared = Prepared::new(&scene, &params, &Exec::default()).unwrap();
        let picture = prepared.radiance(params.view, &Exec::default()).unwrap();
        for at in (0..SIZE[0] * SIZE[1]).step_by(17) {
            let pick = prepared.pick(params.view, [at % SIZE[0], at / SIZE[0]]).unwrap();
            assert_eq!(pick.is_some(), picture.rgba[at][3] > 0.0);
            let Some(pick) = pick else { continue };
            let share = ((pick.value.unwrap() - low) / (high - low)) as f32;
            let shown = srgb::byte(picture.rgba[at][0]);
            if matches!(mode, Mode::AttenuatedMip { attenuation } if attenuation > 0.0) {
                assert!(shown <= srgb::byte(srgb::linear(share)).saturating_add(1));
            } else {
                assert!(shown.abs_diff(srgb::byte(srgb::linear(share))) <= 1, "{mode:?}");
            }
        }
    }
    let mean = RenderParams { picks: vec![[3, 3]], ..params(Mode::Mean) };
    let refused = radiance(&Scene::new(&volume), &mean, &Exec::default()).unwrap_err();
    assert!(refused.to_string().contains("picks"), "{refused}");
}
