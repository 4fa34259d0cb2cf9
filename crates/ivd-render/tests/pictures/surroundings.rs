//! Ambient occlusion and shadows against what is known of them in closed form, and what must not change them.

use std::f64::consts::TAU;

use ivd_core::{Exec, Grid, Labels, TransferFunction, Volume, Voxels};
use ivd_render::{Clip, Fit, Mode, Projection, Radiance, RenderParams, Scene, Surroundings, View, radiance};
use nalgebra::Vector3;

use crate::pictures::common::{hills, sampled, twisted};

/// Shares of the light as docs/methods.md has them: of all around, and of the lamp.
const AMBIENT: f64 = 0.25;
const LAMP: f64 = 0.75;

fn drawn(scene: &Scene<'_>, params: &RenderParams) -> Radiance {
    radiance(scene, params, &Exec::default()).unwrap()
}

/// From above, without light's early end.
fn above(mode: Mode, surroundings: Surroundings) -> RenderParams {
    RenderParams {
        mode,
        surroundings,
        size: [64; 2],
        view: View { angles: [0.0, 90.0], ..View::FRONT },
        fit: Fit::Volume,
        termination: 2.0,
        annotate: false,
        ..RenderParams::default()
    }
}

/// A floor at z = 20 mm with a wall on it from x = 40 on, 12 mm high, as a signed distance.
fn floor_and_wall() -> Volume {
    let grid = Grid::with_spacing([64, 64, 48], [1.0; 3]).unwrap();
    sampled(&grid, |at| {
        let wall = (at.x - 40.0).min(32.0 - at.z);
        (20.0 - at.z).max(wall)
    })
}

/// What a place on the floor sees past a wall so far away and so high, within a reach, by the cosine.
fn seen_past_wall(distance: f64, height: f64, reach: f64) -> f64 {
    let n = 400;
    let mut open = 0.0;
    for i in 0..n {
        for j in 0..n {
            let (u, angle) = ((f64::from(i) + 0.5) / f64::from(n), TAU * (f64::from(j) + 0.5) / f64::from(n));
            let (across, up) = (u.sqrt() * angle.cos(), (1.0 - u).sqrt());
            let far = distance / across;
            let hits = across > 0.0 && far <= reach && far * up <= height;
            open += f64::from(u8::from(!hits));
        }
    }
    open / f64::from(n * n)
}

#[test]
fn a_wall_takes_from_the_floor_what_it_covers_of_the_sky() {
    let volume = floor_and_wall();
    let scene = Scene::new(&volume);
    let reach = 15.0;
    let black =
        RenderParams { surface: [0.0; 3], ..above(Mode::Iso { value: 0.0 }, Surroundings::default()) };
    let white = RenderParams { surface: [0.5; 3], ..black.clone() };
    // The highlight isn't dimmed, and is taken off.
    let (gloss, lit) = (drawn(&scene, &black), drawn(&scene, &white));
    let pixel = 2.0 * (32.0_f64 * 32.0 * 2.0 + 24.0 * 24.0).sqrt() / 64.0;
    for (rays, seeds) in [(16, 12), (64, 3)] {
        let with: Vec<Radiance> = (0..seeds)
            .map(|seed| {
                let asked =
                    Surroundings { ao: rays, ao_radius: Some(reach), seed, ..Surroundings::default() };
                drawn(&scene, &RenderParams { surroundings: asked, ..white.clone() })
            })
            .collect();
        for off in [3.0, 6.0, 10.0] {
            // Seen from above the patient's left, where x is least, is at the right.
            let column = (31.5 - (8.5 - off) / pixel).round();
            let distance = 8.5 - (31.5 - column) * pixel;
            let at = |row: usize| column as usize + 64 * row;
            let share = |with: &Radiance, row: usize| {
                let [g, l, w] = [&gloss, &lit, with].map(|light| f64::from(light.rgba[at(row)][0]));
                (w - g) / (l - g)
            };
            let shares: Vec<f64> =
                with.iter().flat_map(|with| (24..40).map(move |row| share(with, row))).collect();
            let count = shares.len() as f64;
            let mean = shares.iter().sum::<f64>() / count;
            let variance = shares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (count - 1.0);
            // Rays begin a voxel above the floor, and end within half a step of their reach.
            let truth = seen_past_wall(distance, 11.0, reach);
            let error = (variance / count).sqrt() + 2e-3;
            assert!((mean - truth).abs() < 3.0 * error, "{rays} rays at {distance}: {mean} for {truth}");
            assert!(truth < 0.9, "the wall covers something");
        }
    }
}

#[test]
fn more_rays_come_nearer_to_many_as_a_lattice_does() {
    let volume = floor_and_wall();
    let scene = Scene::new(&volume);
    let with = |ao, seed| {
        let asked = Surroundings { ao, ao_radius: Some(15.0), seed, ..Surroundings::default() };
        drawn(&scene, &above(Mode::Iso { value: 0.0 }, asked))
    };
    let truth = with(2048, 1);
    let off = |ao| {
        let picture = with(ao, 7);
        let squares = picture.rgba.iter().zip(&truth.rgba).map(|(p, q)| f64::from(p[0] - q[0]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let errors = [4, 16, 64].map(off);
    assert!(errors[1] < 0.55 * errors[0] && errors[2] < 0.55 * errors[1], "{errors:?}");
    assert_ne!(with(4, 0).rgba, with(4, 1).rgba, "the seed chooses");
}

#[test]
fn a_slab_shades_itself_by_the_lengths_of_the_light_s_ways() {
    for thickness in [1, 3] {
        slab(thickness);
    }
}

/// A slab of 12 mm, in voxels so thick.
fn slab(thickness: usize) {
    let grid = Grid::with_spacing([96, 96, 12 / thickness], [1.0, 1.0, thickness as f64]).unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![1.0_f32; grid.len()])).unwrap();
    let tau = 0.15_f64;
    let opacity = (1.0 - (-tau).exp()) as f32;
    let transfer =
        TransferFunction::new([0.0, 1.0], 2, 1.0, vec![0], vec![[1.0, 1.0, 1.0, opacity]; 2], vec![])
            .unwrap();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let asked = Surroundings { shadow: true, ..Surroundings::default() };
    let params = RenderParams { shading: false, step: 0.05, ..above(Mode::Dvr, asked) };
    let picture = drawn(&scene, &params);
    // The lamp stands beside the eye, 0.45 up and 0.35 to the left.
    let slant = (1.0_f64 + 0.45 * 0.45 + 0.35 * 0.35).sqrt();
    // What lies within a voxel, along the way to the lamp, doesn't shade.
    let off = slant / (0.45_f64 * 0.45 + 0.35 * 0.35 + (thickness as f64).powi(-2)).sqrt();
    let (mut truth, pieces) = (0.0, 20_000);
    for i in 0..pieces {
        let depth = 12.0 * (f64::from(i) + 0.5) / f64::from(pieces);
        let shade = (-tau * (depth * slant - off).max(0.0)).exp();
        truth += tau * (-tau * depth).exp() * (AMBIENT + LAMP * shade) * 12.0 / f64::from(pieces);
    }
    let [red, _, _, alpha] = picture.rgba[32 + 64 * 32].map(f64::from);
    assert!((alpha - (1.0 - (-tau * 12.0).exp())).abs() < 1e-4, "{alpha}");
    assert!((red - truth).abs() < 2e-3, "{red} for {truth}");
    let without = drawn(&scene, &RenderParams { surroundings: Surroundings::default(), ..params });
    assert!(red < 0.9 * f64::from(without.rgba[32 + 64 * 32][0]), "a missing shadow is found");
}

#[test]
fn a_ball_throws_its_shadow_where_the_lamp_says() {
    // A ball of 6 mm over a floor, its middle 16 mm above it.
    let grid = Grid::with_spacing([80, 80, 48], [1.0; 3]).unwrap();
    let centre = Vector3::new(39.5, 39.5, 24.0);
    let volume = sampled(&grid, |at| (8.0 - at.z).max(6.0 - (at - centre).norm()));
    let scene = Scene::new(&volume);
    let asked = Surroundings { shadow: true, ..Surroundings::default() };
    let picture = drawn(&scene, &above(Mode::Iso { value: 0.0 }, asked));
    let plain = drawn(&scene, &above(Mode::Iso { value: 0.0 }, Surroundings::default()));
    let pixel = 2.0 * (40.0_f64 * 40.0 * 2.0 + 24.0 * 24.0).sqrt() / 64.0;
    // From above the picture's right is −x, its up is −y (posterior); the lamp stands 0.45 up and 0.35 left of the eye.
    let lamp = Vector3::new(0.35, -0.45, 1.0).normalize();
    let (mut wrong, mut shaded) = (0, 0);
    for i in 0..64 * 64 {
        let place = Vector3::new(
            39.5 + (31.5 - f64::from(i % 64)) * pixel,
            39.5 - (31.5 - f64::from(i / 64)) * pixel,
            8.0,
        );
        let within = |v: f64| (3.0..76.0).contains(&v);
        let under_ball = (place - centre).xy().norm() < 7.5;
        if !within(place.x) || !within(place.y) || under_ball {
            continue;
        }
        let towards = centre - place;
        let off = (towards - lamp * towards.dot(&lamp)).norm();
        let is_dark = picture.rgba[i as usize][0] < 0.8 * plain.rgba[i as usize][0];
        shaded += u32::from(is_dark);
        // A pixel's width of doubt at the shadow's edge.
        wrong += u32::from((off < 6.0 - pixel && !is_dark) || (off > 6.0 + pixel && is_dark));
    }
    assert!(wrong == 0 && shaded > 15, "{wrong} wrong of {shaded} shaded");
}

#[test]
fn nothing_asked_changes_nothing_and_skipping_and_threads_change_no_bit() {
    let volume = hills::<u8>();
    let twist = twisted(volume.grid());
    let table = (0..256).map(|i| [0.9, 0.5, 0.2, if i > 90 { 0.1 } else { 0.0 }]).collect();
    let transfer = TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0], table, vec![]).unwrap();
    let view = View { angles: [28.0, 17.0], ..View::FRONT };
    let all = Surroundings { ao: 3, ao_radius: Some(30.0), shadow: true, ..Surroundings::default() };
    let middle = volume.grid().world(ivd_core::VoxelCoord(Vector3::new(18.0, 18.0, 14.0))).0;
    for mode in [Mode::Dvr, Mode::Iso { value: 60.0 }] {
        for displacement in [None, Some(&twist)] {
            for clip in [vec![], vec![Clip::plane(middle.into(), [0.0, -1.0, 0.0])]] {
                let scene = Scene { transfer: Some(&transfer), displacement, ..Scene::new(&volume) };
                let asked = RenderParams {
                    mode,
                    view,
                    clip,
                    surroundings: all,
                    size: [40, 32],
                    annotate: false,
                    ..RenderParams::default()
                };
                let picture = drawn(&scene, &asked);
                let other = drawn(&scene, &RenderParams { skip: false, ..asked.clone() });
                assert_eq!(picture.rgba, other.rgba, "{mode:?}: skipping");
                let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
                assert_eq!(pool.install(|| drawn(&scene, &asked)).rgba, picture.rgba, "{mode:?}: threads");
                let plain = drawn(&scene, &RenderParams { surroundings: Surroundings::default(), ..asked });
                // The hills are too round to shade themselves: a wall and a ball above show that surfaces do.
                assert!(mode != Mode::Dvr || plain.rgba != picture.rgba, "it shows");
                let is_darker = |(p, q): (&[f32; 4], &[f32; 4])| p[3] == q[3] && p[0] <= q[0] + 1e-6;
                assert!(picture.rgba.iter().zip(&plain.rgba).all(is_darker), "{mode:?}: it takes light only");
            }
        }
    }
}

#[test]
fn a_homogeneous_cloud_leaves_of_the_sky_what_its_depth_does() {
    // In the middle of a ball of radius R rays of reach r < R see exp(−τ (r − 1)) every way, without noise.
    let grid = Grid::with_spacing([64; 3], [1.0; 3]).unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![1.0_f32; grid.len()])).unwrap();
    let (tau, reach) = (0.1_f64, 9.0);
    let opacity = (1.0 - (-tau).exp()) as f32;
    let transfer =
        TransferFunction::new([0.0, 1.0], 2, 1.0, vec![0], vec![[1.0, 1.0, 1.0, opacity]; 2], vec![])
            .unwrap();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let asked = Surroundings { ao: 2, ao_radius: Some(reach), ..Surroundings::default() };
    let params = RenderParams { shading: false, ..above(Mode::Dvr, asked) };
    let with = drawn(&scene, &params);
    let without = drawn(&scene, &RenderParams { surroundings: Surroundings::default(), ..params });
    // Through all of it; a slice of the way within the reach of the faces sees more. Compare with quadrature over depth and direction.
    let (mut truth, mut plain, pieces) = (0.0, 0.0, 600);
    for i in 0..pieces {
        let depth = 64.0 * (f64::from(i) + 0.5) / f64::from(pieces);
        let weight = tau * (-tau * depth).exp() * 64.0 / f64::from(pieces);
        let mut open = 0.0;
        for j in 0..400 {
            let up = 1.0 - (f64::from(j) + 0.5) / 200.0;
            let face = if up > 0.0 { depth / up } else { (64.0 - depth) / -up.min(-1e-12) };
            open += (-tau * (face.min(reach + 1.0) - 1.0).max(0.0)).exp() / 400.0;
        }
        truth += weight * open;
        plain += weight;
    }
    // In the middle, where no side is within the reach, all pixels are alike but for noise.
    let [with, without] = [&with, &without].map(|light| {
        let middle = (28..36).flat_map(|y| (28..36).map(move |x| f64::from(light.rgba[x + 64 * y][0])));
        middle.sum::<f64>() / 64.0
    });
    assert!((without - plain).abs() < 2e-3, "{without} for {plain}");
    // A ray or two a sample, hundreds of samples.
    assert!((with / without - truth / plain).abs() < 0.01, "{} for {}", with / without, truth / plain);
    assert!(truth / plain < 0.75);
}

/// How far two pictures are apart: the mean over their pixels, and that of their differences.
fn apart(a: &Radiance, b: &Radiance) -> [f64; 2] {
    let off = a.rgba.iter().zip(&b.rgba).map(|(p, q)| f64::from(p[0] - q[0]));
    let count = a.rgba.len() as f64;
    [off.clone().map(f64::abs).sum::<f64>() / count, off.sum::<f64>().abs() / count]
}

#[test]
fn what_shades_stays_where_the_volume_lies_far_away_is_seen_from_afar_or_has_labels() {
    let here = floor_and_wall();
    let values: Vec<f32> = here.to_array().t().iter().map(|&value| value as f32).collect();
    let table = [[0.9, 0.6, 0.3, 0.0], [0.9, 0.6, 0.3, 0.9]];
    let transfer = |rows: Vec<u16>, table: Vec<[f32; 4]>| {
        TransferFunction::new([-1.0, 1.0], 2, 1.0, rows, table, vec![]).unwrap()
    };
    let plain = transfer(vec![0], table.to_vec());
    let asked = Surroundings { ao: 32, ao_radius: Some(15.0), shadow: true, ..Surroundings::default() };
    for mode in [Mode::Iso { value: 0.0 }, Mode::Dvr] {
        let params = above(mode, asked);
        let scene = Scene { transfer: Some(&plain), ..Scene::new(&here) };
        let picture = drawn(&scene, &params);
        let unshaded = RenderParams { surroundings: Surroundings::default(), ..params.clone() };
        let [takes, _] = apart(&picture, &drawn(&scene, &unshaded));
        assert!(takes > 0.01, "{mode:?}: it shows, by {takes}");

        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let grid = Grid::new(here.grid().dims(), [1.0; 3], [1e6, -2e6, 3e6], axes).unwrap();
        let there = Volume::new(grid, Voxels::from(values.clone())).unwrap();
        let [off, bias] = apart(&picture, &drawn(&Scene { volume: &there, ..scene }, &params));
        assert!(off < 0.05 * takes && bias < 0.01 * takes, "{mode:?}: far away by {off}, {bias} of {takes}");

        let view = View { projection: Projection::Perspective, field_of_view: 1.0, ..params.view };
        let afar = drawn(&scene, &RenderParams { view, ..params.clone() });
        let [off, bias] = apart(&picture, &afar);
        assert!(off < 0.2 * takes && bias < 0.05 * takes, "{mode:?}: afar by {off}, {bias} of {takes}");
    }

    // Labels whose rows are alike; another that no voxel has makes them matter.
    let ids: Vec<u16> = (0..values.len()).map(|i| 1 + (i % 2) as u16).collect();
    let ids = Volume::new(here.grid().clone(), Voxels::from(ids)).unwrap();
    let labels = Labels::from_volume(&ids).unwrap();
    let rows = [table, table, table, [[0.0; 4]; 2]].concat();
    let by_label = transfer(vec![0, 1, 2, 3], rows);
    assert!(by_label.depends_on_label());
    let params = above(Mode::Dvr, asked);
    let picture = drawn(&Scene { transfer: Some(&plain), ..Scene::new(&here) }, &params);
    let scene = Scene { transfer: Some(&by_label), labels: Some(&labels), ..Scene::new(&here) };
    let [off, _] = apart(&picture, &drawn(&scene, &params));
    assert!(off < 1e-5, "labels whose rows are alike change it by {off}");
}
