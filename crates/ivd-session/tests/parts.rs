//! Bones, steps in space, clips and labels: parts of the state as handles are.

use ivd_core::{Exec, VoxelIndex};
use ivd_field::clip::{self, By, Cuboid, HalfSpace};
use ivd_field::lies::Lies;
use ivd_field::shape::{Kind, Shape};
use ivd_field::warp::{self, WarpParams};
use ivd_map::Outside;
use ivd_map::space::{ChainMail, Cut, Links, Step};
use ivd_motion::deform::Bone;
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::mass_spring::{self, Solver};
use ivd_motion::rigid::RigidTransform;
use ivd_session::{Clip, ClipPart, ClipRule, Event, Physics, Session, Settings, numbered};

use crate::common::{assert_as_at_once, ball, choice, labels, pick, session, top};

/// The middle of the ball.
const MIDDLE: [f64; 3] = [19.3, 19.6, 24.2];

/// A cut through the top of the ball.
fn cut(open: f64, tilt: f64) -> Step {
    let centre = [MIDDLE[0] + 1.3, MIDDLE[1], MIDDLE[2] + 8.0];
    Step::Cut(Cut { centre, normal: [1.0, tilt, 0.2], radius: 8.0, core: 0.4, open })
}

fn push(by: [f64; 3]) -> Step {
    let kind = Kind::Translate { by };
    let centre = [MIDDLE[0] - 6.0, MIDDLE[1], MIDDLE[2]];
    Step::Shape(Shape { kind, centre, axis: [0.0, 0.0, 1.0], radius: 8.0, core: 0.3 })
}

fn plane(off: f64) -> ClipPart {
    let point = [MIDDLE[0], MIDDLE[1] + off, MIDDLE[2]];
    ClipPart::Plane(HalfSpace { point, normal: [0.1, -1.0, 0.2] })
}

fn springs() -> Event {
    let params = mass_spring::Params { solver: Solver::Projective, ..mass_spring::Params::default() };
    Event::Physics(Physics::Springs(Box::new(params)))
}

/// A cap of the ball, which stays for now.
fn cap(direction: [f64; 3]) -> Bone {
    let Anchor::NearestTo(centre) = pick(direction) else { panic!("a place") };
    Bone { centre: Some(centre), radius: Some(4.0), reach: 6.0, ..Bone::default() }
}

fn bone(bone: Bone) -> Event {
    Event::Bone { id: None, bone: Box::new(bone) }
}

fn turn(angle: f64, by: [f64; 3]) -> RigidTransform {
    RigidTransform { pivot: MIDDLE, axis: [0.2, 1.0, 0.0], angle, by }
}

fn lift(up: f64) -> Event {
    Event::Move { handle: 0, by: [0.2, 0.0, up] }
}

/// Events of every new kind with moves between them.
fn series() -> Vec<Event> {
    let rule = |invert, space| Event::ClipRule(ClipRule { invert, background: None, space });
    let boxed =
        |by: f64| ClipPart::Box(Cuboid { min: MIDDLE.map(|c| c - 9.0 + by), max: MIDDLE.map(|c| c + 11.0) });
    vec![
        Event::Level(1),
        Event::Space { id: None, step: cut(1.5, 0.3) },
        Event::SetSpace { space: 0, step: cut(2.5, 0.3) },
        Event::SetSpace { space: 0, step: cut(2.5, -0.1) },
        Event::Add { id: None, handle: top() },
        lift(1.0),
        Event::Clip { id: None, part: plane(2.0) },
        lift(0.5),
        Event::MoveClip { clip: 0, part: plane(-1.0) },
        rule(false, Some(Lies::Rest)),
        lift(1.2),
        Event::Clip { id: None, part: boxed(0.0) },
        Event::MoveClip { clip: 1, part: boxed(2.0) },
        rule(true, Some(Lies::Rest)),
        lift(0.7),
        Event::Warp(WarpParams { background: Some(3.0), ..WarpParams::default() }),
        Event::Unclip { clip: 0 },
        Event::Space { id: None, step: push([0.0, 1.2, 0.0]) },
        lift(0.9),
        Event::RemoveSpace { space: 0 },
        rule(true, None),
        springs(),
        bone(cap([1.0, 0.0, 0.0])),
        Event::Turn { bone: 0, to: turn(4.0, [0.5, 0.0, 0.0]) },
        lift(0.6),
        Event::Turn { bone: 0, to: turn(-3.0, [0.0; 3]) },
        bone(Bone { class: Some(1), fit: true, ..cap([0.0, 0.0, 1.0]) }),
        Event::Unclip { clip: 1 },
        Event::RemoveBone { bone: 0 },
        Event::RemoveSpace { space: 1 },
        Event::RemoveBone { bone: 1 },
        Event::Remove { handle: 0 },
    ]
}

/// A handle on either side of the second bone's cap, which fits it.
fn gripped() -> [Event; 2] {
    [[-0.2, 0.0, 1.0], [0.2, 0.2, 1.0]].map(|at| {
        let action = Action::Move([0.0, 0.2, 0.5]);
        Event::Add { id: None, handle: Handle { at: pick(at), action, ..top() } }
    })
}

fn brick_of(session: &Session, i: usize) -> usize {
    let grid = session.rest().grid();
    let (at, bricks) = (grid.index(i).0.map(|c| c / 8), grid.dims().map(|n| n.div_ceil(8)));
    at[0] + bricks[0] * (at[1] + bricks[1] * at[2])
}

#[test]
fn parts_come_and_go_as_the_stages_have_them_and_are_undone_to_the_bit() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    let bricks = session.deformed().grid().dims().iter().map(|n| n.div_ceil(8)).product::<usize>();
    let (mut states, mut fewest) = (Vec::new(), bricks);
    let mut all = series();
    // The bone that is fitted needs its handles before it, the one at the top gone.
    let fitted = all.iter().position(|event| matches!(event, Event::Bone { bone, .. } if bone.fit)).unwrap();
    all.splice(fitted..fitted, [vec![Event::Remove { handle: 0 }], gripped().to_vec()].concat());
    all.insert(fitted + 4, Event::Move { handle: 1, by: [0.0, -0.2, 0.8] });
    let last = all.len() - 1;
    all[last] = Event::Remove { handle: 1 };
    for (n, event) in all.into_iter().enumerate() {
        let before = session.deformed().clone();
        states.push((session.settings().clone(), before.clone(), session.displacement().clone()));
        let update = match session.apply(event.clone(), &exec) {
            Ok(update) => update,
            Err(error) => panic!("{n}, {event:?}: {error}"),
        };
        assert_as_at_once(&session, &exec);
        let now = session.deformed();
        for i in (0..before.grid().len()).filter(|&i| before.voxels().get(i) != now.voxels().get(i)) {
            let brick = brick_of(&session, i);
            assert!(update.dirty.binary_search(&brick).is_ok(), "{n}: voxel {i} changed unsaid");
        }
        if now != &before {
            fewest = fewest.min(update.dirty.len());
        }
    }
    assert!(fewest < bricks / 4, "{fewest} of {bricks} bricks");
    let end = session.deformed().clone();
    let steps = states.len();
    for (settings, deformed, displacement) in states.iter().rev() {
        session.undo(&exec).unwrap().unwrap();
        let now = (session.settings(), session.deformed(), session.displacement());
        assert!(now == (settings, deformed, displacement));
    }
    for _ in 0..steps {
        session.redo(&exec).unwrap().unwrap();
    }
    assert!(session.deformed() == &end);
}

#[test]
fn settings_and_events_are_read_back_from_json_as_they_were() {
    let chain = |material: &[(u16, ivd_map::space::ClassLinks)]| {
        let material = material.iter().copied().collect();
        Step::Chain(ChainMail {
            centre: MIDDLE,
            grip: 2.0,
            by: [0.0, 0.0, 1.5],
            links: Links::default(),
            material,
        })
    };
    let links = ivd_map::space::ClassLinks { shear: Some(0.4), ..Default::default() };
    let space = numbered([chain(&[(2, links)]), chain(&[]), cut(1.0, 0.0), push([0.3, 0.0, 0.0])]);
    let parts = numbered([plane(1.0), ClipPart::Box(Cuboid { min: [0.0; 3], max: [9.5; 3] })]);
    let rule = ClipRule { invert: true, background: Some(4.0), space: Some(Lies::Rest) };
    let clip = Clip { parts, rule };
    let bones =
        numbered([cap([0.0, 1.0, 0.0]), Bone { fit: true, name: Some("C5".into()), ..cap([1.0, 0.0, 0.0]) }]);
    let settings = Settings { space, clip, bones, ..Settings::default() };
    let text = serde_json::to_string(&settings).unwrap();
    assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings, "{text}");
    for event in series() {
        let text = serde_json::to_string(&event).unwrap();
        assert_eq!(serde_json::from_str::<Event>(&text).unwrap(), event, "{text}");
    }
}

#[test]
fn what_does_not_go_together_is_refused_by_name_and_changes_nothing() {
    let exec = Exec::default();
    let mut session = session(Settings { level: 1, ..Settings::default() }, &exec);
    let refused = |session: &mut Session, event: Event, words: &str| {
        let before = (session.settings().clone(), session.deformed().clone());
        let error = session.apply(event, &exec).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert!((session.settings(), session.deformed()) == (&before.0, &before.1));
    };
    refused(&mut session, bone(cap([0.0, 0.0, 1.0])), "rings know no bones");
    let rule = ClipRule { invert: true, ..ClipRule::default() };
    refused(&mut session, Event::ClipRule(rule), "nothing to clip by");
    refused(&mut session, Event::RemoveSpace { space: 3 }, "no step in space 3, nor any other");
    session.apply(Event::Space { id: None, step: cut(1.0, 0.0) }, &exec).unwrap();
    refused(&mut session, Event::Space { id: None, step: cut(0.5, 1.0) }, "second");
    session.apply(Event::Add { id: None, handle: top() }, &exec).unwrap();
    refused(&mut session, Event::Map(choice("octree", Outside::Free)), "gap");
    let links = ivd_map::space::ClassLinks { shear: Some(0.4), ..Default::default() };
    let material = [(2, links)].into_iter().collect();
    let chain = ChainMail { centre: MIDDLE, grip: 2.0, by: [1.0; 3], links: Links::default(), material };
    refused(
        &mut session,
        Event::Space { id: None, step: Step::Chain(chain) },
        "labels are of the volume at rest",
    );
    session.apply(springs(), &exec).unwrap();
    session.apply(bone(cap([1.0, 0.0, 0.0])), &exec).unwrap();
    refused(&mut session, Event::Physics(Physics::default()), "rings know no bones");
    let two = bone(Bone { name: Some("0".into()), ..cap([0.0, 1.0, 0.0]) });
    refused(&mut session, two, "two bones are called 0");
    session.apply(Event::Reset, &exec).unwrap();
    assert!(session.displacement().is_identity() && session.settings().space.is_empty());
}

#[test]
fn a_bone_keeps_its_name_when_another_goes() {
    let exec = Exec::default();
    let pivot = Some(MIDDLE);
    let carried = Bone { parent: Some("1".into()), pivot, angle: Some(2.0), ..cap([0.0, 1.0, 0.0]) };
    let bones = numbered([cap([-1.0, 0.0, 0.0]), cap([1.0, 0.0, 0.0]), carried]);
    let params = mass_spring::Params { solver: Solver::Projective, ..mass_spring::Params::default() };
    let physics = Physics::Springs(Box::new(params));
    let mut session = session(Settings { level: 1, bones, physics, ..Settings::default() }, &exec);
    session.apply(Event::RemoveBone { bone: 0 }, &exec).unwrap();
    session.apply(Event::Turn { bone: 1, to: turn(3.0, [0.0; 3]) }, &exec).unwrap();
    assert_as_at_once(&session, &exec);
    let error = session.apply(Event::RemoveBone { bone: 1 }, &exec).unwrap_err().to_string();
    assert!(error.contains('1'), "its child still needs it: {error}");
    session.apply(bone(cap([0.0, 0.0, 1.0])), &exec).unwrap();
    let named: Vec<_> = session.settings().bones.iter().map(|bone| (bone.id, bone.name.clone())).collect();
    assert_eq!(named, [(1, Some("1".into())), (2, Some("2".into())), (3, Some("3".into()))]);
}

#[test]
fn labels_go_along_once_they_are_asked_for() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    let (rest, mut clipped) = (labels(&ball().0), 0);
    for (n, event) in series().into_iter().take(21).enumerate() {
        session.apply(event, &exec).unwrap();
        // Not after every event: what is behind is made good.
        if n % 3 == 1 || n > 15 {
            let whole = warp::labels(&rest, session.displacement(), &WarpParams::default(), &exec).unwrap();
            let followed = session.deformed_labels(&exec).unwrap().unwrap();
            assert!(followed == &whole.output, "after event {n}");
            assert!(n > 1 || followed != &rest);
            session.follow_labels(&exec).unwrap();
            let clip = &session.settings().clip;
            let at_rest = clip.rule.space == Some(Lies::Rest);
            let by = By { tag: None, displacement: at_rest.then(|| session.displacement()) };
            let kept = clip.params().map(|params| clip::labels(&whole.output, &params, &by, &exec).unwrap());
            clipped += usize::from(kept.is_some());
            let expected = kept.map_or(whole.output, |kept| kept.output);
            assert!(session.shown_labels() == Some(&expected), "after event {n}");
        }
    }
    assert!(clipped > 3, "{clipped}");
    // What stands in for values that are thrown away is no label.
    let shown = session.shown_labels().cloned();
    let rule = ClipRule { background: Some(-5.5), ..session.settings().clip.rule };
    session.apply(Event::ClipRule(rule), &exec).unwrap();
    session.follow_labels(&exec).unwrap();
    assert!(session.shown_labels() == shown.as_ref());
    while session.undo(&exec).unwrap().is_some() {}
    assert!(session.deformed_labels(&exec).unwrap() == Some(&rest));
    let (volume, lattice) = ball();
    let mut bare = Session::new(volume, lattice, None, Settings::default(), &exec).unwrap();
    assert!(bare.deformed_labels(&exec).unwrap().is_none());
}

#[test]
fn places_beside_a_cut_come_from_where_they_are_seen() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    // Wide open, what is seen lies beside a gap; hardly open, beside the other side.
    for (n, open) in [4.0, 0.9].into_iter().enumerate() {
        let step = cut(open, 0.0);
        let Step::Cut(Cut { centre, normal, .. }) = step.clone() else { panic!("a cut") };
        let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
        let height =
            |place: [f64; 3]| (0..3).map(|a| (place[a] - centre[a]) * normal[a] / length).sum::<f64>();
        let event = if n == 0 { Event::Space { id: None, step } } else { Event::SetSpace { space: 0, step } };
        session.apply(event, &exec).unwrap();
        let (displacement, mut seen) = (session.displacement(), [0; 2]);
        let grid = session.rest().grid();
        for i in (0..grid.len()).filter(|&i| displacement.sides()[i] >> 2 != 0) {
            let side = displacement.sides()[i] >> 2;
            let at = grid.index(i);
            for way in [1_i64, -1] {
                let mut next = at.0;
                next[0] = next[0].saturating_add_signed(way as isize);
                let next = grid.linear(VoxelIndex(next));
                let other = displacement.sides().get(next).is_some_and(|flags| flags >> 2 == 3 - side);
                if !other && displacement.vacated().get(next) != Some(&1) {
                    continue;
                }
                // Towards the lip, as a picture has it.
                let voxel = grid.world(ivd_core::VoxelCoord::from(at)).0;
                let mut now = voxel;
                now.x += 0.4 * way as f64;
                let rest = session.rest_of(now.into());
                // In the gap the side goes on by as much as that is off the lip, and no further.
                let own = if side == 2 { height(rest) } else { -height(rest) };
                assert!(own > -0.5, "{now} of side {side} comes from {own} mm on it");
                let inverse = displacement.inverse().at(at);
                let off =
                    (0..3).map(|a| rest[a] - (now[a] + f64::from(inverse[a]))).map(|c| c * c).sum::<f64>();
                assert!(off.sqrt() < 0.15, "{now} comes from {} mm beside its neighbour's side", off.sqrt());
                if own > 0.9 {
                    let there = session.moved(rest);
                    let off = (0..3).map(|a| (there[a] - now[a]).powi(2)).sum::<f64>().sqrt();
                    assert!(off < 0.02, "{there:?} {now}");
                }
                seen[usize::from(side) - 1] += 1;
            }
        }
        assert!(seen.iter().all(|seen| *seen > 30), "{open}: {seen:?}");
    }
}

#[test]
fn a_gesture_is_done_again_whose_way_there_is_not_possible_without_what_was_let_go() {
    let exec = Exec::default();
    let start = || {
        let mut session = session(Settings::default(), &exec);
        for step in [cut(1.5, 0.3), push([0.0, 1.2, 0.0])] {
            session.apply(Event::Space { id: None, step }, &exec).unwrap();
        }
        session
    };
    let mut session = start();
    let (lines, begun) = (std::sync::Arc::new(std::sync::Mutex::new(Vec::new())), session.deformed().clone());
    let kept = lines.clone();
    session.record(move |entry| kept.lock().unwrap().push(entry.clone()));
    session.begin("exchange").unwrap();
    // The cut and the push change places; of the two that set the first step the last is kept, behind what it allowed.
    for (space, step) in [(0, push([0.0, 0.9, 0.0])), (1, cut(1.0, 0.0)), (0, push([0.3, 0.9, 0.0]))] {
        session.apply(Event::SetSpace { space, step }, &exec).unwrap();
    }
    assert!(session.commit().unwrap());
    let done = session.deformed().clone();
    let undone = session.undo(&exec).unwrap().unwrap();
    assert!(!undone.dirty.is_empty() && session.deformed() == &begun);
    let redone = session.redo(&exec).unwrap().unwrap();
    assert_eq!((redone.dirty, session.deformed() == &done), (undone.dirty, true));
    let mut again = start();
    let first = lines.lock().unwrap()[0].clone();
    again.replay(first, &exec).unwrap();
    assert!(again.deformed() == &done && again.settings() == session.settings());
}

#[test]
fn what_is_refused_uses_up_no_number_and_none_is_given_twice() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    let handle = |id| Event::Add { id, handle: top() };
    session.apply(springs(), &exec).unwrap();
    let named = Bone { name: Some("1".to_owned()), ..cap([1.0, 0.0, 0.0]) };
    session.apply(bone(named), &exec).unwrap();
    // Without a name it would be called 1 as well, however often it is tried.
    for _ in 0..2 {
        assert!(session.apply(bone(cap([0.0, 0.0, 1.0])), &exec).is_err());
    }
    assert!(session.apply(handle(Some(u32::MAX)), &exec).is_err());
    session.apply(handle(None), &exec).unwrap();
    session.apply(Event::Remove { handle: 0 }, &exec).unwrap();
    assert!(session.apply(handle(Some(0)), &exec).is_err(), "it was another's");
    session.apply(handle(Some(5)), &exec).unwrap();
    session.apply(handle(None), &exec).unwrap();
    let ids: Vec<u32> = session.settings().handles.iter().map(|one| one.id).collect();
    assert_eq!(ids, [5, 6]);
}
