//! Isosurfaces that are seen through.

use crate::pictures::common::{hills, twisted};
use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_render::{Clip, Fit, Mode, Radiance, RenderParams, Scene, Shell, View, radiance};
use nalgebra::Vector3;

/// Distance below a ball's surface, so that shells are balls.
fn ball(radius: f64) -> Volume {
    let grid = Grid::with_spacing([48; 3], [1.0; 3]).unwrap();
    let centre = Vector3::repeat(23.5);
    let value = |i: usize| (radius - (grid.world(grid.index(i).into()).0 - centre).norm()) as f32;
    Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(value).collect::<Vec<_>>())).unwrap()
}

fn shell(iso: f64, opacity: f64) -> Shell {
    Shell { iso, opacity, ..Shell::default() }
}

fn params(iso: f64, shells: &[Shell]) -> RenderParams {
    RenderParams {
        size: [65; 2],
        view: View::FRONT,
        fit: Fit::Volume,
        mode: Mode::Iso { value: iso },
        shells: shells.to_vec(),
        termination: 2.0,
        step: 0.25,
        ..RenderParams::default()
    }
}

fn seen(volume: &Volume, params: &RenderParams) -> Radiance {
    radiance(&Scene::new(volume), params, &Exec::default()).unwrap()
}

#[test]
fn a_film_round_a_ball_has_the_opacity_of_both_its_sides_by_the_angle() {
    // A ball of 6 that hides, in one of 16 and one of 19 that are seen through.
    let volume = ball(6.0);
    let films = [(16.0, 0.2), (19.0, 0.35)];
    let shells: Vec<Shell> = films.iter().map(|(radius, opacity)| shell(6.0 - radius, *opacity)).collect();
    let found = seen(&volume, &params(0.0, &shells));
    // The sphere round the volume fits across the picture.
    let pixel = 48.0 * 3.0_f64.sqrt() / 65.0;
    let mut worst = 0.0_f64;
    for (i, rgba) in found.rgba.iter().enumerate() {
        let beside = pixel * ((i % 65) as f64 - 32.0).hypot((i / 65) as f64 - 32.0);
        // At a rim a ray is the more opaque the nearer it is: not where a thousandth of a voxel decides.
        if films.iter().any(|(radius, _)| (0.93..1.01).contains(&(beside / radius)))
            || (5.8..6.2).contains(&beside)
        {
            continue;
        }
        let passes = if beside < 6.0 { 1.0 } else { 2.0 };
        let through = films.iter().filter(|(radius, _)| beside < *radius).map(|(radius, opacity)| {
            let cosine = (1.0 - (beside / radius).powi(2)).sqrt();
            (1.0 - opacity).powf(passes / cosine)
        });
        let truth = if beside < 6.0 { 1.0 } else { 1.0 - through.product::<f64>() };
        worst = worst.max((f64::from(rgba[3]) - truth).abs());
    }
    assert!(worst < 3e-3, "{worst}");
}

#[test]
fn what_lies_behind_a_film_is_seen_through_it_in_its_own_light() {
    let volume = ball(6.0);
    let colour = [0.1, 0.9, 0.2];
    let inner = seen(&volume, &params(0.0, &[]));
    let outer = seen(&volume, &RenderParams { surface: colour, ..params(-10.0, &[]) });
    let both = seen(&volume, &params(0.0, &[Shell { colour, ..shell(-10.0, 0.3) }]));
    let middle = 32 + 65 * 32;
    for c in 0..3 {
        let expected = 0.3 * outer.rgba[middle][c] + 0.7 * inner.rgba[middle][c];
        assert!((both.rgba[middle][c] - expected).abs() < 1e-4, "{c}");
    }
    // One that hides all is the surface itself.
    let hidden = seen(&volume, &params(0.0, &[Shell { colour, ..shell(-10.0, 1.0) }]));
    for (a, b) in hidden.rgba.iter().zip(&outer.rgba) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
    }
}

#[test]
fn skipping_and_threads_change_no_bit_of_films() {
    let volume = hills::<u8>();
    let twist = twisted(volume.grid());
    let clips = [Clip::plane([0.0, 45.0, 10_010.0], [0.2, 1.0, 0.1])];
    for displacement in [None, Some(&twist)] {
        for clip in [&[][..], &clips] {
            let scene = Scene { displacement, ..Scene::new(&volume) };
            let shells = vec![shell(60.0, 0.2), shell(120.0, 0.5)];
            let asked = RenderParams {
                size: [60, 50],
                mode: Mode::Iso { value: 180.0 },
                shells,
                clip: clip.to_vec(),
                ..RenderParams::default()
            };
            let drawn = |skip: bool, threads: usize| {
                let exec = Exec::default().with_threads(threads);
                let params = RenderParams { skip, ..asked.clone() };
                radiance(&scene, &params, &exec).unwrap()
            };
            let plain = drawn(false, 1);
            assert!(plain.rgba.iter().any(|pixel| pixel[3] > 0.0 && pixel[3] < 0.9));
            for (skip, threads) in [(true, 1), (true, 3)] {
                let found = drawn(skip, threads);
                assert!(found.rgba == plain.rgba, "{skip} {threads}");
                assert!(found.skipped > 0);
            }
        }
    }
}

#[test]
fn a_ray_leaves_a_film_that_ends_where_nothing_is_behind_it() {
    // A slab that ends in every phase of a brick, with nothing in the bricks behind.
    let grid = Grid::with_spacing([40, 6, 6], [1.0; 3]).unwrap();
    for end in 8..24 {
        let value = |i: usize| if (5..=end).contains(&grid.index(i).0[0]) { 1000_u16 } else { 0 };
        let volume =
            Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(value).collect::<Vec<_>>())).unwrap();
        for [azimuth, step] in [[90.0, 0.5], [270.0, 0.5], [90.0, 0.9], [270.0, 1.3]] {
            let view = View { angles: [azimuth, 0.0], ..View::FRONT };
            let asked = RenderParams { view, step, ..params(2000.0, &[shell(50.0, 0.25)]) };
            let plain = RenderParams { skip: false, ..asked.clone() };
            let [found, plain] = [asked, plain].map(|params| seen(&volume, &params));
            assert!((plain.rgba[32 + 65 * 32][3] - 0.4375).abs() < 1e-3, "{end}");
            assert!(found.rgba == plain.rgba, "{end} {azimuth} {step}");
            assert!(found.skipped > 0);
        }
    }
}

#[test]
fn films_that_cannot_be_are_refused() {
    let volume = ball(6.0);
    let refused = |params: RenderParams| {
        radiance(&Scene::new(&volume), &params, &Exec::default()).unwrap_err().to_string()
    };
    assert!(refused(params(0.0, &[Shell::default()])).contains("shells"));
    assert!(refused(params(0.0, &[shell(1.0, 0.1); 9])).contains("at most 8"));
    for (film, field) in [
        (shell(1.0, 1.5), "shells.1.opacity"),
        (shell(1.0, f64::NAN), "shells.1.opacity"),
        (shell(f64::INFINITY, 0.5), "shells.1.iso"),
        (Shell { colour: [0.0, -1.0, 0.0], ..shell(1.0, 0.5) }, "shells.1.colour"),
    ] {
        let told = refused(params(0.0, &[shell(1.0, 0.1), film]));
        assert!(told.contains(field), "{told}");
    }
    let mut shaded = params(0.0, &[shell(1.0, 0.1)]);
    shaded.surroundings.ao = 4;
    assert!(refused(shaded).contains("leave ao and shadow out"));
}
