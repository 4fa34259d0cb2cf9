//! Deformed volumes against the picture of the function deformed in closed form.

use ivd_core::{Displacement, Exec, Grid, TransferFunction, Volume};
use ivd_render::{Fit, Mode, Radiance, RenderParams, Scene, View, radiance};
use nalgebra::{Rotation3, Vector3};

use crate::pictures::common::{displacement, sampled};

/// A smooth lopsided density, 0…1, about (20, 20, 20) mm.
fn density(at: Vector3<f64>) -> f64 {
    let ball = |centre: [f64; 3], width: f64| {
        (-(at - Vector3::from(centre)).norm_squared() / (2.0 * width * width)).exp()
    };
    (ball([20.0, 20.0, 20.0], 5.0) + 0.7 * ball([27.0, 17.0, 24.0], 4.0)).min(1.0)
}

fn grid() -> Grid {
    let (s, c) = 0.2_f64.sin_cos();
    let direction = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, -1.0]];
    Grid::new([64, 60, 56], [0.75, 0.75, 0.8], [1.0, -6.0, 42.0], direction).unwrap()
}

fn transfer() -> TransferFunction {
    let table = (0..=512)
        .map(|i| i as f32 / 512.0)
        .map(|v| [v, 0.6, 1.0 - v, if v > 0.1 { 0.25 * (v - 0.1) } else { 0.0 }])
        .collect();
    TransferFunction::new([0.0, 1.2], 513, 1.0, vec![0], table, vec![]).unwrap()
}

fn picture(volume: &Volume, displacement: Option<&Displacement>, mode: Mode, shading: bool) -> Radiance {
    let transfer = transfer();
    let scene = Scene { transfer: Some(&transfer), displacement, ..Scene::new(volume) };
    let view = View { angles: [40.0, 30.0], zoom: 1.4, ..View::FRONT };
    // By the volume: pictures of different scenes are compared.
    let params = RenderParams {
        size: [60; 2],
        view,
        fit: Fit::Volume,
        mode,
        shading,
        termination: 2.0,
        ..RenderParams::default()
    };
    radiance(&scene, &params, &Exec::default()).unwrap()
}

fn worst(a: &Radiance, b: &Radiance) -> f32 {
    let far = |(p, q): (&[f32; 4], &[f32; 4])| (0..4).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max);
    a.rgba.iter().zip(&b.rgba).map(far).fold(0.0, f32::max)
}

/// ψ of a twist about z through (20, 20, 20) mm that falls smoothly to nothing at 15 mm.
fn untwist(at: Vector3<f64>) -> Vector3<f64> {
    let centre = Vector3::new(20.0, 20.0, 20.0);
    let from = at - centre;
    let near = (1.0 - from.norm_squared() / 225.0).max(0.0);
    centre + Rotation3::from_axis_angle(&Vector3::z_axis(), 1.2 * near * near) * from
}

#[test]
fn a_twisted_density_equals_the_density_behind_the_inverse_map() {
    let grid = grid();
    let moved = displacement(&grid, |at| {
        let shift = untwist(at) - at;
        (shift.norm() > 0.0).then_some(shift)
    });
    let truth = sampled(&grid, |at| density(untwist(at)));
    let rest = sampled(&grid, density);
    // Lit samples at the top of a hill have no sure normal.
    for (shading, tolerance) in [(false, 1.2e-2), (true, 5e-2)] {
        let shown = picture(&rest, Some(&moved), Mode::Dvr, shading);
        let expected = picture(&truth, None, Mode::Dvr, shading);
        let apart = worst(&shown, &expected);
        let still = worst(&picture(&rest, None, Mode::Dvr, shading), &expected);
        assert!(apart < tolerance && still > 5.0 * apart, "{apart}, undeformed {still}, shading {shading}");
    }
}

#[test]
fn lit_surfaces_of_a_twisted_density_have_the_twisted_normals() {
    let grid = grid();
    let moved = displacement(&grid, |at| Some(untwist(at) - at));
    let truth = sampled(&grid, |at| density(untwist(at)));
    let rest = sampled(&grid, density);
    let mode = Mode::Iso { value: 0.4 };
    let (shown, expected) = (picture(&rest, Some(&moved), mode, true), picture(&truth, None, mode, true));
    // Without the outline, where a pixel more or less is covered.
    let apart: Vec<f32> = shown
        .rgba
        .iter()
        .zip(&expected.rgba)
        .filter(|(p, q)| p[3] == 1.0 && q[3] == 1.0)
        .map(|(p, q)| (0..3).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max))
        .collect();
    let mean = apart.iter().sum::<f32>() / apart.len() as f32;
    assert!(apart.len() > 200 && mean < 4e-3, "{mean} over {} pixels", apart.len());
}

#[test]
fn a_translated_volume_is_the_volume_on_a_translated_grid() {
    let grid = grid();
    // Two voxels along x and one along z: the map is exact at every sample.
    let shift = grid.linear_part() * Vector3::new(2.0, 0.0, 1.0);
    let moved = displacement(&grid, |_| Some(-shift));
    let rest = sampled(&grid, density);
    let truth = sampled(&grid, |at| density(at - shift));
    let apart =
        worst(&picture(&rest, Some(&moved), Mode::Dvr, true), &picture(&truth, None, Mode::Dvr, true));
    assert!(apart < 1e-3, "{apart}");
}

#[test]
fn vacated_voxels_are_clear() {
    let grid = grid();
    let rest = sampled(&grid, density);
    let moved = displacement(&grid, |_| None).with_vacated(vec![1; grid.len()].into()).unwrap();
    let shown = picture(&rest, Some(&moved), Mode::Dvr, false);
    assert!(shown.rgba.iter().all(|c| c[3] == 0.0));
}
