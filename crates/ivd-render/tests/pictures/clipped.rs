//! Pictures clipped by planes and boxes.

use ivd_core::{Exec, Grid, TransferFunction, Volume, Voxels};
use ivd_render::{
    Classification, Clip, ClipSpace, Fit, Mode, Prepared, Projection, Radiance, RenderParams, Scene, View,
    radiance,
};
use nalgebra::Vector3;

use super::common::{displacement, hills, sampled, twisted};

fn exec() -> Exec {
    Exec::default()
}

fn plain_loop() -> Exec {
    let mut exec = Exec::default();
    exec.simd = false;
    exec
}

/// From the front, without light and end.
fn measuring(clip: Vec<Clip>) -> RenderParams {
    RenderParams {
        size: [33; 2],
        view: View::FRONT,
        fit: Fit::Volume,
        termination: 2.0,
        shading: false,
        annotate: false,
        clip,
        ..RenderParams::default()
    }
}

/// Optical depth 0.1 a millimetre at value 1, white; clear at 0.
fn absorbing() -> TransferFunction {
    let opacity = (1.0 - (-0.1_f64).exp()) as f32;
    let table = vec![[1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, opacity]];
    TransferFunction::new([0.0, 1.0], 2, 1.0, vec![0], table, vec![]).unwrap()
}

fn slab() -> Volume {
    let grid = Grid::with_spacing([30, 24, 20], [1.0, 0.7, 1.6]).unwrap();
    Volume::new(grid.clone(), Voxels::from(vec![1.0_f32; grid.len()])).unwrap()
}

#[test]
fn a_slab_is_cut_to_its_length_whatever_the_step_the_plane_and_the_classification() {
    let (volume, transfer) = (slab(), absorbing());
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    // The middle ray runs from y = 16.45 to −0.35 at x = 14.5, z = 15.2.
    let askew = Clip::plane([14.5, 9.13, 15.2], [0.3, -1.0, 0.2]);
    let cases = [
        (vec![], 16.8),
        (vec![Clip::plane([0.0, 9.13, 0.0], [0.0, -2.0, 0.0])], 9.48),
        (vec![Clip::plane([0.0, 9.13, 0.0], [0.0, 1e-9, 0.0])], 7.32),
        (vec![askew], 9.48),
        (vec![Clip::cuboid([3.0, 2.04, 3.0], [20.0, 7.11, 20.0])], 5.07),
        (vec![askew, Clip::cuboid([3.0, 2.04, 3.0], [20.0, 70.0, 20.0])], 7.09),
        (
            vec![
                Clip::plane([0.0, 9.13, 0.0], [0.0, -1.0, 0.0]),
                Clip::plane([0.0, 9.2, 0.0], [0.0, 1.0, 0.0]),
            ],
            0.0,
        ),
        (vec![Clip::cuboid([20.0, 0.0, 0.0], [25.0, 30.0, 30.0])], 0.0),
        // Shorter than a step.
        (vec![Clip::cuboid([0.0, 3.0, 0.0], [25.0, 3.1, 30.0])], 0.1),
    ];
    for (clip, length) in cases {
        for step in [0.13, 0.5, 1.0, 3.7] {
            for classification in [Classification::Post, Classification::PreIntegrated] {
                for shading in [false, true] {
                    let params = RenderParams { step, classification, shading, ..measuring(clip.clone()) };
                    let picture = radiance(&scene, &params, &exec()).unwrap();
                    let (found, truth) =
                        (f64::from(picture.rgba[16 + 33 * 16][3]), 1.0 - (-0.1_f64 * length).exp());
                    assert!((found - truth).abs() < 1e-3, "{found} for {truth}: {clip:?}, step {step}");
                }
            }
        }
    }
}

#[test]
fn a_cut_face_is_lit_as_its_plane_lies() {
    // The distance to a ball's surface, so that every isosurface inside is a sphere; cut towards the eye.
    let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
    let middle = Vector3::repeat(19.5);
    let volume = sampled(&grid, |at| 15.0 - (at - middle).norm());
    let opaque =
        TransferFunction::new([-30.0, 15.0], 2, 0.1, vec![0], vec![[1.0, 1.0, 1.0, 1.0]; 2], vec![]).unwrap();
    let opaque = Scene { transfer: Some(&opaque), ..Scene::new(&volume) };
    let white = [1.0; 3];
    let surface = Scene::new(&volume);
    // Along the view, and askew: the eye is towards +y, up +z, right −x.
    for normal in [[0.0, -1.0, 0.0], [0.5, -1.0, 0.3]] {
        let outward: Vector3<f64> = -Vector3::from(normal).normalize();
        let lamp = Vector3::new(0.35, 1.0, 0.45).normalize();
        let halfway = (lamp + Vector3::y()).normalize();
        let wrapped: f64 = 0.5 + 0.5 * outward.dot(&lamp);
        let light =
            (0.25 + 0.75 * wrapped * wrapped + 0.18 * f64::powi(outward.dot(&halfway).max(0.0), 32)).min(1.0);
        let clip = vec![Clip::plane([19.5, 22.0, 19.5], normal)];
        for (scene, mode) in [(&opaque, Mode::Dvr), (&surface, Mode::Iso { value: 3.0 })] {
            for classification in [Classification::Post, Classification::PreIntegrated] {
                let params = RenderParams {
                    mode,
                    classification,
                    shading: true,
                    surface: white,
                    ..measuring(clip.clone())
                };
                for exec in [exec(), plain_loop()] {
                    let found = radiance(scene, &params, &exec).unwrap().rgba[16 + 33 * 16];
                    assert!(
                        found[3] > 0.999 && (f64::from(found[0]) - light).abs() < 1e-3,
                        "{mode:?}: {found:?}, {light}"
                    );
                }
            }
        }
        // Beside the cut the surface is the ball's own.
        let prepared_at = |clip| {
            let params = RenderParams { mode: Mode::Iso { value: 3.0 }, clip, ..measuring(vec![]) };
            Prepared::new(&surface, &params, &exec()).unwrap().pick(View::FRONT, [16, 16]).unwrap().unwrap()
        };
        let [cut, whole] = [prepared_at(clip.clone()), prepared_at(vec![])];
        assert!((whole.place[1] - 31.5).abs() < 0.04, "{whole:?}");
        assert!((cut.place[1] - 22.0).abs() < 1e-3 && cut.value.unwrap() > 11.0, "{cut:?}");
    }
}

fn bits(picture: &Radiance) -> Vec<[u32; 4]> {
    picture.rgba.iter().map(|c| c.map(f32::to_bits)).collect()
}

/// Every mode, and steps between values.
fn looks() -> Vec<(Mode, Classification, bool)> {
    let post = Classification::Post;
    let mut looks = vec![
        (Mode::Dvr, post, true),
        (Mode::Dvr, post, false),
        (Mode::Dvr, Classification::PreIntegrated, true),
        (Mode::Iso { value: 120.0 }, post, true),
    ];
    let projections = [
        Mode::Mip,
        Mode::Minip,
        Mode::Mean,
        Mode::Lmip { threshold: None },
        Mode::AttenuatedMip { attenuation: 10.0 },
    ];
    looks.extend(projections.map(|mode| (mode, post, false)));
    looks
}

fn ramp() -> TransferFunction {
    let table = (0..256).map(|i| [0.9, 0.5, 0.2, if i > 60 { i as f32 / 600.0 } else { 0.0 }]).collect();
    TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0], table, vec![]).unwrap()
}

#[test]
fn skipping_lanes_and_threads_change_no_byte_of_a_clipped_picture() {
    fn of(volume: &Volume) {
        let grid = volume.grid();
        let transfer = ramp();
        let twist = twisted(grid);
        let middle = grid.world(ivd_core::VoxelCoord(Vector3::new(22.0, 18.0, 14.0))).0;
        let clip = vec![
            Clip::plane(middle.into(), [0.4, -1.0, 0.2]),
            Clip::cuboid((middle - Vector3::repeat(11.3)).into(), (middle + Vector3::repeat(12.1)).into()),
        ];
        for displacement in [None, Some(&twist)] {
            for clip_space in [ClipSpace::Deformed, ClipSpace::Rest] {
                for projection in [Projection::Orthographic, Projection::Perspective] {
                    for (mode, classification, shading) in looks() {
                        let scene = Scene { transfer: Some(&transfer), displacement, ..Scene::new(volume) };
                        let view = View { angles: [21.0, 12.0], projection, ..View::FRONT };
                        let params = RenderParams {
                            mode,
                            classification,
                            shading,
                            clip_space,
                            view,
                            size: [45, 37],
                            termination: 0.99,
                            ..measuring(clip.clone())
                        };
                        let found = radiance(&scene, &params, &exec()).unwrap();
                        let off = RenderParams { skip: false, ..params.clone() };
                        for other in [
                            radiance(&scene, &off, &exec()),
                            radiance(&scene, &params, &plain_loop()),
                            radiance(&scene, &params, &Exec::default().with_threads(3)),
                        ] {
                            assert!(bits(&found) == bits(&other.unwrap()), "{mode:?} {clip_space:?}");
                        }
                        let whole = RenderParams { clip: vec![], ..params };
                        let whole = radiance(&scene, &whole, &exec()).unwrap();
                        assert!(bits(&found) != bits(&whole), "{mode:?}");
                    }
                }
            }
        }
    }
    of(&hills::<u8>());
    of(&hills::<f32>());
}

#[test]
fn a_picture_that_is_cut_beside_the_volume_is_the_whole_one_bit_for_bit() {
    let volume = hills::<u8>();
    let transfer = ramp();
    let twist = twisted(volume.grid());
    let beside =
        vec![Clip::cuboid([-1e3, -1e3, 9e3], [1e3, 1e3, 2e4]), Clip::plane([500.0; 3], [-1.0, 0.0, 0.0])];
    for displacement in [None, Some(&twist)] {
        for clip_space in [ClipSpace::Deformed, ClipSpace::Rest] {
            for (mode, classification, shading) in looks() {
                let scene = Scene { transfer: Some(&transfer), displacement, ..Scene::new(&volume) };
                let params = RenderParams { mode, classification, shading, clip_space, ..measuring(vec![]) };
                let whole = radiance(&scene, &params, &exec()).unwrap();
                let clipped = RenderParams { clip: beside.clone(), ..params };
                assert!(bits(&radiance(&scene, &clipped, &exec()).unwrap()) == bits(&whole), "{mode:?}");
            }
        }
    }
}

#[test]
fn a_cut_at_rest_moves_along_and_one_where_the_body_is_stays() {
    // Everything is seen 5 mm further up: what comes from z − 5.
    let grid = Grid::with_spacing([20, 20, 40], [1.0; 3]).unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![1.0_f32; grid.len()])).unwrap();
    let moved = displacement(&grid, |_| Some(Vector3::new(0.0, 0.0, -5.0)));
    let transfer = absorbing();
    let scene = Scene { transfer: Some(&transfer), displacement: Some(&moved), ..Scene::new(&volume) };
    for mode in [Mode::Dvr, Mode::Mip, Mode::Iso { value: 0.5 }] {
        for (clip_space, top) in [(ClipSpace::Deformed, 20.0), (ClipSpace::Rest, 25.0)] {
            let clip = vec![Clip::plane([0.0, 0.0, 20.0], [0.0, 0.0, -1.0])];
            let params = RenderParams { mode, clip_space, size: [41, 81], ..measuring(clip) };
            let prepared = Prepared::new(&scene, &params, &exec()).unwrap();
            let picture = prepared.radiance(View::FRONT, &exec()).unwrap();
            // Rows of the middle column, half a sphere's diameter of 49 mm across 41 pixels.
            let pixel = (20.0_f64 * 20.0 * 2.0 + 1600.0).sqrt() / 41.0;
            for row in 0..81 {
                let z = 19.5 + (40.0 - row as f64) * pixel;
                let seen = picture.rgba[20 + 41 * row][3] > 0.0;
                let low = 4.5;
                if (z - top).abs() > 0.1 && (z - low).abs() > 0.1 {
                    assert_eq!(seen, z < top && z > low, "{mode:?} {clip_space:?}: {z}");
                }
            }
        }
    }
}

#[test]
fn a_cut_at_rest_is_met_and_lit_where_the_deformation_brought_it() {
    let grid = Grid::with_spacing([24; 3], [1.0; 3]).unwrap();
    let values = vec![1.0_f32; grid.len()];
    let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
    // A shear: what is at y comes from y − 0.25 (x − 12).
    let shear = displacement(&grid, |at| Some(Vector3::new(0.0, -0.25 * (at.x - 12.0), 0.0)));
    let scene = Scene { displacement: Some(&shear), ..Scene::new(&volume) };
    let clip = vec![Clip::plane([0.0, 11.3, 0.0], [0.0, -1.0, 0.0])];
    let params = RenderParams {
        mode: Mode::Iso { value: 0.5 },
        clip_space: ClipSpace::Rest,
        surface: [1.0; 3],
        ..measuring(clip)
    };
    let prepared = Prepared::new(&scene, &params, &exec()).unwrap();
    let pick = prepared.pick(View::FRONT, [14, 15]).unwrap().unwrap();
    let [x, y, _] = pick.place;
    assert!((y - (11.3 + 0.25 * (x - 12.0))).abs() < 1e-3, "{pick:?}");
    assert!((pick.rest[1] - 11.3).abs() < 1e-3, "{pick:?}");
    let outward: Vector3<f64> = Vector3::new(-0.25, 1.0, 0.0).normalize();
    let lamp = Vector3::new(0.35, 1.0, 0.45).normalize();
    let halfway = (lamp + Vector3::y()).normalize();
    let wrapped: f64 = 0.5 + 0.5 * outward.dot(&lamp);
    let light = (0.25 + 0.75 * wrapped * wrapped + 0.18 * f64::powi(outward.dot(&halfway), 32)).min(1.0);
    let found = prepared.radiance(View::FRONT, &exec()).unwrap().rgba[14 + 33 * 15];
    assert!((f64::from(found[0]) - light).abs() < 2e-3, "{found:?} for {light}");
}
