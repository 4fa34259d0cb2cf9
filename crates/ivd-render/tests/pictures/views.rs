//! Where pictures are seen from, and what they hold.

use crate::pictures::common::{displacement, hills, sampled};
use ivd_core::{Displacement, Exec, Grid, TransferFunction, Volume, Voxels};
use ivd_render::{
    Classification, Fit, Mode, Projection, Radiance, RenderParams, Scene, Side, View, radiance, render,
};
use nalgebra::Vector3;

const SIZE: usize = 101;

fn params(view: View) -> RenderParams {
    RenderParams { size: [SIZE; 2], view, shading: false, annotate: false, ..RenderParams::default() }
}

fn seen(scene: &Scene, params: &RenderParams) -> Radiance {
    radiance(scene, params, &Exec::default()).unwrap()
}

/// Opaque: red below −50, blue above 50.
fn two_colours() -> TransferFunction {
    let entry = |i: usize| match i {
        0..50 => [1.0, 0.0, 0.0, 1.0],
        50..150 => [0.0; 4],
        _ => [0.0, 0.0, 1.0, 1.0],
    };
    TransferFunction::new([-100.0, 100.0], 201, 1.0, vec![0], (0..201).map(entry).collect(), vec![]).unwrap()
}

/// Mean place of the pixels for which it holds, from the picture's middle to the right and up, and how many they are.
fn place_of(picture: &Radiance, is: impl Fn([f32; 4]) -> bool) -> ([f64; 2], usize) {
    let middle = 0.5 * (SIZE as f64 - 1.0);
    let (mut sum, mut count) = ([0.0; 2], 0);
    for (i, _) in picture.rgba.iter().enumerate().filter(|(_, rgba)| is(**rgba)) {
        sum[0] += (i % SIZE) as f64 - middle;
        sum[1] += middle - (i / SIZE) as f64;
        count += 1;
    }
    (sum.map(|s| s / count.max(1) as f64), count)
}

#[test]
fn a_mark_on_a_ball_is_seen_from_its_side_of_the_patient_and_from_no_other() {
    let grid = Grid::with_spacing([60; 3], [1.0; 3]).unwrap();
    let middle = Vector3::repeat(29.5);
    let transfer = two_colours();
    let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
    // Right, anterior and superior are positive. Whoever stands at a side has the second axis to the right, the third up.
    for (side, opposite, eye, right, up) in [
        (Side::Front, Side::Back, y, -x, z),
        (Side::Left, Side::Right, -x, -y, z),
        (Side::Back, Side::Front, -y, x, z),
        (Side::Right, Side::Left, x, y, z),
        (Side::Top, Side::Bottom, z, -x, -y),
        (Side::Bottom, Side::Top, -z, -x, y),
    ] {
        let mark: Vector3<f64> = middle + 20.0 * (0.8 * eye + 0.48 * right + 0.36 * up);
        let volume = sampled(&grid, |at| {
            let (ball, mark) = (20.5 - (at - middle).norm(), 4.5 - (at - mark).norm());
            if mark > 0.0 { -100.0 } else { 100.0 * ball.clamp(0.0, 1.0) }
        });
        let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
        let of = |side: Side| {
            let view = View { angles: side.angles(), ..View::FRONT };
            // So that a pixel is known: the sphere round the volume over 101 pixels.
            seen(&scene, &RenderParams { fit: Fit::Volume, ..params(view) })
        };
        let red = |rgba: [f32; 4]| rgba[0] > 0.5;
        let pixel = 60.0 * 3.0_f64.sqrt() / SIZE as f64;
        let ([across, upward], count) = place_of(&of(side), red);
        assert!(count > 20, "{side:?}: {count} pixels");
        assert!(
            (pixel * across - 9.6).abs() < 1.0 && (pixel * upward - 7.2).abs() < 1.0,
            "{side:?}: {across} {upward}"
        );
        assert_eq!(place_of(&of(opposite), red).1, 0, "{opposite:?} sees it through the ball");
    }
}

#[test]
fn a_whole_volume_that_is_seen_fits_as_a_zoom_by_hand_does() {
    // 40 × 30 × 20 mm, all of one value; from the front 40 mm across and 20 mm high.
    let grid = Grid::new(
        [40, 15, 16],
        [1.0, 2.0, 1.25],
        [1e5, -40.0, 7.0],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    )
    .unwrap();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![100_u8; grid.len()])).unwrap();
    let table = vec![[1.0, 1.0, 1.0, 0.1]; 2];
    let transfer = TransferFunction::new([100.0, 100.0], 2, 2.0, vec![0], table, vec![]).unwrap();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let radius = 0.5 * (1600.0_f64 + 900.0 + 400.0).sqrt();
    for (size, pixel) in [([100, 100], 40.0 / 92.0), ([300, 100], 20.0 / 92.0), ([100, 60], 40.0 / 95.2)] {
        let fitted = seen(&scene, &RenderParams { size, ..params(View::FRONT) });
        let zoom = 2.0 * radius / (size[0].min(size[1]) as f64 * pixel);
        let view = View { zoom, ..View::FRONT };
        let by_hand = seen(&scene, &RenderParams { size, fit: Fit::Volume, ..params(view) });
        for (a, b) in fitted.rgba.iter().zip(&by_hand.rgba) {
            assert!((0..4).all(|c| (a[c] - b[c]).abs() < 1e-4), "{a:?} for {b:?} at {size:?}");
        }
        // A zoom magnifies what fits.
        let twice = View { zoom: 2.0, ..View::FRONT };
        let twice = seen(&scene, &RenderParams { size, ..params(twice) });
        let view = View { zoom: 2.0 * zoom, ..View::FRONT };
        let by_hand = seen(&scene, &RenderParams { size, fit: Fit::Volume, ..params(view) });
        assert!(twice.rgba.iter().zip(&by_hand.rgba).all(|(a, b)| (a[3] - b[3]).abs() < 1e-4), "{size:?}");
    }
}

/// A ball of radius 10 mm about voxel (20, 20, 20) of 64³ of 1 mm; its bricks reach from voxel 8 to voxel 32.
fn ball() -> Volume {
    let grid = Grid::with_spacing([64; 3], [1.0; 3]).unwrap();
    sampled(&grid, |at| 100.0 + 10.0 * (10.0 - (at - Vector3::repeat(20.0)).norm()).max(-10.0))
}

#[test]
fn what_is_seen_of_a_small_ball_fills_the_picture_in_every_mode() {
    let volume = ball();
    let table = (0..201).map(|i| if i < 100 { [0.0; 4] } else { [1.0; 4] }).collect();
    let transfer = TransferFunction::new([0.0, 200.0], 201, 1.0, vec![0], table, vec![]).unwrap();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let post = params(View::FRONT);
    // Of a projection, what exceeds a twentieth of 0 … 200 is a ball of 19 mm: to within a brick, 0 … 40 mm.
    let mip = RenderParams { mode: Mode::Mip, ..post.clone() };
    let between = RenderParams { classification: Classification::PreIntegrated, ..post.clone() };
    let iso = RenderParams { mode: Mode::Iso { value: 100.0 }, ..post.clone() };
    for (params, extent, middle) in
        [(post, 24.0, 20.0), (between, 24.0, 20.0), (iso, 24.0, 20.0), (mip, 40.5, 19.75)]
    {
        let pixel = extent / (0.92 * SIZE as f64);
        let picture = seen(&scene, &params);
        // Half of the range of a projection is 0.214 of the light.
        let is_mip = params.mode == Mode::Mip;
        let ([across, upward], count) =
            place_of(&picture, |rgba| if is_mip { rgba[0] > 0.214 } else { rgba[3] > 0.5 });
        let area = count as f64 * pixel * pixel;
        let truth = std::f64::consts::PI * 100.0;
        assert!((area / truth - 1.0).abs() < 0.03, "{:?}: {area} for {truth}", params.mode);
        // The picture's right is the patient's left.
        let off = 20.0 - middle;
        assert!(
            (pixel * across + off).abs() < 0.1 && (pixel * upward - off).abs() < 0.1,
            "{across} {upward}"
        );
    }
}

#[test]
fn nothing_that_is_seen_is_cut_off_from_any_angle() {
    let volume = ball();
    let iso = Mode::Iso { value: 100.0 };
    for projection in [Projection::Orthographic, Projection::Perspective] {
        for angles in [[0.0, 0.0], [37.0, 22.0], [133.0, -65.0], [290.0, 89.0]] {
            let view = View { angles, projection, ..View::FRONT };
            let picture = seen(&Scene::new(&volume), &RenderParams { mode: iso, ..params(view) });
            let is_edge = |i: usize| [i % SIZE, i / SIZE].iter().any(|at| *at < 3 || *at >= SIZE - 3);
            let mut lit = (0..SIZE * SIZE).filter(|i| picture.rgba[*i][3] > 0.0);
            assert!(!lit.clone().any(is_edge), "{projection:?} {angles:?}");
            let rows = lit.clone().map(|i| i / SIZE);
            let high = rows.clone().max().unwrap() - rows.min().unwrap();
            assert!(high > SIZE / 3, "{projection:?} {angles:?}: {high} rows");
            assert!(lit.next().is_some());
        }
    }
}

#[test]
fn where_nothing_is_seen_the_volume_fits() {
    let volume = ball();
    let mode = Mode::Iso { value: 1e6 };
    let params = RenderParams { mode, annotate: true, ..params(View::FRONT) };
    let of = |fit: Fit| {
        ivd_render::render(&Scene::new(&volume), &RenderParams { fit, ..params.clone() }, &Exec::default())
            .unwrap()
    };
    assert_eq!(of(Fit::Visible).image, of(Fit::Volume).image, "the scale bar too");
}

/// What lies about (48, 48, 20) comes from about (48, 20, 20).
fn carried(grid: &Grid) -> Displacement {
    displacement(grid, |at| {
        let near = (at - Vector3::new(48.0, 48.0, 20.0)).norm() < 14.0;
        near.then(|| Vector3::new(0.0, -28.0, 0.0))
    })
}

#[test]
fn pictures_with_a_motion_and_without_have_one_camera_that_holds_both() {
    let grid = Grid::with_spacing([64; 3], [1.0; 3]).unwrap();
    let (left, right) = (Vector3::new(14.0, 20.0, 20.0), Vector3::new(48.0, 20.0, 20.0));
    let volume = sampled(&grid, |at| 10.0 - (at - left).norm().min((at - right).norm()));
    let displacement = carried(&grid);
    let view = View { angles: Side::Top.angles(), ..View::FRONT };
    let params = RenderParams { mode: Mode::Iso { value: 2.0 }, ..params(view) };
    let rest = Scene::new(&volume);
    let before = seen(&Scene { framing: Some(&displacement), ..rest }, &params);
    let after = seen(&Scene { displacement: Some(&displacement), ..rest }, &params);
    let alone = seen(&rest, &params);
    // From above the patient's left, where x is small, is at the picture's right: that ball stays.
    let right_half = |picture: &Radiance| -> Vec<[f32; 4]> {
        (0..SIZE * SIZE).filter(|i| i % SIZE > SIZE / 2 + 5).map(|i| picture.rgba[i]).collect()
    };
    assert_eq!(right_half(&before), right_half(&after));
    assert_ne!(right_half(&before), right_half(&alone), "without room for the motion it is larger");
    // Seen from above with posterior up, the ball that is carried forward goes down, and stays whole.
    let lit = |picture: &Radiance, rows: std::ops::Range<usize>| {
        rows.flat_map(|y| y * SIZE..y * SIZE + SIZE / 2).filter(|&i| picture.rgba[i][3] > 0.0).count()
    };
    assert!(lit(&after, 0..SIZE) > lit(&before, 0..SIZE), "the carried ball is seen beside the one at rest");
    assert_eq!(lit(&after, 0..4) + lit(&after, SIZE - 4..SIZE), 0);
    // By the volume all three are one camera too.
    let whole = RenderParams { fit: Fit::Volume, ..params };
    assert_eq!(
        right_half(&seen(&Scene { framing: Some(&displacement), ..rest }, &whole)),
        right_half(&seen(&rest, &whole))
    );
}

#[test]
fn a_frame_of_a_motion_is_seen_by_the_camera_of_the_last() {
    let grid = Grid::with_spacing([64; 3], [1.0; 3]).unwrap();
    let (left, right) = (Vector3::new(14.0, 20.0, 20.0), Vector3::new(48.0, 20.0, 20.0));
    let volume = sampled(&grid, |at| 10.0 - (at - left).norm().min((at - right).norm()));
    let last = carried(&grid);
    let view = View { angles: Side::Top.angles(), ..View::FRONT };
    for mode in [Mode::Iso { value: 2.0 }, Mode::Mip] {
        let params = RenderParams { mode, ..params(view) };
        let still = Scene { displacement: Some(&last), ..Scene::new(&volume) };
        let framed = |displacement| {
            let framing = Some(&last);
            seen(&Scene { whole: Some(&volume), displacement, framing, ..Scene::new(&volume) }, &params)
        };
        // Made as every frame is, the last is the still picture.
        assert_eq!(framed(Some(&last)), seen(&still, &params));
        // A frame in which nothing has moved yet is the picture at rest that leaves room for the motion.
        let rest = Scene { framing: Some(&last), ..Scene::new(&volume) };
        assert_eq!(framed(None), seen(&rest, &params));
        // Half of the volume is seen where it is in the whole, in the whole's window.
        let half = sampled(&grid, |at| if at.x < 31.0 { 10.0 - (at - left).norm() } else { -60.0 });
        let alone = Scene { whole: Some(&volume), framing: Some(&last), ..Scene::new(&half) };
        let (half, rest) = (seen(&alone, &params), seen(&rest, &params));
        let right = (0..SIZE * SIZE).filter(|i| i % SIZE > SIZE / 2 + 5);
        assert!(right.clone().any(|i| rest.rgba[i][3] > 0.0));
        assert!(right.into_iter().all(|i| half.rgba[i] == rest.rgba[i]), "{mode:?}");
    }
}

#[test]
fn several_rays_a_pixel_give_their_mean_light() {
    let volume = hills::<u8>();
    let params = RenderParams { size: [40, 30], mode: Mode::Iso { value: 90.0 }, ..RenderParams::default() };
    let fine = RenderParams { size: [120, 90], ..params.clone() };
    let asked = RenderParams { antialias: 3, ..params };
    let exec = Exec::default();
    let [found, fine] = [&asked, &fine].map(|params| radiance(&Scene::new(&volume), params, &exec).unwrap());
    assert_eq!([found.width, found.height, found.rgba.len()], [40, 30, 1200]);
    assert_eq!(found.samples, fine.samples);
    for (i, pixel) in found.rgba.iter().enumerate() {
        let first = 3 * (i % 40) + 360 * (i / 40);
        for (c, light) in pixel.iter().enumerate() {
            let rays = (0..9).map(|ray| fine.rgba[first + ray % 3 + 120 * (ray / 3)][c]);
            assert!((light - rays.sum::<f32>() / 9.0).abs() < 1e-6, "{i}");
        }
    }
}

#[test]
fn several_rays_a_pixel_cover_what_a_ball_covers() {
    // A distance, so that the surface is where its formula says.
    let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
    let centre = nalgebra::Vector3::repeat(19.5);
    let value = |i: usize| (12.0 - (grid.world(grid.index(i).into()).0 - centre).norm()) as f32;
    let volume =
        Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(value).collect::<Vec<_>>())).unwrap();
    let scene = Scene::new(&volume);
    let mode = Mode::Iso { value: 0.0 };
    let params =
        RenderParams { size: [24; 2], mode, fit: Fit::Volume, view: View::FRONT, ..RenderParams::default() };
    // The sphere round the volume fits across the picture.
    let pixel = 40.0 * 3.0_f64.sqrt() / 24.0;
    // How much of a pixel the ball's disc covers, by 100 × 100 places.
    let covered = |x: usize, y: usize| {
        let is_within = |i: usize| {
            let at = |pixel: usize, part: usize| pixel as f64 + (part as f64 + 0.5) / 100.0 - 12.0;
            pixel * at(x, i % 100).hypot(at(y, i / 100)) <= 12.0
        };
        (0..10_000).filter(|i| is_within(*i)).count() as f64 / 1e4
    };
    let off = |antialias: usize| {
        let asked = RenderParams { antialias, ..params.clone() };
        let found = radiance(&scene, &asked, &Exec::default()).unwrap();
        (0..576).map(|i| (f64::from(found.rgba[i][3]) - covered(i % 24, i / 24)).abs()).fold(0.0, f64::max)
    };
    let [one, four] = [off(1), off(4)];
    assert!(one > 0.25 && four < 0.02, "{one} {four}");
}

#[test]
fn a_cube_and_a_legend_are_drawn_where_they_are_asked_for() {
    let volume = hills::<u8>();
    let params = RenderParams { size: [128; 2], mode: Mode::Mip, annotate: false, ..RenderParams::default() };
    let drawn = |params: &RenderParams| render(&Scene::new(&volume), params, &Exec::default()).unwrap().image;
    let plain = drawn(&params);
    let changed = |image: &ivd_core::Image, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>| {
        let differs = |&(x, y): &(usize, usize)| {
            let at = 4 * (x + 128 * y);
            image.rgba()[at..at + 4] != plain.rgba()[at..at + 4]
        };
        let all: Vec<(usize, usize)> = (0..128 * 128).map(|i| (i % 128, i / 128)).filter(differs).collect();
        let inside = all.iter().filter(|(x, y)| columns.contains(x) && rows.contains(y)).count();
        (inside, all.len() - inside)
    };
    let legend = drawn(&RenderParams { legend: true, ..params.clone() });
    let (inside, outside) = changed(&legend, 64..128, 100..128);
    assert!(inside > 100 && outside == 0, "{inside} {outside}");
    let params = RenderParams { cube: true, ..params };
    let cube = drawn(&params);
    let (inside, outside) = changed(&cube, 100..128, 0..28);
    assert!(inside > 100 && outside == 0, "{inside} {outside}");
    // Where nobody knows how the patient lies there is none.
    let grid = volume.grid().clone().with_patient_space(false);
    let unknown = Volume::new(grid, volume.voxels().clone()).unwrap();
    assert_eq!(render(&Scene::new(&unknown), &params, &Exec::default()).unwrap().image, plain);
}
