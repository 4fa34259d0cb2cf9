//! A session is what the stages give that are called once, whatever the way; it undoes and replays to the bit.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use ivd_core::{Exec, Volume, VoxelIndex, Voxels, World};
use ivd_field::clip::{Cuboid, HalfSpace};
use ivd_field::lies::Lies;
use ivd_field::shape::{Kind, Shape};
use ivd_field::warp::{Order, WarpParams};
use ivd_map::space::{ChainMail, Cut, Links, Step};
use ivd_map::{Band, BiharmonicParams, OctreeParams, Outside};
use ivd_motion::deform::Bone;
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::mass_spring::{self, Material, Solver};
use ivd_motion::rigid::RigidTransform;
use ivd_motion::ring::RingParams;
use ivd_session::{ClipPart, ClipRule, Entry, Event, MapChoice, Physics, Session, Settings, numbered};

use crate::common::{assert_as_at_once, ball, choice, mapped, pick, session, top};

#[test]
fn a_drag_is_what_the_stages_give_and_names_the_bricks_that_change() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    let springs = |solver| {
        let params = mass_spring::Params { solver, ..mass_spring::Params::default() };
        Event::Physics(Physics::Springs(Box::new(params)))
    };
    let handle = Handle { at: pick([0.0, 0.0, 1.0]), action: Action::Move([0.0; 3]), radius: 9.0 };
    let map = |method, outside| Event::Map(choice(method, outside));
    let ways = [
        vec![Event::Add { id: None, handle }],
        vec![Event::Level(2)],
        vec![map("biharmonic", Outside::Band)],
        vec![springs(Solver::Projective)],
        vec![Event::Level(1), map("octree", Outside::Free)],
        vec![Event::Warp(WarpParams { order: Order::Cubic, background: Some(7.0) })],
        vec![springs(Solver::Dynamics), map("octree", Outside::Band)],
        // A needle, which is what springs make of one vertex, is too thin for its cells.
        vec![Event::Physics(Physics::default()), map("fem", Outside::Band)],
    ];
    let moves = [[0.3, 0.0, 0.6], [0.5, 0.2, 1.4], [0.0, 0.1, -1.0], [0.0; 3], [0.2, -0.2, 1.1]];
    for (w, way) in ways.into_iter().enumerate() {
        for event in way {
            session.apply(event, &exec).unwrap();
        }
        // Every way, and every move in one of them.
        for (_, by) in moves.into_iter().enumerate().filter(|(m, _)| m % every() == w % every()) {
            let before = session.deformed().clone();
            let update = session.apply(Event::Move { handle: 0, by }, &exec).unwrap();
            assert_as_at_once(&session, &exec);
            let grid = before.grid().clone();
            let bricks = grid.dims().map(|n| n.div_ceil(8));
            for i in
                (0..grid.len()).filter(|i| before.voxels().get(*i) != session.deformed().voxels().get(*i))
            {
                let VoxelIndex([x, y, z]) = grid.index(i);
                let brick = x / 8 + bricks[0] * (y / 8 + bricks[1] * (z / 8));
                assert!(update.dirty.binary_search(&brick).is_ok(), "voxel {x} {y} {z} changed unsaid");
            }
            assert!(
                update.dirty.len() < bricks.iter().product::<usize>() / 2,
                "{} bricks",
                update.dirty.len()
            );
        }
    }
}

/// One case of so many is tried; all where `IVD_STRESS_EVERY` is 1.
fn every() -> usize {
    std::env::var("IVD_STRESS_EVERY")
        .map_or(5, |text| text.parse().unwrap_or_else(|_| panic!("IVD_STRESS_EVERY={text} is no number")))
}

/// Numbers that look random.
struct Draw {
    seed: u64,
    /// By list, the numbers that there are: handles, fixes, shapes, bones, steps in space, clips.
    ids: [Vec<u32>; 6],
}

impl Draw {
    fn below(&mut self, n: usize) -> usize {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.seed >> 33) as usize) % n
    }

    fn unit(&mut self) -> f64 {
        self.below(1 << 20) as f64 / f64::from(1 << 20)
    }

    fn vector(&mut self, most: f64) -> [f64; 3] {
        [0; 3].map(|_| most * (2.0 * self.unit() - 1.0))
    }

    fn place(&mut self) -> Anchor {
        let direction = self.vector(1.0);
        pick([direction[0], direction[1], direction[2] + 0.01])
    }

    /// Any event, some of them bad.
    fn event(&mut self) -> Event {
        // One that is there, or may be.
        let id = |draw: &mut Self, list: usize| {
            let count = draw.ids[list].len();
            let at = draw.below(count + 1);
            draw.ids[list].get(at).copied().unwrap_or(2)
        };
        match self.below(35) {
            0 => Event::Add {
                id: None,
                handle: Handle {
                    at: self.place(),
                    action: Action::Move(self.vector(1.0)),
                    radius: 4.0 + 6.0 * self.unit(),
                },
            },
            1 => Event::Remove { handle: id(self, 0) },
            2 => Event::Pull { handle: id(self, 0), with: self.vector(30.0) },
            3 => Event::Place { handle: id(self, 0), at: self.place() },
            4 => Event::Radius { handle: id(self, 0), radius: 10.0 * self.unit() - 0.5 },
            5 => Event::Pin { id: None, pin: Pin { at: self.place(), radius: 2.0 * self.unit() } },
            6 => Event::Release { fix: id(self, 1) },
            7 => Event::Shape {
                id: None,
                shape: Shape {
                    kind: Kind::Twist { rate: 2.0 * self.unit(), length: None },
                    centre: [19.3, 19.6, 24.2],
                    axis: [0.0, 0.3, 1.0],
                    radius: 10.0,
                    core: 0.3,
                },
            },
            8 => Event::Unshape { shape: id(self, 2) },
            9 => Event::Physics(self.physics()),
            10 => Event::Stiffness { newton_per_metre: 1.0 + 200.0 * self.unit() },
            11 => Event::Material {
                class: 1 + self.below(2) as u16,
                material: Material { stiffness: Some(1.0 + 99.0 * self.unit()), ..Material::default() },
            },
            12 => {
                let method = ["octree", "biharmonic"][self.below(2)];
                let outside = [Outside::Band, Outside::Band, Outside::Free][self.below(3)];
                Event::Map(choice(method, outside))
            }
            13 => Event::Warp(WarpParams {
                order: [Order::Nearest, Order::Linear, Order::Cubic][self.below(3)],
                background: [None, Some(0.0)][self.below(2)],
            }),
            14 => Event::Level([0, 1, 2, 2, 3, 17][self.below(6)]),
            15 if self.below(4) == 0 => Event::Reset,
            17 | 28 => Event::Bone { id: None, bone: Box::new(self.bone()) },
            18 | 29 | 30 => Event::Turn { bone: id(self, 3), to: self.turn() },
            34 => Event::SetBone {
                bone: id(self, 3),
                radius: 2.0 + 3.0 * self.unit(),
                reach: 4.0 * self.unit(),
            },
            19 => Event::RemoveBone { bone: id(self, 3) },
            20 => Event::Space { id: None, step: self.step() },
            21 | 31 => Event::SetSpace { space: id(self, 4), step: self.step() },
            22 | 33 => Event::RemoveSpace { space: id(self, 4) },
            23 => Event::Clip { id: None, part: self.part() },
            24 | 32 => Event::MoveClip { clip: id(self, 5), part: self.part() },
            25 => Event::Unclip { clip: id(self, 5) },
            26 => Event::ClipRule(ClipRule {
                invert: self.below(2) == 0,
                background: [None, Some(9.0)][self.below(2)],
                space: [None, Some(Lies::Rest), Some(Lies::Deformed)][self.below(3)],
            }),
            // Rings have no bones.
            27 => Event::Physics(springs([Solver::Projective, Solver::Dynamics][self.below(2)])),
            _ => Event::Move { handle: id(self, 0), by: self.vector(1.5) },
        }
    }

    /// A cap of the ball, or what of it is of a class.
    fn bone(&mut self) -> Bone {
        let Anchor::NearestTo(centre) = self.place() else { panic!("a place") };
        let class = [None, None, Some(1)][self.below(3)];
        let bone = Bone { centre: Some(centre), radius: Some(4.0), class, reach: 5.0, ..Bone::default() };
        Bone { by: Some(self.vector(0.6)), ..bone }
    }

    fn turn(&mut self) -> RigidTransform {
        let (pivot, axis) = ([19.3, 19.6, 24.2], [0.3, 0.2, 1.0]);
        RigidTransform { pivot, axis, angle: 5.0 * self.unit(), by: self.vector(0.4) }
    }

    fn step(&mut self) -> Step {
        let centre = self.vector(6.0);
        let centre = [19.3 + centre[0], 19.6 + centre[1], 24.2 + centre[2]];
        let kind = Kind::Translate { by: self.vector(1.5) };
        match self.below(5) {
            0 => Step::Shape(Shape { kind, centre, axis: [0.0, 0.0, 1.0], radius: 8.0, core: 0.3 }),
            1 => {
                let by = self.vector(2.0);
                let material = [(2, Links { shear: 0.4, ..Links::default() }.into())];
                let material = material.into_iter().filter(|_| self.below(2) == 0).collect();
                Step::Chain(ChainMail { centre, grip: 2.0, by, links: Links::default(), material })
            }
            _ => {
                let normal = self.vector(1.0);
                let open = 2.0 * self.unit();
                Step::Cut(Cut { centre, normal, radius: 9.0, core: 0.4, open })
            }
        }
    }

    fn part(&mut self) -> ClipPart {
        let off = self.vector(6.0);
        let point = [19.3 + off[0], 19.6 + off[1], 24.2 + off[2]];
        if self.below(3) == 0 {
            return ClipPart::Box(Cuboid { min: point.map(|c| c - 9.0), max: point.map(|c| c + 14.0) });
        }
        ClipPart::Plane(HalfSpace { point, normal: self.vector(1.0) })
    }

    fn physics(&mut self) -> Physics {
        match self.below(4) {
            0 => springs(Solver::Projective),
            1 => springs(Solver::Dynamics),
            _ => Physics::Ring(RingParams::default()),
        }
    }
}

/// Masses on springs that balance soon.
fn springs(solver: Solver) -> Physics {
    let params = mass_spring::Params {
        solver,
        springs: mass_spring::Springs { ground: 0.01, ..mass_spring::Springs::default() },
        closeness: mass_spring::Closeness { tolerance: 1e-2, ..mass_spring::Closeness::default() },
        ..mass_spring::Params::default()
    };
    Physics::Springs(Box::new(params))
}

#[test]
fn random_events_replay_to_the_bit_and_are_undone_to_the_first() {
    let (exec, count) = (Exec::default(), 800 / every());
    let first = Settings { level: 2, ..Settings::default() };
    let mut live = session(first.clone(), &exec);
    let start = live.deformed().clone();
    let mut draw = Draw { seed: 2, ids: [const { Vec::new() }; 6] };
    let entries = Arc::new(Mutex::new(Vec::new()));
    let log = entries.clone();
    live.record(move |entry| log.lock().unwrap().push(serde_json::to_string(entry).unwrap()));
    let (mut refused, mut kinds, mut tried) = (0, BTreeMap::new(), 0);
    while live.events().count() < count {
        let event = draw.event();
        let name = serde_json::to_value(&event).unwrap();
        let name = name
            .as_str()
            .map_or_else(|| name.as_object().unwrap().keys().next().unwrap().clone(), String::from);
        let (settings, displacement) = (live.settings().clone(), live.displacement().clone());
        tried += 1;
        assert!(tried < 9000, "most events are refused");
        if live.apply(event, &exec).is_ok() {
            *kinds.entry(name).or_insert(0) += 1;
            let now = live.settings();
            draw.ids = [
                now.handles.iter().map(|one| one.id).collect(),
                now.fixed.iter().map(|one| one.id).collect(),
                now.shapes.iter().map(|one| one.id).collect(),
                now.bones.iter().map(|one| one.id).collect(),
                now.space.iter().map(|one| one.id).collect(),
                now.clip.parts.iter().map(|one| one.id).collect(),
            ];
        } else {
            refused += 1;
            assert!(
                live.settings() == &settings && live.displacement() == &displacement,
                "a refusal changes nothing"
            );
        }
        if live.events().count().is_multiple_of(50) {
            assert_as_at_once(&live, &exec);
        }
        // Many handles and shapes soon fold anything, and many clips leave nothing.
        let Settings { handles, shapes, bones, space, clip, .. } = live.settings();
        let (many, clips) =
            (handles.len() + shapes.len() + bones.len() + space.len() > 4, clip.parts.clone());
        if many {
            live.apply(Event::Reset, &exec).unwrap();
        }
        for part in clips.iter().filter(|_| clips.len() > 2) {
            live.apply(Event::Unclip { clip: part.id }, &exec).unwrap();
        }
    }
    assert_eq!(kinds.len(), 28, "{kinds:?}");
    assert!(refused > count / 20, "{refused}");
    let end = (live.deformed().clone(), live.displacement().clone(), live.settings().clone());

    // Three that have nothing to do with one another.
    std::thread::scope(|scope| {
        let log = serde_json::to_string(&live.events().collect::<Vec<_>>()).unwrap();
        // Before it goes on with what is undone.
        let lines = entries.lock().unwrap().clone();
        let (first, end, exec) = (&first, &end, &exec);
        scope.spawn(move || {
            let events: Vec<Event> = serde_json::from_str(&log).unwrap();
            let one = Exec::default().with_threads(1);
            let mut again = session(first.clone(), &one);
            for event in events {
                again.apply(event, &one).unwrap();
            }
            assert!((again.deformed(), again.displacement(), again.settings()) == (&end.0, &end.1, &end.2));
        });
        // So does the log, read line by line.
        scope.spawn(move || {
            let mut replayed = session(first.clone(), exec);
            for line in &lines {
                replayed.replay(serde_json::from_str::<Entry>(line).unwrap(), exec).unwrap();
            }
            assert!((replayed.deformed(), replayed.settings()) == (&end.0, &end.2));
        });
        for _ in 0..80 {
            live.undo(exec).unwrap().unwrap();
        }
        let vertices = live.lattice().keys().len();
        live.forget();
        assert_eq!(live.lattice().keys().len(), vertices, "the present level stays");
        for _ in 0..30 {
            live.redo(exec).unwrap().unwrap();
        }
        for _ in 0..50 {
            live.redo(exec).unwrap().unwrap();
        }
        assert!(live.redo(exec).unwrap().is_none());
        assert!((live.deformed(), live.displacement(), live.settings()) == (&end.0, &end.1, &end.2));
        while live.undo(exec).unwrap().is_some() {}
        assert_eq!((live.deformed(), live.settings()), (&start, first));
    });
}

#[test]
fn nothing_skipped_gives_the_same() {
    let mut plain = Exec::default();
    plain.skip = false;
    let exec = Exec::default();
    let (mut quick, mut slow) = (session(Settings::default(), &exec), session(Settings::default(), &plain));
    let handle = Handle { at: pick([1.0, 0.2, 0.1]), action: Action::Move([1.0, 0.0, 0.4]), radius: 8.0 };
    for event in [
        Event::Level(1),
        Event::Add { id: None, handle },
        Event::Move { handle: 0, by: [2.0, 0.0, 0.0] },
        Event::Map(MapChoice::Biharmonic(BiharmonicParams::default())),
        Event::Move { handle: 0, by: [-1.0, 0.5, 0.0] },
    ] {
        let (a, b) = (quick.apply(event.clone(), &exec).unwrap(), slow.apply(event, &plain).unwrap());
        assert_eq!((a.min_det_j, a.misfit, a.left_mm), (b.min_det_j, b.misfit, b.left_mm));
        assert!(quick.deformed() == slow.deformed() && quick.displacement() == slow.displacement());
    }
}

/// A motion that a hand may make must be one that a scene of it may have: a needle, which voxels can't follow, goes as far for both.
#[test]
fn a_drag_ends_where_the_stages_end() {
    let exec = Exec::default();
    let needle = mass_spring::Params {
        solver: Solver::Projective,
        springs: mass_spring::Springs { grip: Some(0.0), ..mass_spring::Springs::default() },
        ..mass_spring::Params::default()
    };
    let mut session = session(Settings { level: 2, ..Settings::default() }, &exec);
    session.apply(Event::Physics(Physics::Springs(Box::new(needle.clone()))), &exec).unwrap();
    session.apply(Event::Add { id: None, handle: top() }, &exec).unwrap();
    // Refused for many vertices that are left behind, and for a few.
    for (tolerance, why) in [(0.1, "it leaves the lattice behind"), (0.3, "a thousandth of the lattice")] {
        let band = Band { tolerance, ..Band::default() };
        let map = MapChoice::Octree(OctreeParams { band, ..OctreeParams::default() });
        session.apply(Event::Map(map), &exec).unwrap();
        let mut ends = [0, 0];
        for far in [0.2, 0.8, 1.6, 2.2, 3.0] {
            let by = [far, 0.0, -1.5 * far];
            let live = session.apply(Event::Move { handle: 0, by }, &exec);
            let handle = Handle { action: Action::Move(by), ..top() };
            let motion =
                mass_spring::solve(session.lattice(), None, &[handle], &[], &needle, &exec).unwrap().motion;
            let once = mapped(session.lattice(), &motion, &session.settings().map, &exec);
            match (&live, &once) {
                (Ok(_), Ok(once)) => assert!(session.displacement() == once, "{far} mm"),
                (Err(live), Err(once)) => {
                    let [live, once] = [live.to_string(), once.to_string()];
                    assert!(once.starts_with(&live), "{live}, {once}");
                    assert!(live.contains(why), "{live}");
                }
                _ => panic!("{far} mm: {:?}, {:?}", live.map(drop), once.map(drop)),
            }
            ends[usize::from(live.is_err())] += 1;
        }
        assert!(ends[0] > 0 && ends[1] > 0, "{tolerance}: {ends:?}");
    }
}

#[test]
fn bad_events_are_named() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    let mut refused = |event: Event| session.apply(event, &exec).unwrap_err().to_string();
    assert!(refused(Event::Move { handle: 2, by: [0.0; 3] }).contains("no handle 2, nor any other"));
    assert!(refused(Event::Level(40)).contains("level"));
    assert!(refused(Event::Material { class: 1, material: Material::default() }).contains("springs first"));
    let far = Handle { at: Anchor::NearestTo([500.0; 3]), action: Action::Move([1.0; 3]), radius: 5.0 };
    assert!(refused(Event::Add { id: None, handle: far }).contains("pick a place on the lattice"));
    let world: World = ball().1.world(0);
    let deep =
        Handle { at: Anchor::NearestTo(world.0.into()), action: Action::Move([0.0, 0.0, 60.0]), radius: 5.0 };
    refused(Event::Add { id: None, handle: deep });
    assert_eq!(session.events().count(), 0);
    let (volume, lattice) = ball();
    let other = ivd_core::Grid::with_spacing([8; 3], [1.0; 3]).unwrap();
    let small = Volume::new(other, Voxels::from(vec![0_u8; 512])).unwrap();
    assert!(
        Session::new(small, lattice, None, Settings::default(), &exec)
            .unwrap_err()
            .to_string()
            .contains("another grid")
    );
    drop(volume);
}

#[test]
fn a_gesture_is_one_step_and_leaves_nothing_when_it_is_abandoned() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    session.apply(Event::Add { id: None, handle: top() }, &exec).unwrap();
    let (settings, rest) = (session.settings().clone(), session.deformed().clone());
    let drag = |session: &mut Session| {
        session.begin("drag").unwrap();
        for way in 1..6 {
            session.apply(Event::Move { handle: 0, by: [0.0, 0.0, 0.3 * f64::from(way)] }, &exec).unwrap();
        }
    };
    drag(&mut session);
    assert!(session.undo(&exec).unwrap_err().to_string().contains("“drag” goes on"));
    assert!(session.begin("another").is_err() && session.in_gesture());
    session.abandon(&exec).unwrap();
    assert_eq!((session.settings(), session.deformed()), (&settings, &rest));
    assert!(session.abandon(&exec).is_err() && session.commit().is_err());

    drag(&mut session);
    let there = session.deformed().clone();
    assert!(session.commit().unwrap());
    let steps: Vec<(&str, usize)> = session.steps().map(|step| (&*step.name, step.events.len())).collect();
    assert_eq!(steps, [("add a handle", 1), ("drag", 1)], "of many moves the last counts");
    session.undo(&exec).unwrap().unwrap();
    assert_eq!(session.deformed(), &rest);
    assert_eq!(session.undone().unwrap().name, "drag");
    // What is abandoned doesn't take away what could be done again; neither does what changes nothing.
    session.begin("nothing").unwrap();
    assert!(!session.commit().unwrap());
    drag(&mut session);
    session.abandon(&exec).unwrap();
    session.redo(&exec).unwrap().unwrap();
    assert_eq!(session.deformed(), &there);
}

#[test]
fn numbers_stay_and_never_come_again() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    let add = |at| Event::Add { id: None, handle: Handle { at: pick(at), ..top() } };
    for at in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        session.apply(add(at), &exec).unwrap();
    }
    let ids = |session: &Session| session.settings().handles.iter().map(|one| one.id).collect::<Vec<_>>();
    session.apply(Event::Remove { handle: 1 }, &exec).unwrap();
    session.apply(Event::Move { handle: 2, by: [0.0, 0.5, 0.0] }, &exec).unwrap();
    assert_eq!(ids(&session), [0, 2]);
    session.undo(&exec).unwrap();
    session.undo(&exec).unwrap();
    session.undo(&exec).unwrap();
    session.apply(add([0.0, -1.0, 0.0]), &exec).unwrap();
    assert_eq!(ids(&session), [0, 1, 3]);
    let twice = session.apply(Event::Add { id: Some(3), handle: top() }, &exec).unwrap_err().to_string();
    assert!(twice.contains("number 3 was given"), "{twice}");
    assert!(session.apply(Event::Remove { handle: 2 }, &exec).unwrap_err().to_string().contains("0, 1, 3"));
}

#[test]
fn a_vertex_stays_the_place_that_it_was_when_the_level_changes() {
    let exec = Exec::default();
    let at = Anchor::Vertex(40);
    let handles = numbered([Handle { at, ..top() }]);
    let mut session = session(Settings { handles, ..Settings::default() }, &exec);
    let place = session.lattice().world(40).0;
    session.apply(Event::Level(2), &exec).unwrap();
    assert_eq!(session.settings().handles[0].at, Anchor::NearestTo(place.into()));
    session.make_level(1, &exec).unwrap();
    let update = session.apply(Event::Move { handle: 0, by: [0.5, 0.0, 0.0] }, &exec).unwrap();
    // The vertex lies between voxels, none of which goes further.
    assert!((0.4..0.5 + 1e-6).contains(&update.largest_mm), "{}", update.largest_mm);
}

#[test]
fn the_ranges_of_bricks_follow_what_changes() {
    let exec = Exec::default();
    let mut session = session(Settings::default(), &exec);
    session.deformed().bricks();
    session.apply(Event::Add { id: None, handle: top() }, &exec).unwrap();
    for by in [[0.0, 0.0, 2.0], [0.0, 1.0, -1.0], [0.0; 3]] {
        session.apply(Event::Move { handle: 0, by }, &exec).unwrap();
        let deformed = session.deformed();
        let anew = Volume::new(deformed.grid().clone(), deformed.voxels().clone()).unwrap();
        assert_eq!(deformed.bricks(), anew.bricks());
    }
}

#[test]
fn of_many_levels_some_are_kept_and_none_is_another() {
    let exec = Exec::default();
    let mut session = session(Settings { handles: numbered([top()]), ..Settings::default() }, &exec);
    for level in (0..16).chain([3, 15, 0]) {
        session.apply(Event::Level(level), &exec).unwrap();
        session.apply(Event::Move { handle: 0, by: [0.0, f64::from(level) / 20.0, 0.5] }, &exec).unwrap();
        let made: Vec<u8> = session.made_levels().collect();
        assert!(made.len() <= 8 && made.contains(&level), "{made:?}");
        assert_as_at_once(&session, &exec);
    }
}
