//! What a hand does is where it is seen.

use ivd_core::{Cancel, Exec, VoxelCoord, VoxelIndex};
use ivd_field::sampler::Sampler;
use ivd_frames::{Axis, Figures, Model, Pane, Request};
use nalgebra::{Matrix4, Vector3, Vector4};

use super::common::{BALL, model};
use super::scripts::assert_as_piped;

fn follow(model: &mut Model, request: &Request) -> Figures {
    model.follow(request).unwrap();
    model.figures()
}

#[test]
fn what_is_held_goes_with_the_pointer_and_is_one_step() {
    for (pane, at, to) in [
        (Pane::Volume, [0.5, 0.5], [0.52, 0.47]),
        (Pane::Axial, [0.5, 0.2], [0.5, 0.16]),
        (Pane::Sagittal, [0.2, 0.5], [0.16, 0.52]),
    ] {
        let mut model = model(BALL);
        let rest = model.session().deformed().clone();
        let grabbed = follow(&mut model, &Request::Grab { pane, at });
        assert_eq!((grabbed.handles.len(), grabbed.held), (1, Some(0)), "{:?}", grabbed.refused);
        let before = grabbed.handles[0].at[pane.number()].unwrap();
        // The vertex is one of a coarse lattice: not quite where the pointer is.
        assert!((before[0] - at[0]).hypot(before[1] - at[1]) < 0.08, "{before:?}");
        for share in [0.3, 0.7, 1.0] {
            let here = [0, 1].map(|a| at[a] + share * (to[a] - at[a]));
            model.follow(&Request::Drag { to: here, lock: None }).unwrap();
        }
        let dragged = model.figures();
        assert_eq!(dragged.refused, None);
        let is_met = dragged.handles[0].off.iter().all(|off| off.abs() <= 2.0);
        assert!(is_met || pane != Pane::Volume, "what is pressed from outside is seen in the slices");
        let after = dragged.handles[0].at[pane.number()].unwrap();
        let way = [0, 1].map(|a| (after[a] - before[a]) - (to[a] - at[a]));
        assert!(way[0].hypot(way[1]) < 1e-6, "{pane:?} off by {way:?}");
        assert!(model.session().deformed() != &rest);
        let dropped = follow(&mut model, &Request::Drop);
        assert_eq!((dropped.held, dropped.undo.as_deref()), (None, Some("drag a new handle")));
        assert!(dropped.handles[0].off.iter().all(|off| off.abs() <= 0.5), "the slices meet there");
        // Taken hold of again, it goes on from where it is.
        let again = follow(&mut model, &Request::Grab { pane, at: after });
        assert_eq!((again.handles.len(), again.held), (1, Some(0)));
        follow(&mut model, &Request::Drag { to: before, lock: None });
        let abandoned = follow(&mut model, &Request::Abandon);
        assert_eq!(abandoned.handles, dropped.handles);
        let undone = follow(&mut model, &Request::Undo);
        assert!(undone.handles.is_empty() && undone.redo.is_some());
        assert_eq!(model.session().deformed(), &rest);
    }
}

#[test]
fn what_a_handle_would_take_is_shown_in_slices_that_it_would_reach() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Radius { handle: None, radius: 3.0 });
    let at = [0.5, 0.5];
    let far = follow(&mut model, &Request::Hover { pane: Pane::Volume, at }).hovered.unwrap();
    // From in front the slices through the middle meet its skin there, but for the coronal one.
    assert_eq!(far.vertex_at.map(|at| at.is_some()), [true, true, false, true], "{far:?}");
    let cross = Request::Cross { pane: Pane::Axial, at: far.at[Pane::Axial.number()].unwrap() };
    follow(&mut model, &cross);
    let near = follow(&mut model, &Request::Hover { pane: Pane::Volume, at }).hovered.unwrap();
    assert!(near.vertex_at.iter().all(Option::is_some), "{near:?}");
}

#[test]
fn a_lock_keeps_the_motion_to_an_axis_of_the_patient() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    let locked = follow(&mut model, &Request::Drag { to: [0.53, 0.46], lock: Some(Axis::Z) });
    let by = locked.handles[0].by.unwrap();
    assert!(by[0] == 0.0 && by[1] == 0.0 && by[2] > 0.5, "{by:?}");
}

#[test]
fn a_press_from_in_front_goes_in_and_beside_it_the_same_key_follows_the_pointer() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    let locked = |to| Request::Drag { to, lock: Some(Axis::N) };
    let pressed = follow(&mut model, &locked([0.5, 0.45]));
    let handle = &pressed.handles[0];
    let (by, out) = (Vector3::from(handle.by.unwrap()), Vector3::from(handle.rest) - Vector3::repeat(16.0));
    assert!(by.norm() > 1.0 && by.dot(&out) < -0.98 * by.norm() * out.norm(), "in: {by:?} of {out:?}");
    assert!(by.dot(&Vector3::from(handle.out.unwrap())) < -0.999_999 * by.norm(), "as it is told");
    // As far as the pointer has gone over the picture.
    assert!(
        (by.norm() / (0.05 * pressed.width_mm) - 1.0).abs() < 1e-6,
        "{} of {}",
        by.norm(),
        pressed.width_mm
    );
    let pulled = Vector3::from(follow(&mut model, &locked([0.5, 0.53])).handles[0].by.unwrap());
    assert!(pulled.dot(&out) > 0.98 * pulled.norm() * out.norm(), "out: {pulled:?}");
    follow(&mut model, &Request::Abandon);
    // In a slice the way out is seen from its side.
    let grabbed = follow(&mut model, &Request::Grab { pane: Pane::Axial, at: [0.5, 0.13] });
    let before = grabbed.handles[0].at[1].unwrap();
    let slid = follow(&mut model, &locked([0.53, 0.1]));
    let (by, out) = (
        Vector3::from(slid.handles[0].by.unwrap()),
        Vector3::from(slid.handles[0].rest) - Vector3::repeat(16.0),
    );
    assert!(by.dot(&out) > 0.97 * by.norm() * out.norm(), "{by:?} of {out:?}");
    assert!(slid.handles[0].at[1].unwrap()[1] < before[1] - 0.02);
}

#[test]
fn what_is_held_goes_as_far_as_it_can_and_how_far_the_hand_is_ahead_is_told() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Radius { handle: None, radius: 4.0 });
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    let good = follow(&mut model, &Request::Drag { to: [0.51, 0.5], lock: None });
    assert_eq!(good.refused, None);
    let gone = |told: &Figures| Vector3::from(told.handles[0].by.unwrap()).norm();
    let mut before = gone(&good);
    for _ in 0..12 {
        let refused = follow(&mut model, &Request::Drag { to: [1.4, 0.5], lock: None });
        let why = refused.refused.clone().unwrap();
        assert!(why.ahead_mm > 10.0 && !why.why.is_empty(), "{why:?}");
        assert!(gone(&refused) >= before, "what was possible stays");
        before = gone(&refused);
    }
    assert!(before > 1.3 * gone(&good), "{before} of {}", gone(&good));
    let let_go = follow(&mut model, &Request::Drop);
    assert_eq!(let_go.undo.as_deref(), Some("drag a new handle"));
    let told = let_go.refused.clone().unwrap();
    let said = format!("it went {:.1} mm, not ", gone(&let_go));
    assert!(told.ahead_mm == 0.0 && told.why.starts_with(&said), "{told:?}");
    assert!(gone(&let_go) >= before);
    // What is there is what the scene makes.
    assert_as_piped(&model);
    // One long drag that is let go of comes there as well.
    let handle = let_go.handles[0].id;
    follow(&mut model, &Request::Move { handle, by: [0.0; 3] });
    let at = model.figures().handles[0].at[0].unwrap();
    assert_eq!(follow(&mut model, &Request::Grab { pane: Pane::Volume, at }).held, Some(handle));
    follow(&mut model, &Request::Drag { to: [1.4, 0.5], lock: None });
    let at_once = gone(&follow(&mut model, &Request::Drop));
    assert!(at_once > 0.8 * gone(&let_go), "{at_once} of {}", gone(&let_go));
    // A hand that comes back is followed all the way; what pulls with a force isn't turned back.
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at });
    follow(&mut model, &Request::Abandon);
    follow(&mut model, &Request::Pull { handle, with: [3.0, 0.0, 0.0] });
    let pulled = model.figures();
    let at = pulled.handles[0].at[0].unwrap();
    let by_force = pulled.largest_mm;
    assert_eq!(follow(&mut model, &Request::Grab { pane: Pane::Volume, at }).held, Some(handle));
    let refused = follow(&mut model, &Request::Drag { to: [at[0] + 1.0, at[1]], lock: None });
    assert!(
        refused.refused.is_some() && refused.largest_mm >= by_force,
        "{} of {by_force}",
        refused.largest_mm
    );
    let back = follow(&mut model, &Request::Drag { to: [at[0] + 0.005, at[1]], lock: None });
    assert_eq!(back.refused, None);
}

#[test]
fn places_go_back_through_the_deformation_to_where_they_were() {
    let shape = "[[deform.shape]]\nkind = \"translate\"\nby = [0.0, 1.5, 0.5]\ncentre = [16.0, 16.0, 16.0]\nradius = 15.0\ncore = 0.6\n";
    let model = model(&format!("{BALL}{shape}"));
    let displacement = model.session().displacement();
    let (grid, forward) = (displacement.grid(), Sampler::new(displacement.forward(), displacement.grid()));
    let mut furthest: f64 = 0.0;
    for i in 0..2000_usize {
        let rest = Vector3::new(i % 23, i / 23 % 19, i * 7 % 29).map(|c| 2.3 + c as f64);
        let moved = rest + forward.at(rest);
        furthest = furthest.max((moved - rest).norm());
        let back = model.rest_of(grid.world(VoxelCoord(moved)).0.into());
        let off = (Vector3::from(back) - grid.world(VoxelCoord(rest)).0).norm();
        assert!(off < 0.01, "{rest} went to {moved} and came back {off} mm off");
    }
    assert!(furthest > 1.0, "{furthest}");
    let hovered = {
        let mut model = model;
        follow(&mut model, &Request::Hover { pane: Pane::Axial, at: [0.5, 0.5] }).hovered.unwrap()
    };
    assert!(hovered.vertex.is_some() && hovered.value.is_some());
    assert!(hovered.place[1] - hovered.rest[1] > 0.2, "{hovered:?}");
}

#[test]
fn panes_that_nothing_touches_stay_as_they_are() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Radius { handle: None, radius: 5.0 });
    // The upper slices lie off the handle's reach.
    follow(&mut model, &Request::Slice { pane: Pane::Axial, steps: 14 });
    let (before, slices) =
        (model.versions(), Pane::ALL.map(|pane| model.draw(pane, 1, &Exec::default()).unwrap()));
    // In a slice: what is pressed in the volume brings the slices there.
    let at =
        follow(&mut model, &Request::Hover { pane: Pane::Volume, at: [0.5, 0.6] }).hovered.unwrap().vertex_at;
    let from = at[Pane::Sagittal.number()].unwrap();
    follow(&mut model, &Request::Grab { pane: Pane::Sagittal, at: from });
    follow(&mut model, &Request::Drag { to: from.map(|c| c + 0.02), lock: None });
    let after = model.versions();
    let drawn = Pane::ALL.map(|pane| model.draw(pane, 1, &Exec::default()).unwrap());
    for pane in Pane::ALL.map(Pane::number) {
        let changed = slices[pane] != drawn[pane];
        assert!(!changed || before[pane] < after[pane], "pane {pane} changed unsaid");
    }
    assert_eq!(before[1], after[1], "the axial slice lies elsewhere");
    assert!(before[0] < after[0] && slices[0] != drawn[0]);
}

#[test]
fn the_camera_follows_the_hand() {
    let mut model = model(BALL);
    let first = model.figures();
    assert_eq!((first.angles, first.letters), ([0.0, 0.0], Some(["R", "L", "S", "I"])));
    let turned = follow(&mut model, &Request::Orbit { by: [0.25, 0.1] });
    assert_eq!(turned.angles, [315.0, 18.0]);
    follow(&mut model, &Request::Look { side: ivd_render::Side::Front });
    follow(&mut model, &Request::Cross { pane: Pane::Axial, at: [0.7, 0.3] });
    let seen = |figures: &Figures| figures.cross_at[0].unwrap();
    let before = model.figures();
    let panned = follow(&mut model, &Request::Pan { by: [0.05, -0.1] });
    let moved = [0, 1].map(|a| seen(&panned)[a] - seen(&before)[a]);
    assert!((moved[0] - 0.05).abs() < 1e-9 && (moved[1] + 0.1).abs() < 1e-9, "{moved:?}");
    let at = seen(&panned);
    let zoomed = follow(&mut model, &Request::Zoom { factor: 2.0, at });
    let off = [0, 1].map(|a| seen(&zoomed)[a] - at[a]);
    assert!(off[0].hypot(off[1]) < 1e-9 && (zoomed.width_mm * 2.0 - panned.width_mm).abs() < 1e-9, "{off:?}");
    let reset = follow(&mut model, &Request::ResetView);
    assert_eq!((reset.angles, reset.width_mm), (first.angles, first.width_mm));
}

#[test]
fn the_crosshair_joins_the_slices() {
    let mut model = model(BALL);
    let crossed = follow(&mut model, &Request::Cross { pane: Pane::Coronal, at: [0.31, 0.77] });
    let at = crossed.cross_at[Pane::Coronal.number()].unwrap();
    assert!((at[0] - 0.31).hypot(at[1] - 0.77) < 1e-9);
    let voxel = [0, 1, 2].map(|a| crossed.cross[a].round() as usize);
    assert_eq!(crossed.cross_value, Some(model.session().rest().value(VoxelIndex(voxel))));
    // Left is right in the pictures: the axial and the coronal slice agree on where.
    assert!((crossed.cross_at[Pane::Axial.number()].unwrap()[0] - 0.31).abs() < 1e-9);
    let sagittal = crossed.slices.iter().find(|slice| slice.pane == Pane::Sagittal).unwrap();
    assert_eq!(sagittal.slice, voxel[0]);
}

#[test]
fn what_makes_no_sense_is_refused_and_changes_nothing() {
    let mut model = model(BALL);
    let before = model.figures();
    let wrong = [
        Request::Grab { pane: Pane::Volume, at: [0.01, 0.01] },
        Request::Slice { pane: Pane::Volume, steps: 1 },
        Request::Resize { size: [32_768, 32_768] },
        Request::Zoom { factor: f64::NAN, at: [0.5; 2] },
        Request::Zoom { factor: 2.0, at: [f64::INFINITY, 0.5] },
        Request::Radius { handle: None, radius: -1.0 },
        Request::Move { handle: 0, by: [1e308; 3] },
        Request::Orbit { by: [f64::NAN, 0.0] },
        Request::Wheel { steps: i32::MAX },
        Request::Incise { centre: [16.0; 3], normal: [0.0, 0.0, 1.0], radius: -8.0, open: 1.0 },
        Request::Incise { centre: [16.0; 3], normal: [0.0, 0.0, 1.0], radius: 1e308, open: 1.0 },
        Request::Incise { centre: [16.0; 3], normal: [0.0, f64::NAN, 1.0], radius: 8.0, open: 1.0 },
        Request::Clip { point: [f64::INFINITY; 3], normal: [0.0, 0.0, 1.0] },
        Request::Turn { bone: 0, pivot: [0.0; 3], axis: [1.0; 3], angle: f64::NAN, by: [0.0; 3] },
    ];
    for request in wrong {
        assert!(model.follow(&request).is_err(), "{request:?}");
        assert_eq!(model.figures(), before, "{request:?}");
    }
    // What a solver refuses is told beside the picture.
    for request in [
        Request::Move { handle: 7, by: [1.0; 3] },
        Request::Level { level: 200 },
        Request::Stiffness { stiffness: -3.0 },
        Request::Incise { centre: [16.0; 3], normal: [0.0; 3], radius: 8.0, open: 1.0 },
        Request::Incise { centre: [900.0; 3], normal: [0.0, 0.0, 1.0], radius: 8.0, open: 1.0 },
        Request::Clip { point: [16.0; 3], normal: [0.0; 3] },
        Request::Close { space: 3 },
        Request::Unclip { clip: 3 },
        Request::Turn { bone: 0, pivot: [0.0; 3], axis: [1.0; 3], angle: 3.0, by: [0.0; 3] },
        Request::Add { place: [900.0; 3], by: [0.0; 3] },
    ] {
        assert!(follow(&mut model, &request).refused.is_some(), "{request:?}");
    }
    for _ in 0..64 {
        model.follow(&Request::Pin { pane: Pane::Volume, at: [0.5; 2] }).unwrap();
    }
    let many = model.follow(&Request::Pin { pane: Pane::Volume, at: [0.5; 2] }).unwrap_err();
    assert!(many.to_string().contains("there are 64"), "{many}");
}

#[test]
fn a_cut_opens_the_volume_towards_whoever_looks() {
    let mut model = model(BALL);
    let whole = model.draw(Pane::Volume, 1, &Exec::default()).unwrap();
    let depth = |model: &mut Model| {
        let hovered = follow(model, &Request::Hover { pane: Pane::Volume, at: [0.5, 0.5] }).hovered.unwrap();
        hovered.place[1]
    };
    let surface = depth(&mut model);
    // From the front: what is seen lies in the middle now, not on the ball's face.
    for along in [Pane::Volume, Pane::Coronal] {
        follow(&mut model, &Request::Cut { along: Some(along) });
        assert!((depth(&mut model) - 16.0).abs() < 0.5 && surface > 25.0, "{along:?}");
        let opened = model.draw(Pane::Volume, 1, &Exec::default()).unwrap();
        assert_ne!(opened, whole);
        // It goes with the slices.
        let deeper = follow(&mut model, &Request::Slice { pane: Pane::Coronal, steps: -4 }).cross[1];
        assert!((depth(&mut model) - deeper).abs() < 0.5);
        follow(&mut model, &Request::Slice { pane: Pane::Coronal, steps: 4 });
    }
    // From behind the other half goes.
    follow(&mut model, &Request::Cut { along: Some(Pane::Coronal) });
    follow(&mut model, &Request::Look { side: ivd_render::Side::Back });
    assert!((depth(&mut model) - 16.0).abs() < 0.5);
    follow(&mut model, &Request::Cut { along: None });
    follow(&mut model, &Request::ResetView);
    assert_eq!(model.draw(Pane::Volume, 1, &Exec::default()).unwrap(), whole);
}

#[test]
fn what_is_looked_into_near_its_edge_is_opened_in_its_middle() {
    let mut model = model(BALL);
    // As where a handle on its front was dragged.
    let at = model.figures().cross_at[Pane::Sagittal.number()].unwrap();
    for (along, steps, middle) in
        [(Pane::Volume, 11, true), (Pane::Coronal, 11, true), (Pane::Coronal, 6, false)]
    {
        let steps = Request::Slice { pane: Pane::Coronal, steps };
        let before = follow(&mut model, &steps).cross;
        let told = follow(&mut model, &Request::Cut { along: Some(along) });
        assert_eq!((told.cross[0], told.cross[2]), (before[0], before[2]));
        let is_middle = (told.cross[1] - 16.0).abs() < 1.0;
        assert_eq!((is_middle, told.cross == before), (middle, !middle), "{along:?}, {:?}", told.cross);
        follow(&mut model, &Request::Cut { along: None });
        follow(&mut model, &Request::Cross { pane: Pane::Sagittal, at });
    }
    // What is left out with what lies before the plane is hidden, and so is a handle on it; one behind the plane isn't.
    let told = follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.0; 3] });
    assert!(told.handles[0].seen[0] && !told.handles[0].beside[0]);
    let told = follow(&mut model, &Request::Radius { handle: Some(told.handles[0].id), radius: 3.0 });
    assert!(told.handles[0].seen[0]);
    let told = follow(&mut model, &Request::Cut { along: Some(Pane::Coronal) });
    assert!(!told.handles[0].seen[0] && told.handles[0].beside[0], "{:?}", told.cross);
    follow(&mut model, &Request::Cut { along: None });
    // From behind all of it would be left out.
    follow(&mut model, &Request::Slice { pane: Pane::Coronal, steps: 11 });
    follow(&mut model, &Request::Look { side: ivd_render::Side::Back });
    let told = follow(&mut model, &Request::Cut { along: Some(Pane::Coronal) });
    assert!((told.cross[1] - 16.0).abs() < 1.0, "{:?}", told.cross);
}

#[test]
fn a_pin_that_is_too_far_is_refused_and_leaves_the_session_as_it_was() {
    let mut model = model(BALL);
    // In the middle of the ball, more than ten voxel diagonals from its surface at this level there is none; beside it neither.
    let refused = follow(&mut model, &Request::Add { place: [80.0, 16.0, 16.0], by: [0.0; 3] }).refused;
    assert!(refused.is_some());
    let event = ivd_session::Event::Pin {
        id: None,
        pin: ivd_motion::handles::Pin {
            at: ivd_motion::handles::Anchor::NearestTo([80.0, 16.0, 16.0]),
            radius: 2.0,
        },
    };
    let before = model.session().settings().clone();
    assert!(model.session_mut().apply(event, &Exec::default()).is_err());
    assert_eq!(model.session().settings(), &before);
    let grabbed = follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    assert_eq!(grabbed.held, Some(0), "what is refused uses up no number");
}

#[test]
fn a_handle_that_pulls_stays_one_when_its_force_is_typed() {
    let pulls = "[deform]\nsolver = \"projective\"\n[[deform.handle]]\npick = [16.0, 28.0, 16.0]\nforce = [0.0, 30.0, 0.0]\nradius = 9.0\n";
    let mut model = model(&format!("{BALL}{pulls}"));
    let first = model.figures().handles[0].clone();
    assert_eq!((first.by, first.with), (None, Some([0.0, 30.0, 0.0])));
    let pulled = follow(&mut model, &Request::Pull { handle: 0, with: [0.0, 40.0, 0.0] });
    assert_eq!((pulled.refused, pulled.handles[0].with), (None, Some([0.0, 40.0, 0.0])));
    assert!(pulled.handles[0].now[1] > first.now[1]);
    // Taken hold of it goes on from where the force has taken it.
    let at = pulled.handles[0].at[Pane::Axial.number()].unwrap();
    follow(&mut model, &Request::Cross { pane: Pane::Coronal, at: [0.5, 0.5] });
    let held = follow(&mut model, &Request::Grab { pane: Pane::Axial, at });
    let dragged = follow(&mut model, &Request::Drag { to: at, lock: None });
    assert_eq!((held.held, dragged.refused), (Some(0), None));
    let off: f64 = (0..3).map(|a| (dragged.handles[0].now[a] - pulled.handles[0].now[a]).abs()).sum();
    assert!(off < 1e-6, "it jumps by {off}");
}

#[test]
fn a_slider_that_is_held_is_one_step_and_is_called_by_what_it_does() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Adjust);
    for stiffness in [60.0, 70.0, 80.0] {
        follow(&mut model, &Request::Stiffness { stiffness });
    }
    let dropped = follow(&mut model, &Request::Drop);
    assert_eq!((dropped.stiffness, dropped.undo.as_deref()), (80.0, Some("change the stiffness")));
    assert!(dropped.unsaved);
    let undone = follow(&mut model, &Request::Undo);
    assert_eq!((undone.stiffness, undone.undo, undone.unsaved), (50.0, None, false));
    // One that is held and not moved is none.
    follow(&mut model, &Request::Adjust);
    assert_eq!(follow(&mut model, &Request::Drop).undo, None);
}

#[test]
fn only_pixels_whose_rays_meet_bricks_that_changed_change() {
    let mut model = model(BALL);
    // What stays where it is tells where places are seen: four of them, not in one plane.
    let places = [[26.0, 16.0, 16.0], [6.0, 16.0, 16.0], [16.0, 5.0, 16.0], [16.0, 16.0, 27.0]];
    for place in places {
        follow(&mut model, &Request::Add { place, by: [0.0; 3] });
    }
    let spots = model.figures().handles;
    let rest = Matrix4::from_fn(|i, a| if a < 3 { spots[i].rest[a] } else { 1.0 });
    let solved = rest.try_inverse().unwrap();
    let seen = [0, 1].map(|a| solved * Vector4::from_fn(|i, _| spots[i].at[0].unwrap()[a] * 128.0 - 0.5));
    let draw = |model: &Model| model.draw(Pane::Volume, 1, &Exec::default()).unwrap();
    let before = draw(&model);
    let figures = follow(&mut model, &Request::Move { handle: spots[0].id, by: [1.5, 0.0, 0.5] });
    assert_eq!(figures.refused, None);
    let after = draw(&model);
    let mut may_change = vec![false; 128 * 128];
    let bricks = model.session().displacement().inverse().brick_dims();
    for &brick in &model.session().last().dirty {
        let first = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
        // A value is seen up to a voxel beyond its own, and in the slope of one further.
        let ends = first.map(|b| [8.0 * b as f64 - 2.0, 8.0 * b as f64 + 9.0]);
        let corners = (0..8).map(|i| {
            let corner = [ends[0][i & 1], ends[1][i >> 1 & 1], ends[2][i >> 2]];
            let voxel = VoxelCoord(corner.into());
            let place = model.session().rest().grid().world(voxel).0;
            [0, 1].map(|a| seen[a].dot(&Vector4::new(place.x, place.y, place.z, 1.0)))
        });
        let all: Vec<[f64; 2]> = corners.collect();
        let [x, y] = [0, 1].map(|a| {
            let low = all.iter().map(|c| c[a]).fold(f64::INFINITY, f64::min).floor().max(0.0) as usize;
            let high =
                all.iter().map(|c| c[a]).fold(f64::NEG_INFINITY, f64::max).ceil().clamp(0.0, 127.0) as usize;
            low..high + 1
        });
        y.for_each(|row| may_change[128 * row..][x.clone()].fill(true));
    }
    let changed = |i: &usize| before.rgba()[4 * i..][..4] != after.rgba()[4 * i..][..4];
    let changed: Vec<usize> = (0..128 * 128).filter(changed).collect();
    assert!(changed.len() * 100 >= 128 * 128, "{} pixels", changed.len());
    assert!(changed.iter().all(|&i| may_change[i]));
    let may = may_change.iter().filter(|may| **may).count();
    assert!(may < 128 * 128 / 2, "{may} pixels could change");
}

#[test]
fn an_incision_opens_changes_and_closes_and_what_is_clipped_is_gone() {
    let mut model = model(BALL);
    let rest = model.session().deformed().clone();
    let incise = |open| Request::Incise { centre: [16.0; 3], normal: [1.0, 0.0, 0.0], radius: 12.0, open };
    let opened = follow(&mut model, &incise(2.0));
    assert_eq!((opened.refused, opened.space, opened.undo.as_deref()), (None, vec![0], Some("cut open")));
    // There is nothing between the lips, and what lies beside them comes from its own side.
    let lip = |model: &Model, off: f64| model.rest_of([16.0 + off, 16.0, 16.0])[0];
    assert_eq!(model.session().deformed().value(VoxelIndex([16; 3])), 0.0);
    assert!(
        lip(&model, 1.4) > 16.2 && lip(&model, -1.4) < 15.8,
        "{} {}",
        lip(&model, 1.4),
        lip(&model, -1.4)
    );
    let wider = follow(&mut model, &incise(3.0));
    assert_eq!((wider.refused, wider.space, wider.undo.as_deref()), (None, vec![0], Some("change a cut")));
    let clipped = follow(&mut model, &Request::Clip { point: [16.0, 20.0, 16.0], normal: [0.0, -1.0, 0.0] });
    assert_eq!((clipped.refused, clipped.clips.len()), (None, 1));
    let seen = follow(&mut model, &Request::Hover { pane: Pane::Volume, at: [0.4, 0.5] }).hovered.unwrap();
    assert!((seen.place[1] - 20.0).abs() < 1.0, "seen from the front: {:?}", seen.place);
    assert!(follow(&mut model, &Request::Unclip { clip: 0 }).clips.is_empty());
    assert!(follow(&mut model, &Request::Close { space: 0 }).space.is_empty());
    assert_eq!(model.session().deformed(), &rest);
    assert_eq!(follow(&mut model, &incise(1.0)).space, [1], "a number that was given away isn't given again");
}

#[test]
fn a_handle_is_shown_where_steps_in_space_take_what_it_holds() {
    let push = "[[space.step]]\nkind = \"translate\"\nby = [0.0, 0.0, 1.5]\ncentre = [16.0, 28.0, 16.0]\nradius = 9.0\n";
    let mut model = model(&format!("{BALL}{push}"));
    let added = follow(&mut model, &Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -0.5, 0.0] });
    let spot = &added.handles[0];
    let way: Vec<f64> = (0..3).map(|a| spot.now[a] - spot.rest[a]).collect();
    assert!((way[1] + 0.5).abs() < 0.2 && (way[2] - 1.5).abs() < 0.2 && way[0].abs() < 0.1, "{way:?}");
    let back = model.rest_of(spot.now);
    let off: f64 = (0..3).map(|a| (back[a] - spot.rest[a]).abs()).sum();
    assert!(off < 1e-3, "{off}");
    let at = spot.at[Pane::Axial.number()].unwrap();
    follow(&mut model, &Request::Cross { pane: Pane::Coronal, at: [0.5, 0.5] });
    assert!(follow(&mut model, &Request::Grab { pane: Pane::Axial, at }).held.is_some());
}

#[test]
fn what_leaves_the_scan_is_told_by_how_far() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Radius { handle: None, radius: 12.0 });
    let inside = follow(&mut model, &Request::Add { place: [15.5, 15.5, 31.0], by: [0.0, 0.0, 1.0] });
    assert_eq!((inside.handles.len(), inside.cut_off_mm, inside.refused), (1, 0.0, None));
    let outside = follow(&mut model, &Request::Move { handle: 0, by: [0.0, 0.0, 6.0] });
    assert_eq!(outside.refused, None);
    // The last voxel's outer face lies at 31.5 mm.
    let beyond = outside.handles[0].now[2] - 31.5;
    assert!(beyond > 0.5 && (outside.cut_off_mm - beyond).abs() < 1e-6, "{} of {beyond}", outside.cut_off_mm);
    assert_eq!(follow(&mut model, &Request::Undo).cut_off_mm, 0.0);
}

#[test]
fn a_drag_that_is_stopped_stays_where_it_was_when_it_is_let_go_of() {
    let mut model = model(BALL);
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    let before = follow(&mut model, &Request::Drag { to: [0.5, 0.49], lock: None }).handles[0].by;
    let stop = Cancel::default();
    stop.cancel();
    model.stops_by(stop);
    let stopped = follow(&mut model, &Request::Drag { to: [0.5, 0.45], lock: None });
    assert_eq!((stopped.refused.unwrap().why.as_str(), stopped.handles[0].by), ("it was stopped", before));
    model.stops_by(Cancel::default());
    let dropped = follow(&mut model, &Request::Drop);
    assert_eq!((dropped.held, dropped.handles[0].by), (None, before));
    assert!(dropped.refused.is_some_and(|told| told.why.ends_with("it was stopped")));
    // What a slider is stopped at is told after it is let go of, too.
    let stop = Cancel::default();
    stop.cancel();
    model.stops_by(stop);
    follow(&mut model, &Request::Adjust);
    follow(&mut model, &Request::Stiffness { stiffness: 300.0 });
    model.stops_by(Cancel::default());
    let dropped = follow(&mut model, &Request::Drop);
    assert_eq!(dropped.refused.map(|told| told.why).as_deref(), Some("it was stopped"));
    assert!(dropped.stiffness < 300.0);
}
