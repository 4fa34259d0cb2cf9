//! Bones that are drawn.

use ivd_frames::{Figures, Model, Pane, Request, SolverName};

use super::common::{BALL, model};
use super::scripts::assert_as_piped;

fn follow(model: &mut Model, request: &Request) -> Figures {
    model.follow(request).unwrap();
    let told = model.figures();
    assert_eq!(told.refused, None, "{request:?}");
    told
}

fn line(from: [f64; 2], to: [f64; 2]) -> Request {
    Request::DrawBone { pane: Pane::Axial, from, to }
}

/// A ball on springs.
fn springs() -> Model {
    let mut model = model(BALL);
    follow(&mut model, &Request::Solver { solver: SolverName::Springs });
    model
}

/// Where the axial slice shows the ends of a bone's line.
fn seen(told: &Figures, bone: usize) -> [[f64; 2]; 2] {
    told.bones[bone].at[Pane::Axial.number()].unwrap()
}

#[test]
fn rings_know_no_bones_and_a_click_is_none() {
    let refused = model(BALL).follow(&line([0.5, 0.3], [0.5, 0.1])).unwrap_err();
    assert!(refused.to_string().contains("springs first"), "{refused}");
    let mut model = springs();
    for (from, to) in [([0.5, 0.3], [0.5, 0.3]), ([0.5, 0.3], [1.5, 0.3])] {
        assert!(model.follow(&line(from, to)).is_err(), "{from:?} {to:?}");
    }
    assert!(model.figures().bones.is_empty());
}

#[test]
fn a_line_is_a_bone_that_turns_in_its_picture_about_where_it_begins() {
    let mut model = springs();
    // From within the ball up through its skin.
    let told = follow(&mut model, &line([0.5, 0.3], [0.5, 0.06]));
    let bone = &told.bones[0];
    assert!(!bone.carried && !bone.fitted && bone.angle == 0.0);
    assert!((bone.radius.unwrap() - 0.25 * 0.24 * 32.0).abs() < 1e-9, "{:?}", bone.radius);
    let [from, to] = seen(&told, 0);
    assert!((from[1] - 0.3).abs() < 1e-9 && (to[1] - 0.06).abs() < 1e-9, "{from:?} {to:?}");
    let (id, pivot, axis) = (bone.id, bone.pivot.unwrap(), bone.axis);
    let told = follow(&mut model, &Request::Turn { bone: id, pivot, axis, angle: 8.0, by: [0.0; 3] });
    assert!(told.largest_mm > 0.5, "{}", told.largest_mm);
    // Counter-clockwise, as it is seen: its upper end goes to the left.
    let [_, turned] = seen(&told, 0);
    assert!((to[0] - turned[0] - 0.24 * 8.0_f64.to_radians().sin()).abs() < 1e-6, "{turned:?}");
    assert_as_piped(&model);
    follow(&mut model, &Request::Turn { bone: id, pivot, axis, angle: 0.0, by: [0.0; 3] });

    // Another joint, and then less of it.
    let told = follow(&mut model, &Request::Joint { bone: id });
    assert_ne!(told.bones[0].pivot, Some(pivot));
    let told = follow(&mut model, &Request::SetBone { bone: id, radius: 3.0, reach: 4.0 });
    assert_eq!((told.bones[0].radius, told.bones[0].reach), (Some(3.0), 4.0));
    assert_eq!(told.undo.as_deref(), Some("change a bone"));
    let told = follow(&mut model, &Request::RemoveBone { bone: id });
    assert!(told.bones.is_empty());
    let told = follow(&mut model, &Request::Undo);
    assert_eq!(told.bones[0].reach, 4.0);
    for (radius, reach) in [(0.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1e9, 1.0)] {
        assert!(model.follow(&Request::SetBone { bone: id, radius, reach }).is_err(), "{radius} {reach}");
    }
}

#[test]
fn a_line_from_the_end_of_a_bone_is_carried_by_it() {
    let mut model = springs();
    follow(&mut model, &line([0.3, 0.5], [0.11, 0.5]));
    let told = follow(&mut model, &line([0.115, 0.51], [0.2, 0.25]));
    assert!(told.bones[1].carried);
    let [[_, joint], [begins, _]] = [0, 1].map(|bone| seen(&told, bone));
    assert!((0..2).all(|a| (joint[a] - begins[a]).abs() < 1e-9), "they meet: {joint:?} {begins:?}");
    let turn = |told: &Figures, bone: usize, angle| {
        let bone = &told.bones[bone];
        Request::Turn { bone: bone.id, pivot: bone.pivot.unwrap(), axis: bone.axis, angle, by: [0.0; 3] }
    };
    follow(&mut model, &turn(&told, 0, 3.0));
    let told = follow(&mut model, &turn(&told, 1, -2.0));
    assert_as_piped(&model);
    // What carries another can't go alone, and says so.
    model.follow(&Request::RemoveBone { bone: told.bones[0].id }).unwrap();
    let told = model.figures();
    assert!(told.bones.len() == 2 && told.refused.is_some_and(|refused| refused.why.contains("parent")));
    // By keyboard, between places.
    let told = follow(&mut model, &Request::Bone { from: [16.0, 16.0, 9.0], to: [16.0, 16.0, 2.0] });
    assert!(told.bones.len() == 3 && !told.bones[2].carried);
}
