//! The kernel `render/cast`.

use ivd_core::{Class, Displacement, Exec, GradientTable, Labels, TransferFunction, Volume, Voxels};
use ivd_render::{Classification, Mode, Projection, RenderParams, Scene, View};

use super::common::{hills, twisted};
use super::sides::{apart, by_device, by_processor, on};
use super::{gpu, with_planted};
use ivd_gpu::Options;

/// Rows for no label and classes 2 and 3, all clear at the lower end; smooth, or with a gap with hard edges.
pub(crate) fn transfer(hard: bool) -> TransferFunction {
    let row = |low: usize, rgb: [f32; 3]| {
        (0..256).map(move |i| {
            let gap = hard && i > 150 && i < 160;
            let alpha = if i > low && !gap { 0.4 * (i - low) as f32 / 255.0 } else { 0.0 };
            [rgb[0], rgb[1], rgb[2], alpha]
        })
    };
    let table = row(60, [0.9, 0.4, 0.1]).chain(row(120, [0.1, 0.8, 0.3])).chain(row(90, [0.2, 0.3, 0.9]));
    TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0, 2, 3], table.collect(), vec![]).unwrap()
}

pub(crate) fn params(mode: Mode) -> RenderParams {
    let view = View { angles: [28.0, 17.0], zoom: 1.2, ..View::FRONT };
    RenderParams { size: [75, 53], mode, view, annotate: false, ..RenderParams::default() }
}

pub(crate) fn labels(volume: &Volume) -> Labels {
    let grid = volume.grid();
    let ids: Vec<u16> = (0..grid.len()).map(|i| [2, 3, 0, 2][grid.index(i).0[2] / 9]).collect();
    Labels::new(grid.clone(), ids.into(), Vec::<Class>::new()).unwrap()
}

fn with_holes(volume: &Volume) -> Volume {
    let mut values: Vec<f32> = volume.to_array().t().iter().map(|&v| v as f32).collect();
    for i in (0..values.len()).filter(|i| i % 613 < 3) {
        values[i] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i % 3];
    }
    Volume::new(volume.grid().clone(), Voxels::from(values)).unwrap()
}

const MODES: [Mode; 4] = [Mode::Dvr, Mode::Mip, Mode::Iso { value: 120.0 }, Mode::Minip];

/// What a scene adds to a volume.
struct Extras {
    labels: Labels,
    moved: Displacement,
    torn: Displacement,
}

impl Extras {
    fn new(volume: &Volume) -> Self {
        let moved = twisted(volume.grid());
        let vacated: Vec<u8> =
            (0..volume.grid().len()).map(|i| u8::from(volume.grid().index(i).0[0] > 30)).collect();
        let torn = twisted(volume.grid()).with_vacated(vacated.into()).unwrap();
        Self { labels: labels(volume), moved, torn }
    }
}

/// Every scene of a volume, with what it is called.
fn scenes<'a>(
    volume: &'a Volume,
    transfer: &'a TransferFunction,
    extras: &'a Extras,
) -> Vec<(String, Scene<'a>)> {
    let mut scenes = Vec::new();
    for labels in [None, Some(&extras.labels)] {
        for (moves, displacement) in
            [("at rest", None), ("moved", Some(&extras.moved)), ("torn", Some(&extras.torn))]
        {
            let scene = Scene { transfer: Some(transfer), labels, displacement, ..Scene::new(volume) };
            scenes.push((format!("labels {}, {moves}", labels.is_some()), scene));
        }
    }
    scenes
}

/// Both pictures of scenes of a volume in every mode.
fn compare(volume: &Volume, all: bool, exec: &Exec) {
    let extras = Extras::new(volume);
    let soft = transfer(false);
    let scenes = scenes(volume, &soft, &extras);
    // All of them, or the one of most: labelled and torn.
    for (name, scene) in scenes.iter().skip(if all { 0 } else { 5 }) {
        for mode in MODES {
            for shading in [true, false] {
                if !shading && (mode != Mode::Dvr || !all) {
                    continue;
                }
                let params = RenderParams { shading, ..params(mode) };
                let (plain, device) = (by_processor(scene, &params), by_device(scene, &params, exec));
                let apart = apart(&plain, &device);
                let what =
                    format!("{:?}: {name}, {mode:?}, shaded {shading}: {apart:?}", volume.voxel_type());
                assert!(apart.is_close(exec), "{what}");
                let seen = plain.0.rgba.iter().filter(|c| c[3] > 0.0).count();
                assert!(seen > 300, "{what}: {seen} pixels");
            }
        }
    }
}

#[test]
fn every_stored_type_in_every_mode_labelled_shaded_and_deformed_is_close() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    compare(&hills::<u8>(), true, &exec);
    compare(&hills::<u16>(), false, &exec);
    compare(&hills::<i16>(), false, &exec);
    compare(&hills::<f32>(), false, &exec);
    compare(&hills::<i32>(), false, &exec);
    compare(&with_holes(&hills::<f32>()), true, &exec);
}

#[test]
fn values_whose_differences_no_number_holds_are_clear_here_and_there() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    let grid = hills::<u8>().grid().clone();
    let value = |i: usize| if i * 2_654_435_761 % 7 < 3 { 3.2e38 } else { -3.1e38_f32 };
    let volume =
        Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(value).collect::<Vec<f32>>())).unwrap();
    let scene = Scene::new(&volume);
    for mode in [Mode::Mip, Mode::Iso { value: 1e38 }] {
        let apart = apart(&by_processor(&scene, &params(mode)), &by_device(&scene, &params(mode), &exec));
        assert!(apart.is_close(&exec), "{mode:?}: {apart:?}");
    }
}

#[test]
fn volumes_that_are_thin_flat_constant_or_far_off_are_close() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    let soft = transfer(false);
    let grids = [[1, 1, 1], [1, 40, 33], [40, 1, 33], [33, 40, 1], [2, 2, 2], [9, 8, 7], [65, 3, 64]];
    for (i, dims) in grids.into_iter().enumerate() {
        let far = if i % 2 == 0 { 1e6 } else { 0.0 };
        let grid = ivd_core::Grid::new(
            dims,
            [1.0, 1.0, 50.0],
            [far; 3],
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        )
        .unwrap();
        for value in [|i: usize| (i * 37 % 256) as u8, |_: usize| 200_u8] {
            let voxels: Vec<u8> = (0..grid.len()).map(value).collect();
            let volume = Volume::new(grid.clone(), Voxels::from(voxels)).unwrap();
            let scene = Scene { transfer: Some(&soft), ..Scene::new(&volume) };
            for projection in [Projection::Orthographic, Projection::Perspective] {
                for mode in MODES {
                    let view = View { projection, ..params(mode).view };
                    let params = RenderParams { view, ..params(mode) };
                    let apart = apart(&by_processor(&scene, &params), &by_device(&scene, &params, &exec));
                    assert!(apart.is_close(&exec), "{dims:?} {mode:?} {projection:?}: {apart:?}");
                }
            }
        }
    }
}

/// Colours by value and gradient: clear where it is flat.
fn steep() -> TransferFunction {
    let entry = |i: usize| {
        let (value, gradient) = ((i % 64) as f32 / 63.0, (i / 64) as f32 / 31.0);
        [value, 0.6, 1.0 - value, 0.5 * value * gradient]
    };
    let by = GradientTable::new(60.0, [64, 32], (0..64 * 32).map(entry).collect()).unwrap();
    transfer(false).with_gradient(by)
}

#[test]
fn colours_by_gradient_and_values_that_fall_are_close() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    let hills = hills::<u8>();
    let moved = twisted(hills.grid());
    let falling = Volume::with_scale(hills.grid().clone(), hills.voxels().clone(), -1.0, 255.0).unwrap();
    let holed = with_holes(&hills);
    for transfer in [transfer(false), steep()] {
        for volume in [&hills, &falling, &holed] {
            for displacement in [None, Some(&moved)] {
                let scene = Scene { transfer: Some(&transfer), displacement, ..Scene::new(volume) };
                for mode in MODES {
                    let (plain, device) =
                        (by_processor(&scene, &params(mode)), by_device(&scene, &params(mode), &exec));
                    let apart = apart(&plain, &device);
                    assert!(apart.is_close(&exec), "{mode:?}: {apart:?}");
                }
            }
        }
    }
}

/// Texts of shaders, and what is planted in their place.
type Planted = &'static [(&'static str, &'static str)];

/// The worst that the comparison of three modes, at rest and moved, finds on a device with something planted in its shaders.
fn worst_with(planted: Planted, modes: &[Mode]) -> Option<f32> {
    let exec = on(gpu(with_planted(planted))?);
    let volume = hills::<u8>();
    let moved = twisted(volume.grid());
    let soft = transfer(false);
    let even = Volume::new(volume.grid().clone(), Voxels::from(vec![90_u8; volume.grid().len()])).unwrap();
    let mut worst = 0.0_f32;
    for (volume, displacement) in [(&volume, None), (&volume, Some(&moved)), (&even, None)] {
        let scene = Scene { transfer: Some(&soft), displacement, ..Scene::new(volume) };
        for mode in modes {
            let apart =
                apart(&by_processor(&scene, &params(*mode)), &by_device(&scene, &params(*mode), &exec));
            worst = worst.max(apart.worst);
        }
    }
    Some(worst)
}

#[test]
fn every_planted_error_is_found() {
    let dvr = &MODES[..1];
    let (mip, iso) = (&MODES[1..2], &MODES[2..3]);
    // What stands in a shader, what is planted there, and where it must be seen.
    let errors: &[(Planted, &[Mode])] = &[
        // A swapped axis.
        (&[("v.x + params.dims.x * (v.y", "v.y + params.dims.x * (v.x")], &MODES[..3]),
        // Half a voxel.
        (
            &[(
                "clamped(at, params.end.xyz) - vec3<f32>(cell)",
                "clamped(at, params.end.xyz) - vec3<f32>(cell) + 0.5",
            )],
            &MODES[..3],
        ),
        // A normal's sign.
        (&[("world * (-1.0 / sqrt(square))", "world * (1.0 / sqrt(square))")], dvr),
        (&[("world * (-1.0 / sqrt(square))", "world * (1.0 / sqrt(square))")], iso),
        // Opacity that isn't corrected for the length of a step.
        (&[("entry = part_of(entry, ray.rest);", "")], dvr),
        // Light that doesn't turn with what is deformed.
        (&[("gradient = pull_back(at, gradient);", "")], dvr),
        // The displacement the other way round.
        (&[("at + turned(", "at - turned(")], &MODES[..3]),
        // A table read one entry on.
        (&[("axis.y) + 0.5;", "axis.y) + 40.5;")], dvr),
        // A ray that ends too soon.
        (&[("c.rgba.w >= params.look.x", "c.rgba.w >= 0.5 * params.look.x")], dvr),
        // A leap that goes too far.
        (&[("end -= 1u;", "break;"), ("u32(max(steps, 0.0)) + 1u", "u32(max(steps, 0.0)) + 9u")], dvr),
        // The surface at the sample instead of between two.
        (&[("halvings >= 16u", "halvings >= 1u")], iso),
        (
            &[(
                "bitcast<f32>(lookup[params.flags.x + brick]) <= greatest",
                "bitcast<f32>(lookup[params.flags.x + brick]) * 0.5 <= greatest",
            )],
            mip,
        ),
    ];
    for (planted, modes) in errors {
        for mode in *modes {
            let Some(worst) = worst_with(planted, &[*mode]) else { return };
            assert!(worst > 4e-3, "{planted:?} isn't seen in {mode:?}: {worst}");
        }
    }
    // And nothing where nothing is planted.
    let worst = worst_with(&[], &MODES[..3]).unwrap();
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn skipping_and_the_run_change_no_bit_on_a_device() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    let volume = hills::<u8>();
    let extras = Extras::new(&volume);
    let hard = transfer(true);
    for (name, scene) in scenes(&volume, &hard, &extras) {
        for mode in MODES {
            let bits = |picture: &super::sides::Device| -> Vec<[u32; 4]> {
                picture.0.rgba.iter().map(|c| c.map(f32::to_bits)).collect()
            };
            let on = by_device(&scene, &params(mode), &exec);
            let again = by_device(&scene, &params(mode), &exec);
            let off = by_device(&scene, &RenderParams { skip: false, ..params(mode) }, &exec);
            assert_eq!(bits(&on), bits(&again), "{name} {mode:?}");
            assert_eq!(bits(&on), bits(&off), "{name} {mode:?}");
            assert!(on.0.skipped > 0 && off.0.skipped == 0);
            assert_eq!(on.0.samples, again.0.samples);
        }
    }
}

#[test]
fn what_has_no_form_here_is_the_processors_and_said() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    let volume = hills::<u8>();
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), ..Scene::new(&volume) };
    let params = RenderParams { classification: Classification::PreIntegrated, ..params(Mode::Dvr) };
    let made = ivd_render::radiance(&scene, &params, &exec).unwrap();
    assert_eq!(exec.take_served()["render/cast"].name(), "cpu");
    assert_eq!(made, ivd_render::radiance(&scene, &params, &Exec::default()).unwrap());
}
