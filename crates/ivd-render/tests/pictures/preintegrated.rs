//! Pre-integrated pictures against ones of very fine steps, and what must not change a byte of them.

use crate::pictures::common::{hills, sampled, twisted};
use ivd_core::{Exec, Grid, Labels, TransferFunction, Volume};
use ivd_render::{Classification, Error, Radiance, RenderParams, Scene, View, radiance};
use nalgebra::Vector3;

/// Two thin shells of values, one before the other, in a smooth hill, and a faint inside.
fn shells() -> (Volume, TransferFunction) {
    let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
    let volume = sampled(&grid, |at| {
        let from = at - Vector3::new(19.5, 19.5, 19.5);
        (200.0 * (-from.norm_squared() / 250.0).exp()).max(1.0)
    });
    let table = (0..2048)
        .map(|i| match i * 200 / 2048 {
            40..=42 => [1.0, 0.3, 0.1, 0.5],
            90..=91 => [0.1, 0.9, 0.2, 0.7],
            140.. => [0.2, 0.3, 1.0, 0.1],
            _ => [0.0; 4],
        })
        .collect();
    (volume, TransferFunction::new([0.0, 200.0], 2048, 1.0, vec![0], table, vec![]).unwrap())
}

fn params(classification: Classification, step: f64) -> RenderParams {
    let view = View { angles: [28.0, 17.0], zoom: 1.3, ..View::FRONT };
    let picture =
        RenderParams { size: [64, 60], view, annotate: false, shading: false, ..RenderParams::default() };
    RenderParams { classification, step, termination: 2.0, ..picture }
}

/// Root mean square over pixels and channels.
fn apart(a: &Radiance, b: &Radiance) -> f64 {
    let squares = a.rgba.iter().flatten().zip(b.rgba.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / (4 * a.rgba.len()) as f64).sqrt()
}

#[test]
fn steps_of_a_voxel_are_nearer_to_the_truth_than_quarter_steps_by_the_middle() {
    let (volume, transfer) = shells();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let picture =
        |classification, step| radiance(&scene, &params(classification, step), &Exec::default()).unwrap();
    let truth = picture(Classification::Post, 1.0 / 64.0);
    let post = apart(&picture(Classification::Post, 0.25), &truth);
    let pre = apart(&picture(Classification::PreIntegrated, 1.0), &truth);
    assert!(pre <= post, "{pre} for {post}");
    let coarse = apart(&picture(Classification::Post, 1.0), &truth);
    assert!(coarse > 4.0 * pre, "{coarse} for {pre}");
    // And it converges to the same picture.
    let finer = apart(&picture(Classification::PreIntegrated, 0.25), &truth);
    assert!(finer < 0.5 * pre, "{finer} for {pre}");
}

fn bits(picture: &Radiance) -> Vec<[u32; 4]> {
    picture.rgba.iter().map(|c| c.map(f32::to_bits)).collect()
}

#[test]
fn skipping_lanes_and_threads_change_no_byte() {
    let grid = Grid::new(
        [90, 80, 70],
        [0.8, 1.0, 1.1],
        [-20.0, 30.0, 1e4],
        [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    )
    .unwrap();
    let middle = grid.world(ivd_core::VoxelCoord(Vector3::new(44.5, 39.5, 34.5))).0;
    let volume = sampled(&grid, |at| (250.0 * (-(at - middle).norm_squared() / 120.0).exp()).floor());
    let displacement = twisted(&grid);
    let ramp = |i: i32| if i > 90 && !(150..160).contains(&i) { i as f32 / 1000.0 } else { 0.0 };
    let table = (0..256).map(|i| [0.9, 0.4, 0.1, ramp(i)]).collect();
    let transfer = TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0], table, vec![]).unwrap();
    for displacement in [None, Some(&displacement)] {
        let scene = Scene { transfer: Some(&transfer), displacement, ..Scene::new(&volume) };
        for (step, shading) in [(0.5, true), (1.7, false), (9.5, true)] {
            let params =
                RenderParams { shading, termination: 0.9, ..params(Classification::PreIntegrated, step) };
            let of = |params: &RenderParams, exec: &Exec| radiance(&scene, params, exec).unwrap();
            let on = of(&params, &Exec::default());
            let off = of(&RenderParams { skip: false, ..params.clone() }, &Exec::default());
            assert_eq!(bits(&on), bits(&off), "step {step}");
            assert!(on.skipped > 0 && on.rgba.iter().any(|c| c[3] > 0.1));
            let plain = of(&params, &Exec::default().with_simd(false).with_threads(1));
            assert_eq!(bits(&on), bits(&plain), "step {step}");
        }
    }
}

#[test]
fn rows_by_label_are_refused() {
    let volume = hills::<u8>();
    let row = |alpha: f32| (0..4).map(move |_| [1.0, 1.0, 1.0, alpha]);
    let table = row(0.1).chain(row(0.9)).collect();
    let transfer = TransferFunction::new([0.0, 255.0], 4, 1.0, vec![0, 1], table, vec![]).unwrap();
    let labels = Labels::new(volume.grid().clone(), vec![1; volume.grid().len()].into(), vec![]).unwrap();
    let scene = Scene { transfer: Some(&transfer), labels: Some(&labels), ..Scene::new(&volume) };
    let refused = radiance(&scene, &params(Classification::PreIntegrated, 0.5), &Exec::default());
    assert_eq!(refused.unwrap_err(), Error::NotByValue);
}
