//! Cuts that are drawn, planes and boxes that clip, bones that are turned.

use ivd_core::{Exec, VoxelIndex};
use ivd_field::shape::{Kind, Shape};
use ivd_frames::{
    ClipPart, Cuboid, Figures, HalfSpace, Lies, Model, Overlay, Pane, Request, Saved, Shows, Sight,
};
use ivd_map::space::Step;
use ivd_render::Side;
use ivd_session::Event;
use nalgebra::{Matrix3, Vector3};

use super::common::{BALL, model};
use super::scripts::{assert_as_piped, made};
use super::verbs::BONED;

fn follow(model: &mut Model, request: &Request) -> Figures {
    model.follow(request).unwrap();
    model.figures()
}

fn stroke(pane: Pane, from: [f64; 2], to: [f64; 2]) -> Request {
    Request::Stroke { pane, from, to }
}

#[test]
fn a_line_over_a_slice_is_the_mouth_of_a_cut() {
    for (pane, across) in [(Pane::Axial, 2), (Pane::Coronal, 1), (Pane::Sagittal, 0)] {
        let mut model = model(BALL);
        let rest = model.session().deformed().clone();
        let (from, to) = ([0.3, 0.6], [0.6, 0.35]);
        let told = follow(&mut model, &stroke(pane, from, to));
        assert_eq!((told.refused.as_ref(), told.undo.as_deref()), (None, Some("cut open")));
        let cut = told.incision.unwrap();
        // The ball's slices are 32 mm wide and high.
        let length = 32.0 * (0.3_f64).hypot(0.25);
        assert!((2.0 * cut.radius - length).abs() < 1e-9 && (cut.open - 0.25 * cut.radius).abs() < 1e-9);
        let shown = cut.at[pane.number()].unwrap();
        let off = |ends: [[f64; 2]; 2]| {
            (0..4).map(|i| (shown[i / 2][i % 2] - ends[i / 2][i % 2]).abs()).fold(0.0, f64::max)
        };
        assert!(off([from, to]).min(off([to, from])) < 1e-9, "{pane:?}: {shown:?}");
        // It goes straight away from whoever looks.
        assert!(cut.normal[across].abs() < 1e-9, "{pane:?}: {:?}", cut.normal);
        let at = model.session().rest().grid().voxel(ivd_core::World(cut.centre.into())).0;
        let middle = VoxelIndex([0, 1, 2].map(|a| at[a].round() as usize));
        assert_ne!(rest.value(middle), 0.0);
        assert_eq!(model.session().deformed().value(middle), 0.0, "nothing lies between the lips");
        assert_as_piped(&model);
        let undone = follow(&mut model, &Request::Undo);
        assert!(undone.incision.is_none() && model.session().deformed() == &rest);
    }
}

#[test]
fn a_line_over_the_volume_cuts_along_the_line_of_sight() {
    let perspective = BALL.replace("view = \"front\"", "view = \"front\"\nprojection = \"perspective\"");
    for scene in [BALL, &perspective] {
        let mut model = model(scene);
        follow(&mut model, &Request::Orbit { by: [0.1, 0.07] });
        let place = |model: &mut Model, at| {
            let hovered = follow(model, &Request::Hover { pane: Pane::Volume, at }).hovered;
            Vector3::from(hovered.unwrap().place)
        };
        let (from, to) = ([0.4, 0.42], [0.6, 0.55]);
        let [first, middle, last] = [from, [0.5, 0.485], to].map(|at| place(&mut model, at));
        let told = follow(&mut model, &stroke(Pane::Volume, from, to));
        assert_eq!(told.refused, None);
        let cut = told.incision.unwrap();
        let (centre, normal) = (Vector3::from(cut.centre), Vector3::from(cut.normal));
        assert!((centre - middle).norm() < 1e-9 && (centre - Vector3::from([16.0; 3])).norm() > 9.0);
        let length = (middle - first).norm() + (last - middle).norm();
        assert!((2.0 * cut.radius - length).abs() < 1e-9);
        // Both ends lie in its plane, but for the halves of pixels that are picked.
        for end in [first, last] {
            assert!((end - centre).dot(&normal).abs() < 0.3, "{}", (end - centre).dot(&normal));
        }
        // Its mouth is seen along the line.
        let [a, b] = cut.at[0].unwrap();
        let way = [b[0] - a[0], b[1] - a[1]];
        let turn = (way[0] * (to[1] - from[1]) - way[1] * (to[0] - from[0])) / way[0].hypot(way[1]) / 0.24;
        assert!(turn.abs() < 0.03, "{turn}");
        assert_as_piped(&model);
    }
}

#[test]
fn a_line_that_is_none_or_lies_beside_the_body_says_what_to_do() {
    let mut model = model(BALL);
    let before = model.figures();
    for (line, says) in [
        (stroke(Pane::Axial, [0.5; 2], [0.5; 2]), "too short"),
        (stroke(Pane::Volume, [0.5; 2], [0.51, 0.5]), "too short"),
        (stroke(Pane::Volume, [0.5; 2], [0.99, 0.5]), "leaves what is seen"),
        (stroke(Pane::Axial, [0.5; 2], [1.5, 0.5]), "leaves what is seen"),
        (stroke(Pane::Volume, [0.01; 2], [0.01; 2]), "nothing is seen"),
        (stroke(Pane::Coronal, [0.01, 0.01], [0.3, 0.01]), "nothing is seen"),
    ] {
        let refused = model.follow(&line).unwrap_err().to_string();
        assert!(refused.contains(says) && refused.contains("draw"), "{line:?}: {refused}");
        assert_eq!(model.figures(), before);
    }
}

#[test]
fn a_slider_opens_the_cut_where_it_is() {
    let mut model = model(BALL);
    follow(&mut model, &stroke(Pane::Axial, [0.3, 0.5], [0.7, 0.5]));
    let cut = model.figures().incision.unwrap();
    // A step behind it: the cut stays where it was put all the same.
    let push = Shape {
        kind: Kind::Translate { by: [0.0, 0.0, 0.5] },
        centre: [16.0; 3],
        axis: [0.0, 0.0, 1.0],
        radius: 8.0,
        core: 0.3,
    };
    model.session_mut().apply(Event::Space { id: None, step: Step::Shape(push) }, &Exec::default()).unwrap();
    follow(&mut model, &Request::Adjust);
    for open in [1.0, 1.4, 1.8] {
        let told = follow(&mut model, &Request::Open { space: cut.id, radius: 7.0, open });
        assert_eq!(told.refused, None);
    }
    let told = follow(&mut model, &Request::Drop);
    let now = told.incision.unwrap();
    assert_eq!(
        (now.id, now.centre, now.normal, now.radius, now.open),
        (cut.id, cut.centre, cut.normal, 7.0, 1.8)
    );
    assert_eq!(told.undo.as_deref(), Some("change a cut"));
    assert_as_piped(&model);
    let undone = follow(&mut model, &Request::Undo).incision.unwrap();
    assert_eq!((undone.radius, undone.open), (cut.radius, cut.open));
    assert!(model.follow(&Request::Open { space: 9, radius: 7.0, open: 1.0 }).is_err());
    let closed = follow(&mut model, &Request::Close { space: cut.id });
    assert!(closed.incision.is_none() && closed.space.len() == 1);
}

#[test]
fn a_plane_keeps_what_lies_behind_it_and_is_moved_turned_and_taken_away() {
    let mut model = model(BALL);
    let whole = model.session().deformed().clone();
    let value = |model: &Model, y: usize| model.session().deformed().value(VoxelIndex([16, y, 16]));
    // From the front one looks towards the back: what lies before the slice goes.
    let told = follow(&mut model, &Request::ClipHere { along: Pane::Coronal });
    assert_eq!((told.refused, told.clips.len()), (None, 1));
    let ClipPart::Plane(plane) = told.clips[0].part else { panic!("a plane") };
    assert!(plane.normal[1] < 0.0 && value(&model, 20) == 0.0 && value(&model, 12) > 0.0);
    // The slice that it lies along stays to be seen.
    let slice = told.slices[1].slice;
    assert!(value(&model, slice) > 0.0 && value(&model, slice + 1) == 0.0 && !told.slices[1].clipped);
    let moved = HalfSpace { point: [16.0, 22.0, 16.0], ..plane };
    follow(&mut model, &Request::Adjust);
    follow(&mut model, &Request::MoveClip { clip: 0, part: ClipPart::Plane(moved) });
    let told = follow(&mut model, &Request::Drop);
    assert_eq!((told.refused, told.undo.as_deref()), (None, Some("change a clip")));
    assert!(value(&model, 20) > 0.0 && value(&model, 25) == 0.0);
    let turned = HalfSpace { normal: plane.normal.map(|c| -c), ..moved };
    follow(&mut model, &Request::MoveClip { clip: 0, part: ClipPart::Plane(turned) });
    assert!(value(&model, 20) == 0.0 && value(&model, 25) > 0.0);
    assert_as_piped(&model);
    let told = follow(&mut model, &Request::Unclip { clip: 0 });
    assert!(told.clips.is_empty() && model.session().deformed() == &whole);
    // Facing whoever looks it goes through the same place.
    follow(&mut model, &Request::Orbit { by: [0.1, 0.1] });
    let told = follow(&mut model, &Request::ClipHere { along: Pane::Volume });
    let ClipPart::Plane(plane) = told.clips[0].part else { panic!("a plane") };
    assert_eq!(plane.point, told.cross);
    assert!(plane.normal[1] < 0.0 && plane.normal[0] != 0.0);
}

#[test]
fn a_box_keeps_what_lies_in_it() {
    let mut model = model(BALL);
    let whole = model.session().deformed().clone();
    let [min, max] = model.figures().extent;
    let told = follow(&mut model, &Request::ClipBox { min, max });
    assert_eq!((told.refused, told.clips.len()), (None, 1));
    assert_eq!(model.session().deformed(), &whole, "about what is shown it takes nothing away");
    let part = ClipPart::Box(Cuboid { min, max: [max[0], max[1], 18.0] });
    follow(&mut model, &Request::MoveClip { clip: told.clips[0].id, part });
    let value = |z: usize| model.session().deformed().value(VoxelIndex([16, 16, z]));
    assert!(value(17) > 0.0 && value(20) == 0.0);
    assert_as_piped(&model);
}

#[test]
fn planes_go_with_the_body_or_stand_still() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Radius { handle: None, radius: 9.0 });
    follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -2.0, 0.0] });
    assert!(follow(&mut model, &Request::ClipIn { space: Lies::Rest }).refused.is_some(), "nothing clips");
    let at = model.figures().handles[0].now;
    let clip = Request::Clip { point: at, normal: [0.0, -1.0, 0.0] };
    let still = follow(&mut model, &clip);
    assert_eq!((still.refused, still.clip_space), (None, Lies::Deformed));
    let seen = model.session().deformed().clone();
    let moving = follow(&mut model, &Request::ClipIn { space: Lies::Rest });
    assert_eq!((moving.refused, moving.clip_space), (None, Lies::Rest));
    assert!(model.session().deformed() != &seen);
    assert_as_piped(&model);
    // One more goes through what is seen there, wherever that was at rest.
    let told = follow(&mut model, &clip);
    assert_eq!((told.refused, told.clips.len()), (None, 2));
    let ClipPart::Plane(plane) = told.clips[1].part else { panic!("a plane") };
    assert_eq!(plane.point, model.rest_of(at));
    assert!(plane.point[1] - at[1] > 1.0, "{plane:?}");
    assert_eq!(follow(&mut model, &Request::ClipIn { space: Lies::Deformed }).clip_space, Lies::Deformed);
    assert_as_piped(&model);
}

#[test]
fn bones_are_told_and_turned() {
    let mut model = model(&format!("{BALL}{BONED}"));
    let bone = model.figures().bones[0].clone();
    assert_eq!((&*bone.name, bone.pivot, bone.angle, bone.by), ("0", Some([16.0, 16.0, 5.0]), 0.0, [0.0; 3]));
    let turn = Request::Turn {
        bone: 0,
        pivot: bone.pivot.unwrap(),
        axis: bone.axis,
        angle: 5.0,
        by: [0.0, 0.5, 0.0],
    };
    let told = follow(&mut model, &turn);
    assert_eq!((told.refused, told.undo.as_deref()), (None, Some("turn a bone")));
    let now = told.bones[0].clone();
    assert_eq!((now.angle, now.by, now.pivot, now.axis), (5.0, [0.0, 0.5, 0.0], bone.pivot, bone.axis));
    assert!(told.largest_mm > 0.4);
    assert_as_piped(&model);
    assert_eq!(follow(&mut model, &Request::Undo).bones[0], bone);
}

#[test]
fn what_no_window_asks_for_is_refused() {
    let mut model = model(BALL);
    let far = [1e7, 0.0, 0.0];
    let plane =
        |point, normal| Request::MoveClip { clip: 0, part: ClipPart::Plane(HalfSpace { point, normal }) };
    for request in [
        stroke(Pane::Axial, [f64::NAN, 0.5], [0.5; 2]),
        stroke(Pane::Axial, [0.5; 2], [9.0, 0.5]),
        Request::Open { space: 0, radius: -1.0, open: 1.0 },
        Request::Open { space: 0, radius: 5.0, open: f64::NAN },
        Request::Open { space: 0, radius: 1e9, open: 1.0 },
        Request::ClipBox { min: far, max: [1.0; 3] },
        Request::ClipBox { min: [f64::NAN; 3], max: [1.0; 3] },
        plane(far, [1.0; 3]),
        plane([0.0; 3], [f64::INFINITY; 3]),
        Request::MoveClip { clip: 0, part: ClipPart::Box(Cuboid { min: [0.0; 3], max: far }) },
    ] {
        assert!(request.check().is_err() && model.follow(&request).is_err(), "{request:?}");
    }
    for request in [plane([16.0; 3], [0.0; 3]), Request::ClipBox { min: [9.0; 3], max: [1.0; 3] }] {
        assert!(follow(&mut model, &request).refused.is_some(), "{request:?}");
    }
    for _ in 0..64 {
        model.follow(&Request::ClipBox { min: [0.0; 3], max: [40.0; 3] }).unwrap();
    }
    let many = model.follow(&Request::ClipHere { along: Pane::Axial }).unwrap_err();
    assert!(many.to_string().contains("there are 64"), "{many}");
}

#[test]
fn colours_over_slices_tell_of_what_moved_and_change_nothing() {
    let mut model = model(BALL);
    let draw = |model: &Model| model.draw(Pane::Axial, 1, &Exec::default()).unwrap();
    let rest = draw(&model);
    for of in Overlay::ALL {
        follow(&mut model, &Request::Overlay { of: Some(of) });
        assert_eq!(draw(&model), rest, "no class is known, and where nothing moves there is no colour");
    }
    follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] });
    let voxels = model.session().deformed().clone();
    let coloured = |image: &ivd_core::Image| {
        let pixels = image.rgba().chunks_exact(4).enumerate();
        let coloured = pixels.filter(|(_, pixel)| pixel[0] != pixel[1] || pixel[1] != pixel[2]);
        coloured.map(|(i, _)| [i % 32, 31 - i / 32]).collect::<Vec<_>>()
    };
    let inverse = model.session().displacement().inverse().clone();
    let moved = |[x, y]: [usize; 2]| inverse.at(VoxelIndex([31 - x, y, 16])) != [0.0; 3];
    for of in [Overlay::Motion, Overlay::Volume] {
        let told = follow(&mut model, &Request::Overlay { of: Some(of) });
        assert_eq!(told.overlay, Some(of));
        let found = coloured(&draw(&model));
        assert!(found.len() > 20, "{of:?}");
        // A change of volume is seen one voxel further than the motion that makes it.
        let near = |[x, y]: [usize; 2]| {
            (0..9).any(|i| moved([(x + i % 3).clamp(1, 32) - 1, (y + i / 3).clamp(1, 32) - 1]))
        };
        assert!(found.iter().all(|at| near(*at)), "{of:?}");
        assert_eq!(model.session().deformed(), &voxels);
    }
    let none = follow(&mut model, &Request::Overlay { of: None });
    assert!(none.overlay.is_none() && coloured(&draw(&model)).is_empty());
}

#[test]
fn a_second_line_cuts_what_it_is_drawn_over() {
    let mut model = model(BALL);
    follow(&mut model, &stroke(Pane::Axial, [0.5, 0.3], [0.5, 0.7]));
    follow(&mut model, &Request::Open { space: 0, radius: 9.0, open: 3.0 });
    // Beside a lip, which the first cut has moved; that closes.
    let at = [0.62, 0.5];
    let seen = follow(&mut model, &Request::Hover { pane: Pane::Axial, at }).hovered.unwrap().place;
    let rest = model.session().rest_of(seen);
    let told = follow(&mut model, &stroke(Pane::Axial, [at[0], 0.35], [at[0], 0.65]));
    assert_eq!(told.refused, None);
    let cut = told.incision.unwrap();
    let far = |place: [f64; 3]| (Vector3::from(cut.centre) - Vector3::from(place)).norm();
    assert!(far(rest) < 0.05 && far(seen) > 0.5, "{} from what it lies over, {}", far(rest), far(seen));
    assert_as_piped(&model);
}

#[test]
fn the_whole_volume_is_what_the_pipeline_makes_of_the_scene_without_its_clips() {
    let mut model = model(BALL);
    for request in [
        Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] },
        Request::Clip { point: [16.0; 3], normal: [1.0, 0.0, 0.0] },
        Request::ClipBox { min: [2.0; 3], max: [30.0, 20.0, 30.0] },
    ] {
        assert_eq!(follow(&mut model, &request).refused, None);
    }
    let exec = Exec::default();
    let text = String::from_utf8(model.save(Saved::Scene, String::new(), &exec).unwrap().bytes).unwrap();
    let mut scene = ivd_pipeline::scene::parse(&text, &[]).unwrap();
    scene.remove(&ivd_field::clip::STAGE).unwrap();
    let (_, piped) = made(&scene.to_text().unwrap());
    assert_eq!(model.session().whole().voxels(), piped.voxels());
    let file = |model: &Model, what| model.save(what, String::new(), &exec).unwrap();
    let [whole, clipped] = [Saved::Whole, Saved::Volume].map(|what| file(&model, what));
    assert_eq!((whole.name, clipped.name), ("deformed.nii.gz", "deformed.nii.gz"));
    assert!(whole.bytes != clipped.bytes);
    for clip in [1, 0] {
        follow(&mut model, &Request::Unclip { clip });
    }
    assert_eq!(file(&model, Saved::Volume).bytes, whole.bytes);
    assert_eq!(file(&model, Saved::Whole).bytes, whole.bytes, "nothing is clipped");
}

#[test]
fn slices_tell_where_planes_and_boxes_take_something_away() {
    let mut model = model(BALL);
    let clipped = |told: &Figures| told.slices.map(|slice| slice.clipped);
    assert_eq!(clipped(&model.figures()), [false; 3]);
    // What lies to the left of x = 22 goes; the sagittal slice lies on the other side.
    let told = follow(&mut model, &Request::Clip { point: [22.0, 16.0, 16.0], normal: [-1.0, 0.0, 0.0] });
    assert_eq!(clipped(&told), [true, true, false]);
    let told = follow(&mut model, &Request::Slice { pane: Pane::Sagittal, steps: 40 });
    let far = told.slices[2].clipped;
    let told = follow(&mut model, &Request::Slice { pane: Pane::Sagittal, steps: -7 });
    assert!(
        !far && told.slices[2].slice == 24 && told.slices[2].clipped,
        "beside the ball there is nothing to take"
    );
    // All of that slice is taken; it can be read all the same, and pointed at.
    let [axial, sagittal] = [Pane::Axial, Pane::Sagittal].map(|pane| pixels(&model, pane));
    let told = follow(&mut model, &Request::Hover { pane: Pane::Sagittal, at: [0.5, 0.5] });
    assert!(told.hovered.unwrap().value.is_some_and(|value| value > 127.5), "as it was before it was taken");
    let told = follow(&mut model, &Request::Unclip { clip: 0 });
    assert_eq!(clipped(&told), [false; 3]);
    let taken = |grey: u8| [(0.3 * f64::from(grey)).round() as u8; 3];
    let mut kept = [0, 0];
    for (clipped, whole) in [(axial, Pane::Axial), (sagittal, Pane::Sagittal)] {
        for (clipped, whole) in clipped.iter().zip(pixels(&model, whole)) {
            let is_kept = *clipped == whole;
            assert!(is_kept || *clipped == taken(whole[0]), "{clipped:?} of {whole:?}");
            kept[usize::from(is_kept)] += usize::from(whole[0] > 0);
        }
    }
    assert!(kept.into_iter().all(|voxels| voxels > 100), "taken and kept: {kept:?}");
}

/// A slice: red, green and blue of its pixels.
fn pixels(model: &Model, pane: Pane) -> Vec<[u8; 3]> {
    let image = model.draw(pane, 1, &Exec::default()).unwrap();
    image.rgba().chunks(4).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
}

#[test]
fn what_was_seen_once_is_seen_again() {
    let mut model = model(BALL);
    for request in [
        Request::Orbit { by: [0.3, -0.2] },
        Request::Zoom { factor: 1.7, at: [0.4, 0.6] },
        Request::Window { by: [0.2, 0.1] },
        Request::Radius { handle: None, radius: 6.5 },
        Request::Slice { pane: Pane::Axial, steps: 4 },
    ] {
        follow(&mut model, &request);
    }
    let was = model.figures();
    let pictures = Pane::ALL.map(|pane| model.draw(pane, 1, &Exec::default()).unwrap());
    let mut other = self::model(BALL);
    assert_ne!(other.figures().sight(), was.sight());
    let told = follow(&mut other, &Request::Show { sight: was.sight() });
    assert_eq!(told.sight(), was.sight());
    assert!(told.undo.is_none() && !told.unsaved, "and nothing was done");
    assert_eq!(Pane::ALL.map(|pane| other.draw(pane, 1, &Exec::default()).unwrap()), pictures);
    for wrong in [
        Sight { angles: [0.0, 91.0], ..was.sight() },
        Sight { zoom: 0.0, ..was.sight() },
        Sight { window: [3.0, 3.0], ..was.sight() },
        Sight { cross: [f64::NAN; 3], ..was.sight() },
        Sight { radius: 0.0, ..was.sight() },
        Sight { radius: 1e99, ..was.sight() },
        Sight { roll: 1e5, ..was.sight() },
        Sight { cross: [1e308; 3], ..was.sight() },
        Sight { window: [-1.7e308, 1.7e308], ..was.sight() },
    ] {
        assert!(other.follow(&Request::Show { sight: wrong }).is_err(), "{wrong:?}");
    }
    assert_eq!(other.figures().sight(), was.sight());
}

#[test]
fn classes_lie_over_slices_in_their_colours_and_go_with_the_body() {
    let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 3\n");
    let mut model = model(&by_classes.replace("mode = \"iso\"\niso = 127.5\n", ""));
    let class = model.figures().classes.last().unwrap().clone();
    assert!(class.ml.is_some_and(|ml| ml > 0.5 && ml < 32.0_f64.powi(3) * 1e-3), "{class:?}");
    // The ball's surface is of its outer class but for little, whichever way its values run.
    let shares: Vec<f64> = model.figures().classes.iter().filter_map(|class| class.of_surface).collect();
    assert!(shares.iter().all(|share| (0.0..=1.0).contains(share)), "{shares:?}");
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{shares:?}");
    let red =
        Request::Class { class: class.id, hidden: false, opacity: None, colour: Some("#ff0000".to_owned()) };
    follow(&mut model, &red);
    let draw = |model: &Model| model.draw(Pane::Axial, 1, &Exec::default()).unwrap();
    follow(&mut model, &Request::Overlay { of: Some(Overlay::Classes) });
    let is_red = |model: &Model| {
        let image = draw(model);
        let red = image.rgba().chunks_exact(4).map(|now| now[0] > now[1] && now[1] == now[2]);
        red.collect::<Vec<_>>()
    };
    let at_rest = is_red(&model);
    // What the pointer is told of is what is coloured.
    for (i, red) in at_rest.iter().enumerate() {
        let at = [(i % 32) as f64, (i / 32) as f64].map(|c| (c + 0.5) / 32.0);
        let told = follow(&mut model, &Request::Hover { pane: Pane::Axial, at }).hovered.unwrap();
        assert_eq!(told.class == Some(class.id), *red, "{at:?}");
    }
    assert!(at_rest.iter().filter(|red| **red).count() > 20);
    follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, 3.0, 0.0] });
    let now = is_red(&model);
    assert_ne!(now, at_rest, "they go with what is pulled");
    follow(&mut model, &Request::Compare { shows: Shows::Rest, at: 0.5 });
    assert_eq!(is_red(&model), at_rest);
}

#[test]
fn a_handle_is_taken_hold_of_wherever_it_is_shown() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Radius { handle: None, radius: 5.0 });
    follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.0; 3] });
    let told = model.figures();
    let at = told.handles[0].at[Pane::Axial.number()].unwrap();
    // Beside its slice it is faint, and taken hold of; where its reach ends it isn't shown, and another is made.
    let higher = |model: &mut Model, steps| follow(model, &Request::Slice { pane: Pane::Axial, steps });
    for (steps, seen) in [(0, true), (4, true), (4, false)] {
        let told = higher(&mut model, steps);
        assert_eq!(told.handles[0].seen[Pane::Axial.number()], seen, "{:?}", told.handles[0].off);
        let grabbed = follow(&mut model, &Request::Grab { pane: Pane::Axial, at });
        assert_eq!(grabbed.held == Some(told.handles[0].id), seen);
        follow(&mut model, &Request::Abandon);
        assert_eq!(model.figures().handles.len(), 1);
    }
    // From its side, and from the other, where the ball hides it; and where that is cut away.
    for (side, seen) in [(Side::Front, true), (Side::Back, false), (Side::Front, true)] {
        let told = follow(&mut model, &Request::Look { side });
        assert_eq!((told.handles[0].seen[0], told.handles[0].beside[0]), (seen, !seen), "{side:?}");
    }
    follow(&mut model, &Request::Look { side: Side::Back });
    follow(&mut model, &Request::Slice { pane: Pane::Coronal, steps: 7 });
    let told = follow(&mut model, &Request::Cut { along: Some(Pane::Coronal) });
    assert!(told.handles[0].seen[0] && told.handles[0].beside[0], "behind what is left of the ball");
    // What hides no more than it reaches leaves it to be taken hold of.
    let at = told.handles[0].at[0].unwrap();
    assert_eq!(follow(&mut model, &Request::Grab { pane: Pane::Volume, at }).held, Some(told.handles[0].id));
}

#[test]
fn a_handle_tells_how_far_the_voxels_there_have_gone() {
    let mut model = model(BALL);
    let told = follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] });
    let one = &told.handles[0];
    let left = (0..3).map(|a| (one.gone.unwrap()[a] - one.by.unwrap()[a]).powi(2)).sum::<f64>().sqrt();
    assert!(left <= told.left_mm + 1e-3 && told.left_mm < 1.0, "{left} of {}", told.left_mm);
    // With a cut beside it voxels go elsewhere as well.
    let cut = Request::Stroke { pane: Pane::Axial, from: [0.5, 0.2], to: [0.5, 0.4] };
    assert_eq!(follow(&mut model, &cut).handles[0].gone, None);
}

#[test]
fn the_slices_are_brought_where_most_is_squeezed() {
    let mut model = model(BALL);
    let none = follow(&mut model, &Request::ShowSqueezed);
    assert_eq!(
        (none.overlay, none.cross),
        (Some(Overlay::Volume), model.figures().cross),
        "nothing has moved"
    );
    follow(&mut model, &Request::Radius { handle: None, radius: 9.0 });
    follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.5, -3.0, 0.0] });
    let told = follow(&mut model, &Request::ShowSqueezed);
    // A plain loop over all voxels but the outermost, by differences to both sides.
    let displacement = model.session().displacement();
    let (grid, back) = (displacement.grid(), displacement.inverse());
    let way = |at: [usize; 3]| Vector3::from(back.at(VoxelIndex(at))).map(f64::from);
    let mut least = (f64::INFINITY, [0; 3]);
    for at in (0..30 * 30 * 30).map(|i| [1 + i % 30, 1 + i / 30 % 30, 1 + i / 900]) {
        let column = |a: usize| {
            let beside =
                |by: usize| way(std::array::from_fn(|b| if a == b { at[b] + by - 1 } else { at[b] }));
            (beside(2) - beside(0)) / 2.0
        };
        let change = Matrix3::from_columns(&[column(0), column(1), column(2)]) * grid.inverse_linear_part();
        let left = 1.0 / (Matrix3::identity() + change).determinant();
        if left < least.0 {
            least = (left, at);
        }
    }
    assert!(least.0 < 0.8 && least.0 >= told.min_det_j - 0.1, "{least:?}, proven {}", told.min_det_j);
    let there: [f64; 3] = grid.world(VoxelIndex(least.1).into()).0.into();
    assert_eq!(told.cross, there);
    assert!(told.slices.iter().zip([2, 1, 0]).all(|(slice, axis)| slice.slice == least.1[axis]));
    // Pointed at, it is told how much of it is left there, while colours tell of that.
    let at = told.cross_at[Pane::Axial.number()].unwrap();
    let hover = Request::Hover { pane: Pane::Axial, at };
    let times = follow(&mut model, &hover).hovered.unwrap().times.unwrap();
    assert!((times - least.0).abs() < 1e-4, "{times} {least:?}");
    assert_eq!(told.cross_times, Some(times));
    follow(&mut model, &Request::Overlay { of: None });
    assert_eq!(follow(&mut model, &hover).hovered.unwrap().times, None);
}
