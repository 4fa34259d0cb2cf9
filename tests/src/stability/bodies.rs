//! Awkward masses on springs and free forms, for [`nasty`](super::nasty).

use ivd_core::{ErrorClass, Labels};
use ivd_field::shape::{Kind, Shape};
use ivd_motion::handles::{Action, Anchor, Pin};
use ivd_motion::mass_spring::{LoadRamp, Material, Params};
use ivd_motion::rigid::{BoneSpec, Drive, Region, RigidTransform};

use super::case::{Case, Refused, Stage, TURNS};
use super::inputs::{TOO_MUCH, ball, grip, nudged};

/// What a pull ends with that nothing holds against.
const NO_HOLD: [Refused; 1] = [(Stage::DeformBalance, ErrorClass::Usage)];

/// Springs, masses, time and solvers at their ends.
pub(super) fn springs() -> Vec<Case> {
    let of = |name: &str, change: fn(&mut Params)| {
        let case = nudged(&format!("springs, {name}"), ball(12)).may(&TOO_MUCH);
        case.with(|s| change(&mut s.springs))
    };
    let pulled = |name: &str, change: fn(&mut Params)| {
        of(name, change).with(|s| s.handles = vec![grip(3, Action::Force([20.0, -10.0, 6.0]), 6.0)])
    };
    let mut all = vec![
        of("none across edges", |p| (p.springs.shear, p.springs.flexion) = (0.0, 0.0)),
        of("a million times as stiff across edges", |p| (p.springs.shear, p.springs.flexion) = (1e6, 1e6)),
        of("1e12 times as stiff across flat edges", |p| (p.springs.shear, p.springs.flexion) = (1e6, 1e-6)),
        of("ground 1e6", |p| p.springs.ground = 1e6),
        of("ground 1e-9", |p| p.springs.ground = 1e-9),
        of("they push", |p| p.springs.push = Some(true)),
        of("they don't push", |p| p.springs.push = Some(false)),
        of("no strain allowed", |p| p.springs.strain_limit = Some(0.0)),
        of("strain of a thousand allowed", |p| p.springs.strain_limit = Some(1e3)),
        of("stiffness 1e-9", |p| p.springs.stiffness = 1e-9),
        of("stiffness 1e15", |p| p.springs.stiffness = 1e15),
        of("Young's modulus 1e-9", |p| p.springs.youngs_kpa = Some(1e-9)),
        of("Young's modulus 1e15, thickness 1e6", |p| {
            (p.springs.youngs_kpa, p.springs.thickness) = (Some(1e15), 1e6);
        }),
        of("density 1e-12", |p| p.springs.density = 1e-12),
        of("density 1e6", |p| p.springs.density = 1e6),
        of("vertices of 1e-12 g", |p| p.springs.vertex_mass = Some(1e-12)),
        of("vertices of 1e9 g", |p| p.springs.vertex_mass = Some(1e9)),
        of("no drag", |p| p.springs.drag = 0.0),
        of("drag 1e9", |p| p.springs.drag = 1e9),
        of("a grip of everything", |p| p.springs.grip = Some(1e100)),
        of("a grip of a few", |p| p.springs.grip = Some(3.0)),
        of("a grip by the radius", |p| p.springs.grip = None),
        of("a step of 1e-9 s", |p| (p.springs.duration, p.springs.dt) = (1e-7, Some(1e-9))),
        of("a step of 1e3 s", |p| (p.springs.duration, p.springs.dt) = (1e3, Some(1e3))),
        of("a step longer than the time", |p| p.springs.dt = Some(1e300)),
        of("at once", |p| p.springs.ramp = Some(0.0)),
        of("slower than the time", |p| p.springs.ramp = Some(1e3)),
        of("evenly, five frames", |p| (p.springs.course, p.springs.frames) = (LoadRamp::Linear, 5)),
        of("tolerance 1e-14", |p| p.closeness.tolerance = 1e-14),
        of("one iteration", |p| p.closeness.max_iterations = 1),
        of("nothing remembered", |p| p.descent.history = 0),
        of("a hundred steps remembered", |p| p.descent.history = 100),
        of("a push through everything", |p| p.springs.duration = 1e-9)
            .with(|s| s.handles = vec![grip(3, Action::Move([0.0, 0.0, 40.0]), 6.0)]),
        of("everything fixed", |_| ()).with(|s| s.fixed = vec![Pin { at: Anchor::Vertex(0), radius: 1e3 }]),
        of("the handle fixed", |_| ()).with(|s| s.fixed = vec![Pin { at: Anchor::Vertex(3), radius: 0.0 }]),
        pulled("a pull", |_| ()),
        pulled("a pull, tight", |p| (p.closeness.tolerance, p.closeness.max_iterations) = (1e-12, 2000)),
        pulled("a pull on what doesn't push", |p| p.springs.push = Some(false)),
        pulled("a pull against ground", |p| p.springs.ground = 1.0).with(|s| s.handles[0].radius = 1e3),
        pulled("a pull against nothing", |_| ()).with(|s| s.handles[0].radius = 1e3).must(&NO_HOLD),
        pulled("a pull at once, no drag", |p| (p.springs.ramp, p.springs.drag) = (Some(0.0), 0.0)),
    ];
    for (name, by) in [("1e-30", 1e-30), ("1e-9", 1e-9), ("1e9", 1e9)] {
        let case = of(&format!("a move of {name} mm"), |_| ());
        all.push(case.with(|s| s.handles = vec![grip(3, Action::Move([by, 0.0, -by]), 6.0)]));
    }
    all.extend([
        mixed(of("materials mixed 1e6", |_| ()), 1e-3, 1e3),
        mixed(of("materials mixed 1e6, stiff", |_| ()), 1e3, 1e9),
        mixed(of("materials mixed 1e18", |_| ()), 1e-9, 1e9),
        mixed(pulled("materials mixed 1e6, a pull", |_| ()), 1e-3, 1e3),
    ]);
    all
}

/// A case whose springs are of one stiffness (N/m) in one half of the volume, and of another in the other.
fn mixed(case: Case, soft: f64, stiff: f64) -> Case {
    let grid = case.volume.grid().clone();
    let ids: Vec<u16> = (0..grid.len()).map(|i| if grid.index(i).0[0] < 6 { 1 } else { 2 }).collect();
    let labels = Labels::new(grid, ids.into(), Vec::new()).expect("labels of the volume");
    let of = |stiffness| Material { stiffness: Some(stiffness), ..Material::default() };
    case.with(|s| {
        s.materials = Some(labels);
        s.springs.springs.material = [(1, of(soft)), (2, of(stiff))].into();
    })
}

/// Bones at their ends.
pub(super) fn bones() -> Vec<Case> {
    // The end of the ball that the handle is on, and the other.
    let end = |z: f64, radius: f64| Region::Ball { centre: [5.5, 5.5, z], radius };
    let bone = |region: Region, drive: Drive| BoneSpec {
        name: "one".to_owned(),
        parent: None,
        region: Some(region),
        class: None,
        drive,
        reach: 5.0,
    };
    let turn = |angle: f64, by: [f64; 3]| RigidTransform {
        pivot: [5.5, 5.5, 3.0],
        axis: [1.0, 0.2, 0.0],
        angle,
        by,
    };
    let (given, fitted) = (|turn: RigidTransform| Drive::Prescribed(turn), Drive::Fitted { pivot: None });
    let of = |name: &str, bones: Vec<BoneSpec>| {
        nudged(&format!("bone, {name}"), ball(12)).may(&TOO_MUCH).with(|s| s.bones = bones)
    };
    let low = end(2.0, 2.5);
    let mut all = vec![
        of("a handle on it", vec![bone(low, fitted)]),
        of(
            "a handle on it, turning about its end",
            vec![bone(low, Drive::Fitted { pivot: Some([5.5, 5.5, 5.0]) })],
        ),
        of("of everything", vec![bone(end(5.5, 1e3), fitted)]),
        of("of everything that is followed by nothing", vec![BoneSpec { reach: 0.0, ..bone(low, fitted) }]),
        of("a handle beside it", vec![bone(end(10.0, 2.5), given(turn(10.0, [0.0; 3])))]),
    ];
    let alone = [
        ("half a turn", turn(180.0, [0.0; 3])),
        ("half a turn away", turn(180.0, [0.0, 0.0, -1.0])),
        ("1e6 degrees", turn(1e6, [0.0; 3])),
        ("whole turns", turn(3600.0, [0.0; 3])),
        ("a way of 1e-30 mm", turn(0.0, [1e-30, 0.0, 0.0])),
        ("a way of 1e9 mm", turn(0.0, [0.0, 0.0, -1e9])),
        ("a turn about what is far", RigidTransform { pivot: [1e6, 0.0, 0.0], ..turn(1e-5, [0.0; 3]) }),
    ];
    let without = |case: Case| case.with(|s| s.handles.clear());
    all.extend(alone.map(|(name, turn)| without(of(name, vec![bone(low, given(turn))]))));
    let upper = BoneSpec { name: "other".to_owned(), ..bone(end(9.0, 2.5), given(turn(-30.0, [0.0; 3]))) };
    let carried = BoneSpec { parent: Some("one".to_owned()), ..upper.clone() };
    let first = bone(low, given(turn(20.0, [0.0; 3])));
    all.push(without(of("two against each other", vec![first.clone(), upper])));
    all.push(without(of("one on another", vec![first, carried])));
    all
}

/// Free forms at their ends.
pub(super) fn shapes() -> Vec<Case> {
    let shape =
        |kind: Kind| Shape { kind, centre: [5.0, 6.0, 5.5], axis: [0.3, -0.2, 0.9], radius: 6.0, core: 0.5 };
    let of = |name: &str, shapes: Vec<Shape>| {
        let case = nudged(&format!("shape, {name}"), ball(12)).may(&TOO_MUCH);
        case.may(&[(Stage::DeformShapes, ErrorClass::Untrusted)]).with(|s| {
            s.shapes = shapes;
            s.turn = Some(Stage::DeformShapes as usize % TURNS);
        })
    };
    let twist = shape(Kind::Twist { rate: 30.0, length: None });
    let spine = [1.0, 0.0, 0.0];
    let all = [
        ("a way of nothing", shape(Kind::Translate { by: [0.0; 3] })),
        ("a way", shape(Kind::Translate { by: [0.4, -0.3, 0.2] })),
        ("a way of 1e30 mm", shape(Kind::Translate { by: [1e30, 0.0, 0.0] })),
        ("a way of 1e100 mm", shape(Kind::Translate { by: [1e100, -1e100, 1e100] })),
        ("half a turn", shape(Kind::Rotate { angle: 180.0 })),
        ("a thousand turns", shape(Kind::Rotate { angle: 360e3 })),
        ("a thousand times as large", shape(Kind::Scale { along: Some(1e3), across: Some(1e3) })),
        ("a thousandth across", shape(Kind::Scale { along: Some(1.0), across: Some(1e-3) })),
        ("stretched a thousandfold", shape(Kind::Stretch { factor: 1e3 })),
        ("squeezed to a thousandth", shape(Kind::Squeeze { factor: 1e-3 })),
        ("twisted by 1e6 degrees a mm", shape(Kind::Twist { rate: 1e6, length: None })),
        ("tapered by 1e3 a mm", shape(Kind::Taper { rate: 1e3, length: None })),
        ("tapered by -1e6 a mm", shape(Kind::Taper { rate: -1e6, length: None })),
        ("bent by 90 degrees a mm", shape(Kind::Bend { rate: 90.0, spine, length: None })),
        ("bent by 1e6 degrees a mm", shape(Kind::Bend { rate: 1e6, spine, length: None })),
        ("a radius of 1e-9 mm", Shape { radius: 1e-9, ..twist }),
        ("a radius of 1e100 mm", Shape { radius: 1e100, ..twist }),
        ("a core of nearly all", Shape { core: 1.0 - 1e-12, ..shape(Kind::Rotate { angle: 40.0 }) }),
        ("centred 1e100 mm away", Shape { centre: [1e100, 0.0, 0.0], ..twist }),
        ("an axis of 1e-90 mm", Shape { axis: [0.0, 1e-90, 0.0], ..twist }),
        ("a length of 1e-9 mm", shape(Kind::Twist { rate: 30.0, length: Some(1e-9) })),
        ("a length of 1e100 mm", shape(Kind::Twist { rate: 30.0, length: Some(1e100) })),
    ];
    let mut cases: Vec<Case> = all.into_iter().map(|(name, shape)| of(name, vec![shape])).collect();
    cases.push(of("twenty, one after another", vec![shape(Kind::Rotate { angle: 9.0 }); 20]));
    cases
}
