//! The comparison of pictures must be able to fail: each of four classic mistakes, made on purpose, is found.

use ivd_core::{Exec, Grid, TransferFunction, Volume, Voxels};
use ivd_render::{RenderParams, Scene, View, difference, render};
use nalgebra::Vector3;

use crate::pictures::common::sampled;

/// A threshold under which two pictures of the same scene count as one: two renderers that agree differ by rounding.
const SAME: u8 = 2;

fn body(at: Vector3<f64>) -> f64 {
    let ball = |centre: [f64; 3], radius: f64| radius - (at - Vector3::from(centre)).norm();
    let inside = ball([15.0, 13.0, 18.0], 9.0).max(ball([20.0, 22.0, 10.0], 6.0));
    (50.0 + 20.0 * inside).clamp(0.0, 100.0)
}

fn grid() -> Grid {
    Grid::with_spacing([32; 3], [1.0; 3]).unwrap()
}

fn transfer(reference_mm: f64) -> TransferFunction {
    let table = (0..101).map(|i| [0.9, 0.7, 0.4, if i > 40 { 0.25 } else { 0.0 }]).collect();
    TransferFunction::new([0.0, 100.0], 101, reference_mm, vec![0], table, vec![]).unwrap()
}

fn picture(volume: &Volume, transfer: &TransferFunction, step: f64) -> ivd_core::Image {
    let scene = Scene { transfer: Some(transfer), ..Scene::new(volume) };
    let view = View { angles: [25.0, 20.0], ..View::FRONT };
    let params = RenderParams { size: [64; 2], step, view, annotate: false, ..RenderParams::default() };
    render(&scene, &params, &Exec::default()).unwrap().image
}

fn reference() -> ivd_core::Image {
    picture(&sampled(&grid(), body), &transfer(1.0), 0.25)
}

fn apart(other: &ivd_core::Image) -> (u8, f64) {
    let found = difference(&reference(), other).unwrap();
    (found.max, found.mean)
}

#[test]
fn the_same_scene_at_another_origin_and_stored_as_f64_is_found_equal() {
    let far = [1000.0, -2000.0, 500.0];
    let moved = Grid::new([32; 3], [1.0; 3], far, grid().direction()).unwrap();
    let near = sampled(&moved, |at| body(at - Vector3::from(far)));
    let wide: Vec<f64> = near.to_array().t().iter().copied().collect();
    let volume = Volume::new(moved, Voxels::from(wide)).unwrap();
    let (max, _) = apart(&picture(&volume, &transfer(1.0), 0.25));
    assert!(max <= SAME, "{max}");
}

#[test]
fn a_swapped_axis_is_found() {
    let swapped = sampled(&grid(), |at| body(Vector3::new(at.y, at.x, at.z)));
    let (max, mean) = apart(&picture(&swapped, &transfer(1.0), 0.25));
    assert!(max > 10 * SAME && mean > 1.0, "{max}, {mean}");
}

#[test]
fn a_shift_by_half_a_voxel_is_found() {
    let shifted = sampled(&grid(), |at| body(at - Vector3::new(0.5, 0.0, 0.0)));
    let (max, _) = apart(&picture(&shifted, &transfer(1.0), 0.25));
    assert!(max > 5 * SAME, "{max}");
}

#[test]
fn a_wrong_sign_of_the_normal_is_found() {
    // The same opacities over the negated value: all that changes is the side that gradients point to.
    let negated = sampled(&grid(), |at| -body(at));
    let mirrored: Vec<[f32; 4]> = transfer(1.0).table().iter().rev().copied().collect();
    let mirrored = TransferFunction::new([-100.0, 0.0], 101, 1.0, vec![0], mirrored, vec![]).unwrap();
    let (max, mean) = apart(&picture(&negated, &mirrored, 0.25));
    assert!(max > 10 * SAME && mean > 1.0, "{max}, {mean}");
}

#[test]
fn a_missing_opacity_correction_is_found() {
    // Halving the step without correcting for it is what doubling the reference length's inverse does.
    let (max, mean) = apart(&picture(&sampled(&grid(), body), &transfer(0.5), 0.25));
    assert!(max > 5 * SAME && mean > 0.5, "{max}, {mean}");
    // With the correction another step is nearly the same picture.
    let (_, mean) = apart(&picture(&sampled(&grid(), body), &transfer(1.0), 0.125));
    assert!(mean < 0.5, "{mean}");
}
