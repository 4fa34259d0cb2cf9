//! Slices and shear-warp against rays: three ways to one picture.

use ivd_core::{Exec, Grid, Labels, TransferFunction, Volume, Voxels};
use ivd_render::{Across, Clip, Error, Mode, Projection, Radiance, RenderParams, Scene, View, radiance};

use crate::pictures::common::{hills, twisted};

const MODES: [Mode; 3] = [
    Mode::Slices { count: None, across: Across::Axis },
    Mode::Slices { count: None, across: Across::View },
    Mode::ShearWarp { count: None },
];

/// A smooth table over 0…255, with two rows.
fn transfer() -> TransferFunction {
    let row = |rgb: [f32; 3]| {
        (0..256).map(move |i| {
            let x = (i as f32 - 60.0).max(0.0) / 195.0;
            [rgb[0], rgb[1], rgb[2], 0.35 * x * x]
        })
    };
    let table = row([0.9, 0.5, 0.2]).chain(row([0.2, 0.6, 0.9])).collect();
    TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0, 2], table, vec![]).unwrap()
}

fn params(view: View) -> RenderParams {
    RenderParams { size: [96, 80], view, annotate: false, ..RenderParams::default() }
}

fn views() -> [View; 4] {
    let far = View { projection: Projection::Perspective, field_of_view: 40.0, ..View::FRONT };
    [
        View::FRONT,
        View { angles: [28.0, 17.0], ..View::FRONT },
        View { angles: [130.0, -40.0], roll: 20.0, zoom: 1.3, ..View::FRONT },
        View { angles: [-65.0, 35.0], ..far },
    ]
}

/// Root of the mean square of the differences of pictures over black, and the share of pixels that differ by more than 8 (levels of 255).
fn apart(a: &Radiance, b: &Radiance) -> (f64, f64) {
    let byte = |c: f32| f64::from(ivd_core::srgb::byte(c.clamp(0.0, 1.0)));
    let (mut squares, mut far) = (0.0, 0);
    for (p, q) in a.rgba.iter().zip(&b.rgba) {
        let differences = [0, 1, 2].map(|c| (byte(p[c]) - byte(q[c])).abs());
        squares += differences.iter().map(|d| d * d).sum::<f64>() / 3.0;
        far += u32::from(differences.iter().any(|d| *d > 8.0));
    }
    let count = a.rgba.len() as f64;
    ((squares / count).sqrt(), f64::from(far) / count)
}

#[test]
fn slices_and_shear_warp_agree_with_rays() {
    let volume = hills::<f32>();
    let grid = volume.grid().clone();
    let (transfer, twist) = (transfer(), twisted(&grid));
    let ids: Vec<u16> = (0..grid.len()).map(|i| if grid.index(i).0[0] < 20 { 1 } else { 2 }).collect();
    let labels = Labels::new(grid, ids.into(), vec![]).unwrap();
    let plain = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    for (scene, what) in [
        (plain, "at rest"),
        (Scene { displacement: Some(&twist), ..plain }, "twisted"),
        (Scene { labels: Some(&labels), ..plain }, "labelled"),
    ] {
        for (shading, view) in
            [(false, views()[1]), (true, views()[0])].into_iter().chain(views().map(|v| (true, v)))
        {
            let asked = RenderParams { shading, ..params(view) };
            let rays =
                radiance(&scene, &RenderParams { step: 0.25, ..asked.clone() }, &Exec::default()).unwrap();
            for mode in MODES {
                let other =
                    radiance(&scene, &RenderParams { mode, ..asked.clone() }, &Exec::default()).unwrap();
                if !shading {
                    let whole = RenderParams { mode, skip: false, ..asked.clone() };
                    let whole = radiance(&scene, &whole, &Exec::default()).unwrap();
                    assert_eq!(whole.rgba, other.rgba, "skipping");
                }
                let (rms, far) = apart(&rays, &other);
                assert!(rms <= 2.0 && far <= 0.01, "{what} {mode:?} {view:?} {shading}: {rms}, {far}");
            }
        }
    }
}

#[test]
fn a_cut_is_seen_alike() {
    let (volume, transfer) = (hills::<f32>(), transfer());
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let middle = volume.grid().world(ivd_core::VoxelCoord(nalgebra::Vector3::new(18.0, 18.0, 14.0))).0;
    let clip = vec![Clip::plane(middle.into(), [0.3, -1.0, 0.1])];
    let asked = RenderParams { clip, ..params(views()[1]) };
    let rays = radiance(&scene, &RenderParams { step: 0.25, ..asked.clone() }, &Exec::default()).unwrap();
    let whole = radiance(&scene, &params(views()[1]), &Exec::default()).unwrap();
    assert!(apart(&rays, &whole).0 > 8.0, "the cut shows");
    for mode in MODES {
        let other = radiance(&scene, &RenderParams { mode, ..asked.clone() }, &Exec::default()).unwrap();
        let (rms, far) = apart(&rays, &other);
        assert!(rms <= 3.0 && far <= 0.03, "{mode:?}: {rms}, {far}");
    }
}

#[test]
fn a_slab_across_the_slices_is_exact_with_any_number_of_them() {
    let grid = Grid::with_spacing([16, 10, 6], [1.0, 0.7, 3.0]).unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![0.5_f32; grid.len()])).unwrap();
    let opacity = |i: usize| (1.0 - (-0.26 * i as f64 / 4096.0).exp()) as f32;
    let table = (0..=4096).map(|i| [1.0, 1.0, 1.0, opacity(i)]).collect();
    let transfer = TransferFunction::new([0.0, 1.0], 4097, 1.3, vec![0], table, vec![]).unwrap();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    for (angles, thickness) in
        [([0.0, 0.0], 7.0), ([90.0, 0.0], 16.0), ([0.0, 90.0], 18.0), ([180.0, 0.0], 7.0)]
    {
        for count in [1, 3, 40] {
            for mode in [
                Mode::Slices { count: Some(count), across: Across::Axis },
                Mode::Slices { count: Some(count), across: Across::View },
                Mode::ShearWarp { count: Some(count) },
            ] {
                let view = View { angles, ..View::FRONT };
                let asked = RenderParams {
                    mode,
                    view,
                    size: [33; 2],
                    termination: 2.0,
                    shading: false,
                    ..params(view)
                };
                let picture = radiance(&scene, &asked, &Exec::default()).unwrap();
                let (alpha, truth) =
                    (f64::from(picture.rgba[16 + 33 * 16][3]), 1.0 - (-0.1_f64 * thickness).exp());
                assert!((alpha - truth).abs() < 2e-5, "{mode:?} {angles:?}: {alpha} for {truth}");
            }
        }
    }
}

#[test]
fn more_slices_come_nearer_to_the_rays() {
    let (volume, transfer) = (hills::<f32>(), transfer());
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let asked = params(views()[1]);
    let rays = radiance(&scene, &RenderParams { step: 0.05, ..asked.clone() }, &Exec::default()).unwrap();
    let off = |mode| {
        let other = radiance(&scene, &RenderParams { mode, ..asked.clone() }, &Exec::default()).unwrap();
        let squares: f64 =
            rays.rgba.iter().zip(&other.rgba).map(|(p, q)| f64::from(p[0] - q[0]).powi(2)).sum();
        squares.sqrt()
    };
    for across in [Across::Axis, Across::View] {
        let errors = [9, 36, 144].map(|count| off(Mode::Slices { count: Some(count), across }));
        assert!(errors[1] < 0.5 * errors[0] && errors[2] < 0.5 * errors[1], "{across:?}: {errors:?}");
    }
    let errors = [9, 36, 144].map(|count| off(Mode::ShearWarp { count: Some(count) }));
    assert!(errors[1] < errors[0] && errors[2] < errors[1], "{errors:?}");
}

#[test]
fn an_eye_among_the_slices_is_refused_by_shear_warp_alone() {
    let (volume, transfer) = (hills::<f32>(), transfer());
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let view = View { projection: Projection::Perspective, distance: Some(2.0), ..View::FRONT };
    let asked = |mode| RenderParams { mode, ..params(view) };
    let shear_warp = radiance(&scene, &asked(Mode::ShearWarp { count: None }), &Exec::default());
    assert_eq!(shear_warp.unwrap_err(), Error::EyeAmongSlices);
    radiance(&scene, &asked(MODES[0]), &Exec::default()).unwrap();
    let before =
        RenderParams { classification: ivd_render::Classification::PreIntegrated, ..asked(MODES[0]) };
    assert!(radiance(&scene, &before, &Exec::default()).unwrap_err().to_string().contains("classification"));
}

#[test]
fn many_slices_lose_nothing_a_long_step_is_of_no_account_and_numbers_out_of_bounds_are_refused() {
    let grid = Grid::with_spacing([2100, 200, 1], [1.0; 3]).unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![1.0_f32; grid.len()])).unwrap();
    let table = vec![[1.0, 1.0, 1.0, 0.97]; 2];
    let transfer = TransferFunction::new([0.0, 1.0], 2, 1.0, vec![0], table, vec![]).unwrap();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let view = View { angles: [0.0, 90.0], ..View::FRONT };
    let asked = |mode| RenderParams { mode, size: [128, 16], step: 10.0, shading: false, ..params(view) };
    // Three slices of one voxel ask for more pixels than the picture in between has.
    let many = Mode::ShearWarp { count: Some(3) };
    for mode in MODES.into_iter().chain([many]) {
        let picture =
            radiance(&scene, &RenderParams { termination: 2.0, ..asked(mode) }, &Exec::default()).unwrap();
        for column in [14, 64, 114] {
            let alpha = picture.rgba[column + 128 * 8][3];
            assert!((alpha - 0.97).abs() < 1e-4, "{mode:?} at {column}: {alpha}");
        }
    }
    for count in [0, usize::MAX] {
        let across = Across::View;
        for mode in [Mode::ShearWarp { count: Some(count) }, Mode::Slices { count: Some(count), across }] {
            let refused = radiance(&scene, &asked(mode), &Exec::default()).unwrap_err();
            assert!(refused.to_string().contains("slices"), "{refused}");
        }
    }
}
