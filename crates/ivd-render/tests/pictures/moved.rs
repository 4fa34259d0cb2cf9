//! How far what is seen has come out of its surface.

use ivd_core::{Exec, Grid, Image, Labels, TransferFunction, Volume, VoxelIndex, Voxels};
use ivd_render::{Clip, Fit, Mode, Moved, Prepared, Projection, RenderParams, Scene, View};
use nalgebra::Vector3;

use super::common::{displacement, sampled};

const SIZE: [usize; 2] = [120, 100];
/// How far the ball goes (mm).
const FAR: f64 = 1.8;

/// A ball of radius 16 about the middle of an oblique grid, as a surface of value 14.
fn ball() -> (Volume, Vector3<f64>) {
    let (sin, cos) = 0.4_f64.sin_cos();
    let axes = [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]];
    let grid = Grid::new([60, 54, 46], [1.0, 1.1, 1.2], [300.0, -7.0, 12.0], axes).unwrap();
    let centre = grid.world(VoxelIndex([30, 27, 23]).into()).0;
    (sampled(&grid, |at| 30.0 - (at - centre).norm()), centre)
}

fn params(view: View) -> RenderParams {
    let mode = Mode::Iso { value: 14.0 };
    RenderParams { mode, view, size: SIZE, fit: Fit::Volume, ..RenderParams::default() }
}

/// The ball, moved along a picture's right, up or towards the eye.
fn moved(view: View, along: [f64; 3]) -> Moved {
    moved_by(Scene::new(&ball().0), &params(view), along)
}

/// The same of any volume of the ball, seen by any means.
fn moved_by(scene: Scene<'_>, params: &RenderParams, along: [f64; 3]) -> Moved {
    let (centre, view) = (ball().1, params.view);
    let still = Prepared::new(&scene, params, &Exec::default()).unwrap();
    let axes = still.lens(view).unwrap().axes().map(Vector3::from);
    let by = axes[0] * along[0] + axes[1] * along[1] + axes[2] * along[2];
    let carried = displacement(scene.volume.grid(), |at| ((at - centre).norm() < 25.0).then_some(-by));
    let scene = Scene { displacement: Some(&carried), ..scene };
    Prepared::new(&scene, params, &Exec::default()).unwrap().draw_moved(view, &Exec::default()).unwrap()
}

#[test]
fn a_labelled_part_comes_out_of_its_own_surface_whatever_its_values_are() {
    let (ball, centre) = ball();
    let grid = ball.grid().clone();
    // Values tell nothing of it, and it is seen into.
    let mut state = 1_u32;
    let noise: Vec<f32> = (0..grid.len())
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as f32
        })
        .collect();
    let volume = Volume::new(grid.clone(), Voxels::from(noise)).unwrap();
    let inside = |i: usize| (grid.world(grid.index(i).into()).0 - centre).norm() < 16.0;
    let ids: Vec<u16> = (0..grid.len()).map(|i| u16::from(inside(i))).collect();
    let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
    let table = vec![[0.8, 0.6, 0.5, 0.06]; 2];
    let transfer = TransferFunction::new([0.0, 255.0], 2, 1.0, vec![0], table, vec![]).unwrap();
    let params = RenderParams { mode: Mode::Dvr, ..params(View::FRONT) };
    let scene = Scene { transfer: Some(&transfer), labels: Some(&labels), ..Scene::new(&volume) };
    let moved = moved_by(scene, &params, [FAR, 0.0, 0.0]);
    // It goes to the right: there it comes out, on the left it goes in.
    let (mut right, mut wrong) = (0, 0);
    for y in 35..65 {
        for x in (0..50).chain(70..SIZE[0]) {
            let [red, _, blue] = pixel(&moved.image, x, y);
            if (red - blue).abs() > 30 {
                right += usize::from((red > blue) == (x > 60));
                wrong += usize::from((red > blue) != (x > 60));
            }
        }
    }
    assert!(right > 200 && wrong == 0, "{right} right, {wrong} wrong");
    assert!(moved.out_mm > 0.85 * FAR && moved.in_mm > 0.85 * FAR, "{} {}", moved.out_mm, moved.in_mm);
}

fn pixel(image: &Image, x: usize, y: usize) -> [i32; 3] {
    let at = 4 * (x + SIZE[0] * y);
    [0, 1, 2].map(|c| i32::from(image.rgba()[at + c]))
}

#[test]
fn what_comes_towards_the_eye_is_out_and_what_goes_away_is_in() {
    for (angles, projection) in [
        ([0.0, 0.0], Projection::Orthographic),
        ([40.0, -25.0], Projection::Orthographic),
        ([200.0, 60.0], Projection::Perspective),
    ] {
        let view = View { angles, projection, ..View::FRONT };
        for sign in [1.0, -1.0] {
            let found = moved(view, [0.0, 0.0, sign * FAR]);
            let [most, least] =
                if sign > 0.0 { [found.out_mm, found.in_mm] } else { [found.in_mm, found.out_mm] };
            assert!((most - FAR).abs() < 0.01 && least < 0.1, "{angles:?} {sign}: {most} and {least}");
            assert_eq!(found.scale_mm, 2.0);
            let [red, _, blue] = pixel(&found.image, SIZE[0] / 2, SIZE[1] / 2);
            assert!(f64::from(red - blue) * sign > 40.0, "{angles:?} {sign}: {red} and {blue}");
        }
    }
}

#[test]
fn what_goes_across_comes_out_on_one_side_and_goes_in_on_the_other() {
    for (along, beside) in [([FAR, 0.0, 0.0], [12, 0]), ([0.0, FAR, 0.0], [0, -12])] {
        let found = moved(View::FRONT, along);
        // Its edge faces that way.
        assert!(found.out_mm > 0.9 * FAR && found.in_mm > 0.9 * FAR, "{found:?}");
        assert!(found.out_mm < FAR + 0.01 && found.in_mm < FAR + 0.01);
        let at = |sign: i32| {
            let [x, y] = [0, 1].map(|a| (SIZE[a] as i32 / 2 + sign * beside[a]) as usize);
            let [red, _, blue] = pixel(&found.image, x, y);
            red - blue
        };
        assert!(at(1) > 15 && at(-1) < -15, "{along:?}: {} and {}", at(1), at(-1));
        // Across its middle it slides along itself.
        let [red, _, blue] = pixel(&found.image, SIZE[0] / 2, SIZE[1] / 2);
        assert!((red - blue).abs() < 30, "{red} and {blue}");
    }
}

#[test]
fn of_what_is_seen_through_it_is_the_half_way_place_that_counts() {
    // Opacity rises from the ball's surface on, so that all directions are known where half of it lies.
    let table = (0..256).map(|i| [1.0, 0.8, 0.6, if i > 128 { (i - 128) as f32 / 400.0 } else { 0.0 }]);
    let transfer = TransferFunction::new([-2.0, 30.0], 256, 1.0, vec![0], table.collect(), vec![]).unwrap();
    for angles in [[0.0, 0.0], [130.0, 35.0]] {
        let view = View { angles, ..View::FRONT };
        let seen = RenderParams { mode: Mode::Dvr, ..params(view) };
        for sign in [1.0, -1.0] {
            let found = moved_by(
                Scene { transfer: Some(&transfer), ..Scene::new(&ball().0) },
                &seen,
                [0.0, 0.0, sign * FAR],
            );
            let [most, least] =
                if sign > 0.0 { [found.out_mm, found.in_mm] } else { [found.in_mm, found.out_mm] };
            assert!((most - FAR).abs() < 0.02 && least < 0.1, "{angles:?} {sign}: {most} and {least}");
            let [red, _, blue] = pixel(&found.image, SIZE[0] / 2, SIZE[1] / 2);
            assert!(f64::from(red - blue) * sign > 40.0, "{angles:?} {sign}: {red} and {blue}");
        }
    }
}

#[test]
fn the_pictures_of_a_turntable_have_one_scale() {
    // Towards the eye at first, away from it when it is seen from behind.
    let turning = RenderParams { turntable: 4, ..params(View::FRONT) };
    let found = moved_by(Scene::new(&ball().0), &turning, [0.0, 0.0, FAR]);
    assert_eq!((found.image.frames(), found.scale_mm), (4, 2.0));
    assert!((found.out_mm - FAR).abs() < 0.01 && (found.in_mm - FAR).abs() < 0.01, "{found:?}");
    for (frame, sign) in [(0, 1), (2, -1)] {
        let [red, _, blue] = pixel(&found.image, SIZE[0] / 2, SIZE[1] / 2 + frame * SIZE[1]);
        assert!((red - blue) * sign > 40, "{frame}: {red} and {blue}");
    }
}

#[test]
fn faces_of_cuts_and_places_without_data_have_no_colour() {
    let (volume, centre) = ball();
    let middle = [SIZE[0] / 2, SIZE[1] / 2];
    let is_grey = |image: &Image, [x, y]: [usize; 2]| {
        let [red, green, blue] = pixel(image, x, y);
        red == green && green == blue
    };
    // Cut across its middle, towards the eye.
    let towards = Prepared::new(&Scene::new(&volume), &params(View::FRONT), &Exec::default()).unwrap();
    let towards = Vector3::from(towards.lens(View::FRONT).unwrap().axes()[2]);
    let clip = vec![Clip::plane(centre.into(), (-towards).into())];
    let cut = moved_by(Scene::new(&volume), &RenderParams { clip, ..params(View::FRONT) }, [0.0, 0.0, FAR]);
    assert!(is_grey(&cut.image, middle), "{:?}", pixel(&cut.image, middle[0], middle[1]));
    // Its side towards the eye is missing: the rest of its surface, if it is seen at all, is told as it is.
    let Voxels::F32(values) = volume.voxels() else { unreachable!("made so") };
    let mut values = values.to_vec();
    for (i, value) in values.iter_mut().enumerate() {
        if (volume.grid().world(volume.grid().index(i).into()).0 - centre).dot(&towards) > 4.0 {
            *value = f32::NAN;
        }
    }
    let holed = Volume::new(volume.grid().clone(), values.into()).unwrap();
    let holed = moved_by(Scene::new(&holed), &params(View::FRONT), [0.0, 0.0, FAR]);
    assert!(holed.out_mm <= FAR + 0.01 && holed.in_mm < 0.1, "{} and {}", holed.out_mm, holed.in_mm);
    assert!(is_grey(&holed.image, middle), "{:?}", pixel(&holed.image, middle[0], middle[1]));
}

#[test]
fn what_lies_still_is_grey_and_what_passes_by_nothing_that_moves_costs_no_ray() {
    let (volume, centre) = ball();
    let params = RenderParams { annotate: false, ..params(View::FRONT) };
    let exec = Exec::default();
    let still =
        Prepared::new(&Scene::new(&volume), &params, &exec).unwrap().draw_moved(View::FRONT, &exec).unwrap();
    assert_eq!((still.out_mm, still.in_mm), (0.0, 0.0));
    let grey = |image: &Image, [x, y]: [usize; 2]| {
        let [red, green, blue] = pixel(image, x, y);
        red == green && green == blue
    };
    // Above the bar.
    let pixels = || (0..SIZE[1] / 2).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]));
    assert!(pixels().all(|at| grey(&still.image, at)));
    // A dent below leaves the upper half as it was.
    let carried = displacement(volume.grid(), |at| {
        (at - centre - Vector3::new(0.0, 14.0, -8.0)).norm().lt(&6.0).then_some(Vector3::new(0.0, 1.0, 0.0))
    });
    let scene = Scene { displacement: Some(&carried), ..Scene::new(&volume) };
    let dented = Prepared::new(&scene, &params, &exec).unwrap().draw_moved(View::FRONT, &exec).unwrap();
    assert!(dented.out_mm.max(dented.in_mm) > 0.3, "{} and {}", dented.out_mm, dented.in_mm);
    let upper = |image: &Image| {
        pixels().filter(|at| at[1] < SIZE[1] / 3).map(|[x, y]| pixel(image, x, y)).collect::<Vec<_>>()
    };
    assert_eq!(upper(&dented.image), upper(&still.image));
}
