//! The ray caster against pictures whose light is known in closed form.

use ivd_core::{Exec, GradientTable, Grid, TransferFunction, Volume, Voxels};
use ivd_render::{Fit, Mode, RenderParams, Scene, View, radiance};
use nalgebra::Vector3;

fn exec() -> Exec {
    Exec::default()
}

/// Parameters for measuring: no early end, no lighting.
fn measuring() -> RenderParams {
    RenderParams {
        size: [33; 2],
        view: View::FRONT,
        fit: Fit::Volume,
        termination: 2.0,
        shading: false,
        annotate: false,
        ..RenderParams::default()
    }
}

/// A table whose optical depth per millimetre is `tau · value`, for values 0…1, white.
fn absorbing(tau: f64, reference_mm: f64) -> TransferFunction {
    let opacity = |i: usize| (1.0 - (-tau * reference_mm * i as f64 / 4096.0).exp()) as f32;
    let table = (0..=4096).map(|i| [1.0, 1.0, 1.0, opacity(i)]).collect();
    TransferFunction::new([0.0, 1.0], 4097, reference_mm, vec![0], table, vec![]).unwrap()
}

#[test]
fn a_homogeneous_slab_is_exact_at_any_step_and_spacing() {
    let spacing = [1.0, 0.7, 3.0];
    let grid = Grid::with_spacing([16, 10, 6], spacing).unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![0.5_f32; grid.len()])).unwrap();
    let transfer = absorbing(0.2, 1.3);
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    // From the front through 10 · 0.7 mm; from the left through 16 mm; from the head through 18 mm.
    for (azimuth_deg, elevation_deg, thickness) in [(0.0, 0.0, 7.0), (90.0, 0.0, 16.0), (0.0, 90.0, 18.0)] {
        for step in [0.13, 0.5, 1.0, 3.7] {
            let view = View { angles: [azimuth_deg, elevation_deg], ..View::FRONT };
            let picture = radiance(&scene, &RenderParams { step, view, ..measuring() }, &exec()).unwrap();
            let alpha = f64::from(picture.rgba[16 + 33 * 16][3]);
            let truth = 1.0 - (-0.1_f64 * thickness).exp();
            assert!((alpha - truth).abs() < 2e-5, "{alpha} for {truth} at step {step}");
        }
    }
}

#[test]
fn a_ball_of_smooth_density_has_the_opacity_of_its_chord() {
    // Density 1 - (r/R)² in a ball: the integral along a chord at distance b is 4/3 · R (1 - b²/R²)^(3/2). Outside the ball the value is negative and the
    // table ends at 0, so that the voxels hold no kink.
    let n = 96;
    let grid = Grid::with_spacing([n, n, n / 2], [1.0, 1.0, 2.0]).unwrap();
    let radius = 40.0;
    let centre = Vector3::new(47.5, 47.5, 47.0);
    let density = |i: usize| {
        let index = grid.index(i);
        let at = grid.world(index.into()).0;
        (1.0 - ((at - centre).norm() / radius).powi(2)) as f32
    };
    let volume =
        Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(density).collect::<Vec<_>>())).unwrap();
    let tau = 0.03;
    let transfer = absorbing(tau, 2.0);
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let view = View { angles: [37.0, 25.0], ..View::FRONT };
    let params = RenderParams { view, step: 0.25, size: [65; 2], ..measuring() };
    let picture = radiance(&scene, &params, &exec()).unwrap();
    // Half the picture shows the radius of the sphere round the volume.
    let pixel = 2.0 * (3.0_f64.sqrt() * 48.0) / 65.0;
    let mut worst = 0.0_f64;
    for (i, rgba) in picture.rgba.iter().enumerate() {
        let b = pixel * ((i % 65) as f64 - 32.0).hypot((i / 65) as f64 - 32.0);
        let depth = tau * 4.0 / 3.0 * radius * (1.0 - (b / radius).powi(2)).max(0.0).powf(1.5);
        worst = worst.max((f64::from(rgba[3]) - (1.0 - (-depth).exp())).abs());
        assert_eq!(rgba[0], rgba[3], "white and premultiplied");
    }
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn a_homogeneous_ball_follows_beer_and_lambert() {
    let n = 128;
    let grid = Grid::with_spacing([n; 3], [1.0; 3]).unwrap();
    let (radius, tau) = (50.3_f64, 0.02_f64);
    let centre = Vector3::repeat(63.5);
    let level = |i: usize| (radius - (grid.world(grid.index(i).into()).0 - centre).norm()) as f32;
    let volume =
        Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(level).collect::<Vec<_>>())).unwrap();
    let opacity = (1.0 - (-tau).exp()) as f32;
    let table = (0..8192).map(|i| [1.0, 0.5, 0.25, if i >= 4096 { opacity } else { 0.0 }]).collect();
    let transfer = TransferFunction::new([-64.0, 64.0], 8192, 1.0, vec![0], table, vec![]).unwrap();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let view = View { angles: [53.0, -35.0], ..View::FRONT };
    let params = RenderParams { view, step: 0.04, size: [25; 2], ..measuring() };
    let picture = radiance(&scene, &params, &exec()).unwrap();
    let pixel = 2.0 * (3.0_f64.sqrt() * 64.0) / 25.0;
    for (i, rgba) in picture.rgba.iter().enumerate() {
        let b = pixel * ((i % 25) as f64 - 12.0).hypot((i / 25) as f64 - 12.0);
        let half_chord = (radius * radius - b * b).max(0.0).sqrt();
        let truth = 1.0 - (-tau * 2.0 * half_chord).exp();
        // Near the rim a chord is less certain: its error is the surface's, by the slope.
        let tolerance = if half_chord > 15.0 || b > radius + 0.2 { 1e-3 } else { 1e-2 };
        assert!((f64::from(rgba[3]) - truth).abs() < tolerance, "{} for {truth} at {b} mm", rgba[3]);
        assert!((rgba[1] - 0.5 * rgba[3]).abs() < 1e-5, "premultiplied");
    }
}

#[test]
fn halving_the_step_brings_the_picture_nearer_to_the_fine_one() {
    let grid = Grid::with_spacing([24; 3], [1.0; 3]).unwrap();
    let value = |i: usize| {
        let [x, y, z] = grid.index(i).0.map(|c| c as f32);
        0.5 + 0.5 * (0.4 * x).sin() * (0.3 * y + 1.0).cos() * (0.35 * z).sin()
    };
    let volume =
        Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(value).collect::<Vec<_>>())).unwrap();
    let transfer = absorbing(0.1, 1.0);
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let view = View { angles: [20.0, 10.0], ..View::FRONT };
    let picture = |step: f64| radiance(&scene, &RenderParams { step, view, ..measuring() }, &exec()).unwrap();
    let fine = picture(0.02);
    let error = |step: f64| {
        let coarse = picture(step);
        let sum: f64 = coarse.rgba.iter().zip(&fine.rgba).map(|(a, b)| f64::from(a[3] - b[3]).powi(2)).sum();
        (sum / coarse.rgba.len() as f64).sqrt()
    };
    let errors = [1.0, 0.5, 0.25].map(error);
    for pair in errors.windows(2) {
        assert!(pair[1] < 0.5 * pair[0], "{errors:?}");
    }
    assert!(errors[0] < 1e-3, "{errors:?}");
}

#[test]
fn a_ramp_is_seen_where_the_table_has_its_gradient() {
    // 12 real units a millimetre: 3 stored ones a voxel of half a millimetre, each of them 2 real ones.
    let grid = Grid::with_spacing([20; 3], [0.5; 3]).unwrap();
    let values: Vec<i16> = (0..grid.len()).map(|i| 3 * grid.index(i).0[0] as i16).collect();
    let volume = Volume::with_scale(grid, Voxels::from(values), -2.0, 60.0).unwrap();
    let flat = TransferFunction::new([-60.0, 60.0], 2, 1.0, vec![0], vec![[0.0; 4]; 2], vec![]).unwrap();
    let opacity = 0.3;
    let seen_at = |steep: f64, shading: bool| {
        // Of 33 samples one and its neighbours hold the gradient that is to be seen.
        let row = |j: usize| (16.0 * (j as f64 / 32.0) - steep).abs() < 0.75;
        let table = (0..66).map(|i| if row(i / 2) { [1.0, 1.0, 1.0, opacity] } else { [0.0; 4] }).collect();
        let transfer = flat.clone().with_gradient(GradientTable::new(16.0, [2, 33], table).unwrap());
        let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
        radiance(&scene, &RenderParams { shading, ..measuring() }, &exec()).unwrap().rgba[16 + 33 * 16][3]
    };
    // Along y the value and the gradient are the same all through ten millimetres.
    let truth = 1.0 - (1.0 - f64::from(opacity)).powi(10);
    assert!((f64::from(seen_at(12.0, false)) - truth).abs() < 1e-4);
    assert_eq!(seen_at(12.0, true), seen_at(12.0, false), "light changes no opacity");
    assert_eq!((seen_at(9.0, false), seen_at(15.0, false), seen_at(0.0, false)), (0.0, 0.0, 0.0));
}

#[test]
fn the_greatest_value_along_an_axis_equals_a_plain_search() {
    // Rays through voxel centres: 15 voxels of 1 mm, pixels of 1 mm.
    let grid = Grid::with_spacing([15, 15, 15], [1.0; 3]).unwrap();
    let voxels: Vec<u8> = (0..grid.len()).map(|i| ((i * 7919) % 251) as u8).collect();
    let volume = Volume::new(grid.clone(), Voxels::from(voxels.clone())).unwrap();
    let radius = 7.5 * 3.0_f64.sqrt();
    let params = RenderParams {
        mode: Mode::Mip,
        size: [15; 2],
        step: 0.5,
        // A pixel of 1 mm.
        view: View { zoom: 2.0 * radius / 15.0, ..View::FRONT },
        ..measuring()
    };
    let picture = ivd_render::render(&Scene::new(&volume), &params, &exec()).unwrap();
    let lit = picture.image.rgba();
    for row in 0..15 {
        for column in 0..15 {
            // Seen from the front: the picture's right is the patient's left, -x; down is -z.
            let (x, z) = (14 - column, 14 - row);
            let greatest = (0..15).map(|y| voxels[x + 15 * (y + 15 * z)]).max().unwrap();
            let least = 0;
            let expected = (f64::from(greatest - least) / 250.0 * 255.0).round();
            let got = f64::from(lit[4 * (column + 15 * row)]);
            // Samples lie a quarter of a voxel beside the centres.
            assert!(got <= expected + 1.0 && got >= 0.6 * expected, "{got} for {expected}");
        }
    }
    // With a sample on every centre it is exact.
    let exact = RenderParams { step: 1.0, ..params };
    let picture = ivd_render::render(&Scene::new(&volume), &exact, &exec()).unwrap();
    for (i, pixel) in picture.image.rgba().chunks(4).enumerate() {
        let (x, z) = (14 - i % 15, 14 - i / 15);
        let greatest = (0..15).map(|y| voxels[x + 15 * (y + 15 * z)]).max().unwrap();
        assert_eq!(f64::from(pixel[0]), (f64::from(greatest) / 250.0 * 255.0).round());
    }
}

/// A volume of the signed distance to a sphere, positive inside, on an anisotropic, rotated, left-handed grid.
fn sphere(radius: f64) -> (Volume, Vector3<f64>) {
    let (s, c) = 0.4_f64.sin_cos();
    let direction = [[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, 1.0]];
    let grid = Grid::new([60, 80, 40], [1.0, 0.75, 1.5], [1e5, -300.0, 12.0], direction).unwrap();
    let centre = grid.world(ivd_core::VoxelCoord(Vector3::new(29.5, 39.5, 19.5))).0;
    let value = |i: usize| {
        let index = grid.index(i);
        (radius - (grid.world(index.into()).0 - centre).norm()) as f32
    };
    let values: Vec<f32> = (0..grid.len()).map(value).collect();
    (Volume::new(grid, Voxels::from(values)).unwrap(), centre)
}

#[test]
fn a_surface_covers_the_disc_of_its_sphere_from_every_side() {
    let (volume, _) = sphere(20.0);
    for (azimuth_deg, elevation_deg) in [(0.0, 0.0), (75.0, -40.0), (200.0, 88.0)] {
        let view = View { angles: [azimuth_deg, elevation_deg], zoom: 2.0, ..View::FRONT };
        let params = RenderParams { mode: Mode::Iso { value: 0.0 }, view, size: [200; 2], ..measuring() };
        let picture = radiance(&Scene::new(&volume), &params, &exec()).unwrap();
        let covered = picture.rgba.iter().filter(|c| c[3] > 0.5).count() as f64;
        let pixel = 2.0 * (30.0_f64.powi(2) + 30.0_f64.powi(2) + 30.0_f64.powi(2)).sqrt() / 2.0 / 200.0;
        let area = covered * pixel * pixel;
        let truth = std::f64::consts::PI * 400.0;
        assert!((area / truth - 1.0).abs() < 0.01, "{area} for {truth}");
    }
}

#[test]
fn a_volume_of_one_layer_and_of_one_voxel_are_seen() {
    for dims in [[1, 1, 1], [1, 20, 20], [20, 1, 20]] {
        let grid = Grid::with_spacing(dims, [2.0; 3]).unwrap();
        let volume = Volume::new(grid.clone(), Voxels::from(vec![7_i16; grid.len()])).unwrap();
        let table = vec![[1.0, 0.0, 0.0, 0.5]; 2];
        let transfer = TransferFunction::new([7.0, 7.0], 2, 2.0, vec![0], table, vec![]).unwrap();
        let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
        let picture = radiance(&scene, &measuring(), &exec()).unwrap();
        let alpha = picture.rgba[16 + 33 * 16][3];
        let truth = 1.0 - 0.5_f32.powi(dims[1] as i32);
        assert!((alpha - truth).abs() < 1e-5, "{alpha} for {truth} through {dims:?}");
    }
}
