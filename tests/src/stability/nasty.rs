//! The cases that must not break anything, as a table: awkward volumes, surfaces, lattices, materials and handles.

use ivd_core::{ErrorClass, Grid, Volume};
use ivd_motion::handles::{Action, Anchor, Handle, Pin};

use super::case::{Case, Cut, Refused, Stage, TURNS};
use super::inputs::{TOO_MUCH, ball, cube, from_ball, grip, nudged, soft, volume};
use super::{bodies, meshes};

/// What a volume without data ends with: there is no class to take a part from.
const NO_PART: [Refused; 1] = [(Stage::Boundary, ErrorClass::Usage)];
/// What values end with whose squares no `f64` holds: they have no spread to make a transfer function from.
const TOO_WIDE: [Refused; 1] = [(Stage::Atf, ErrorClass::Limit)];
/// What a handle that has nothing to hold ends with.
const NO_GRIP: [Refused; 1] = [(Stage::Deform, ErrorClass::Usage)];

/// All cases, those of a kind together.
pub fn groups() -> Vec<Vec<Case>> {
    let groups = [flat, missing, numbers, ties, grids, levels, surfaces, lattices, materials, handles];
    let others = [bodies::springs, bodies::bones, bodies::shapes];
    groups.into_iter().chain(others).map(|group| group()).collect()
}

/// Volumes of one value or one voxel.
fn flat() -> Vec<Case> {
    let line = |dims| Grid::with_spacing(dims, [1.0; 3]).expect("a sound grid");
    vec![
        nudged("constant u8", volume::<u8>(&cube(7), |_| 9.0)),
        nudged("constant f32", volume::<f32>(&cube(7), |_| -3.5)),
        nudged("constant f64, huge", volume::<f64>(&cube(7), |_| 1e300)).must(&TOO_WIDE),
        nudged("one voxel", volume::<i16>(&cube(1), |_| 5.0)),
        nudged("one voxel without data", volume::<f32>(&cube(1), |_| f64::NAN)).must(&NO_PART),
        nudged("1 x N x N", volume::<u8>(&line([1, 11, 9]), |at| (at[1] * 20) as f64)),
        nudged("N x 1 x N", volume::<f32>(&line([9, 1, 12]), |at| (at[0] * at[2]) as f64)),
        nudged("N x N x 1", volume::<u16>(&line([11, 9, 1]), |at| (at[0] + 7 * at[1]) as f64)),
        nudged("a row", volume::<u8>(&line([40, 1, 1]), |at| (at[0] * 6) as f64)),
        nudged("two voxels", volume::<u8>(&line([1, 1, 2]), |at| at[2] as f64)),
        nudged("more classes than values", ball(9)).with(|s| s.k = 900),
    ]
}

/// Gaps.
fn missing() -> Vec<Case> {
    let grid = cube(12);
    let value = soft(&grid, 4.0);
    let holed = |gap: f64, every: usize| {
        volume::<f32>(&grid, |at| {
            if (at[0] * 5 + at[1] * 3 + at[2] * 7) % every == 0 { gap } else { 100.0 * value(at) }
        })
    };
    let mixed = volume::<f64>(&grid, |at| match (at[0] + at[1] * at[2]) % 9 {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => f64::NEG_INFINITY,
        _ => value(at),
    });
    let one = volume::<f32>(&grid, |at| if at == [5, 6, 7] { 1.0 } else { f64::NAN });
    vec![
        nudged("NaN here and there", holed(f64::NAN, 17)).may(&TOO_MUCH),
        nudged("+Inf here and there", holed(f64::INFINITY, 13)).may(&TOO_MUCH),
        nudged("-Inf in every other voxel", holed(f64::NEG_INFINITY, 2)).may(&TOO_MUCH),
        nudged("all three", mixed).may(&TOO_MUCH),
        nudged("nothing but NaN", volume::<f32>(&grid, |_| f64::NAN)).must(&NO_PART),
        nudged("nothing but Inf", volume::<f64>(&grid, |_| f64::INFINITY)).must(&NO_PART),
        nudged("nothing but NaN, by value", volume::<f32>(&grid, |_| f64::NAN))
            .with(|s| s.cut = Cut::Value(0.0))
            .must(&NO_PART)
            .must(&NO_GRIP),
        nudged("one voxel of data", one).may(&TOO_MUCH),
    ]
}

/// Numbers at the ends of their types.
fn numbers() -> Vec<Case> {
    let grid = cube(13);
    let value = soft(&grid, 4.5);
    let noise = |at: [usize; 3]| ((at[0] * 7 + at[1] * 31 + at[2] * 101) % 17) as f64 / 17.0 - 0.5;
    let real =
        |scale: f64, offset: f64| volume::<f32>(&grid, |at| offset + scale * (4.0 * value(at) + noise(at)));
    let double =
        |scale: f64, offset: f64| volume::<f64>(&grid, |at| offset + scale * (4.0 * value(at) + noise(at)));
    let padded = |low: f64| {
        volume::<i16>(&grid, |at| if from_ball(&grid, 6.0)(at) > 0.0 { low } else { 900.0 * value(at) })
    };
    let gapped =
        volume::<u16>(
            &grid,
            |at| {
                if at[0] == 0 { 65_535.0 } else { ((value(at) * 15.0).floor() + 0.0) * 4096.0 }
            },
        );
    let scaled = |slope: f64, intercept: f64| {
        let stored = ball(13);
        Volume::with_scale(stored.grid().clone(), stored.voxels().clone(), slope, intercept)
            .expect("a sound scale")
    };
    vec![
        nudged("denormals in f32", real(1e-40, 0.0)).may(&TOO_MUCH),
        nudged("denormals in f64", double(1e-310, 0.0)).may(&TOO_MUCH),
        nudged("least denormals", volume::<f64>(&grid, |at| value(at).round() * 5e-324)),
        nudged("largest f32", real(5e37, 0.0)).may(&TOO_MUCH),
        nudged("ends of f32", volume::<f32>(&grid, |at| if value(at) > 0.5 { 3.4e38 } else { -3.4e38 })),
        nudged("ends of f64", volume::<f64>(&grid, |at| if value(at) > 0.5 { f64::MAX } else { f64::MIN }))
            .must(&TOO_WIDE),
        nudged("f64 that no f32 holds", double(1e60, 0.0)).may(&TOO_MUCH),
        nudged("f64 whose squares overflow", double(1e200, 0.0)).may(&TOO_MUCH).must(&TOO_WIDE),
        nudged("offset 1e7 with sigma 1 in f32", real(1.0, 1e7)).may(&TOO_MUCH),
        nudged("offset 1e15 with sigma 1 in f64", double(1.0, 1e15)).may(&TOO_MUCH),
        nudged("u16 in steps of 4096, padded with 65535", gapped),
        nudged("i16 padded with -2000", padded(-2000.0)),
        nudged("i16 padded with -32768", padded(-32_768.0)),
        nudged("u32 to its end", volume::<u32>(&grid, |at| value(at) * 4_294_967_295.0)),
        nudged("i32 to both ends", volume::<i32>(&grid, |at| (value(at) - 0.5) * 4_294_967_295.0)),
        nudged("i8", volume::<i8>(&grid, |at| value(at) * 255.0 - 128.0)),
        nudged("falling scale", scaled(-0.25, 1024.0)),
        nudged(
            "95 % air",
            volume::<i16>(&cube(20), |at| {
                let d = from_ball(&cube(20), 4.0)(at);
                if d > 0.0 { -1000.0 } else { 40.0 - d }
            }),
        ),
        nudged("-0 and 0", volume::<f32>(&grid, |at| if value(at) > 0.5 { 0.0 } else { -0.0 })),
    ]
}

/// Equal values, and equal distances between them.
fn ties() -> Vec<Case> {
    let grid = cube(10);
    let checker = |of: usize| move |at: [usize; 3]| ((at[0] / of + at[1] / of + at[2] / of) % 2 * 100) as f64;
    let mut cases = vec![
        nudged("checkerboard", volume::<u8>(&grid, checker(1))).may(&TOO_MUCH),
        nudged("checkerboard of two", volume::<f32>(&grid, checker(2))).may(&TOO_MUCH),
        nudged("integer ramp along x", volume::<u8>(&grid, |at| at[0] as f64)),
        nudged("integer ramp along all axes", volume::<i16>(&grid, |at| (at[0] + at[1] + at[2]) as f64)),
        nudged("steps of one plane", volume::<u8>(&grid, |at| (at[2] / 5) as f64)),
    ];
    for iso in [4.0, 4.5, 13.0] {
        let ramp = volume::<u8>(&grid, |at| (at[0] + at[1] + at[2]) as f64);
        cases.push(nudged(&format!("ramp cut at {iso}"), ramp).with(|s| s.cut = Cut::Value(iso)));
    }
    for k in [1, 3, 4, 7] {
        let few = volume::<u8>(&grid, |at| ((at[0] + 2 * at[1] + 3 * at[2]) % 6) as f64);
        cases.push(nudged(&format!("six equal values in {k} classes"), few).with(|s| s.k = k).may(&TOO_MUCH));
    }
    cases
}

/// Spacing, direction, origin.
fn grids() -> Vec<Case> {
    let (s, c) = 0.7_f64.sin_cos();
    let upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let turned = [[c, s, 0.0], [-s * c, c * c, s], [s * s, -s * c, c]];
    let mirrored = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let sheared = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3 / 1.09_f64.sqrt(), 0.0, 1.0 / 1.09_f64.sqrt()]];
    let mut all = Vec::new();
    for (name, spacing, origin, direction) in [
        ("spacing 1:1:50", [1.0, 1.0, 50.0], [0.0; 3], upright),
        ("spacing 50:1:1", [50.0, 1.0, 1.0], [0.0; 3], upright),
        ("turned, 1:1:50", [1.0, 1.0, 50.0], [5.0, -7.0, 9.0], turned),
        ("mirrored", [1.0, 1.2, 0.8], [0.0; 3], mirrored),
        ("sheared", [0.7, 0.7, 2.0], [0.0; 3], sheared),
        ("1e6 mm away", [0.5, 0.5, 0.5], [1e6, -1e6, 1e6], upright),
        ("1e9 mm away, turned", [0.5, 0.6, 0.7], [1e9, 1e9, -1e9], turned),
        ("scale 1e-3", [1e-3; 3], [1.0, 2.0, 3.0], upright),
        ("scale 1e3", [1e3; 3], [1.0, 2.0, 3.0], turned),
        ("scale 1e-9", [1e-9; 3], [0.0; 3], upright),
        ("scale 1e9", [1e9; 3], [0.0; 3], upright),
    ] {
        let grid = Grid::new([12, 11, 10], spacing, origin, direction).expect("a sound grid");
        let value = soft(&grid, 3.3);
        all.push(nudged(name, volume::<u8>(&grid, |at| 200.0 * value(at))).may(&TOO_MUCH));
    }
    all
}

/// Isovalues at, just below and just above a voxel's value.
fn levels() -> Vec<Case> {
    let grid = cube(11);
    let value = soft(&grid, 3.6);
    let at_voxel = value([2, 5, 5]);
    let single = f64::from(at_voxel as f32);
    let mut all = Vec::new();
    for (name, iso) in [
        ("at", single),
        ("below", f64::from((single as f32).next_down())),
        ("above", f64::from((single as f32).next_up())),
    ] {
        all.push(
            nudged(&format!("f32 iso {name} a voxel's value"), volume::<f32>(&grid, &value))
                .with(|s| s.cut = Cut::Value(iso)),
        );
    }
    for (name, iso) in [("at", at_voxel), ("below", at_voxel.next_down()), ("above", at_voxel.next_up())] {
        all.push(
            nudged(&format!("f64 iso {name} a voxel's value"), volume::<f64>(&grid, &value))
                .with(|s| s.cut = Cut::Value(iso)),
        );
    }
    for (name, iso) in [("at", 100.0), ("below", 100.0_f64.next_down()), ("above", 100.0_f64.next_up())] {
        let bytes = volume::<u8>(&grid, |at| (100.0 + 40.0 * (value(at) - 0.5)).round());
        all.push(nudged(&format!("u8 iso {name} a voxel's value"), bytes).with(|s| s.cut = Cut::Value(iso)));
    }
    for (name, iso) in [("above all", 1e9), ("below all", -1e9)] {
        let case = nudged(&format!("iso {name}"), ball(9)).with(|s| s.cut = Cut::Value(iso));
        all.push(if iso > 0.0 { case.must(&NO_GRIP) } else { case });
    }
    all
}

/// Surfaces that are hard on topology.
fn surfaces() -> Vec<Case> {
    let grid = cube(16);
    let distance = from_ball(&grid, 5.0);
    let large = cube(24);
    let gyroid = |at: [usize; 3]| {
        let w = at.map(|c| c as f64 * 1.6);
        100.0 + 30.0 * (w[0].sin() * w[1].cos() + w[1].sin() * w[2].cos() + w[2].sin() * w[0].cos())
    };
    let bow = |at: [usize; 3]| {
        f64::from(u8::from(at == [4, 4, 4] || at == [5, 5, 5] || at == [5, 4, 4] || at == [6, 5, 5]))
    };
    vec![
        nudged("leaves the volume", volume::<u8>(&cube(9), |at| 200.0 * soft(&cube(9), 5.5)(at))),
        nudged(
            "a shell of one voxel",
            volume::<u8>(&grid, |at| f64::from(u8::from(distance(at).abs() < 0.6))),
        )
        .with(|s| s.boundary.fill_holes = false)
        .may(&TOO_MUCH),
        nudged("corners that touch", volume::<u8>(&cube(10), bow))
            .with(|s| s.cut = Cut::Value(0.5))
            .may(&TOO_MUCH),
        nudged("specks", volume::<u8>(&grid, |at| f64::from(u8::from(at.iter().all(|c| c % 3 == 1)))))
            .with(|s| s.cut = Cut::Value(0.5))
            .may(&TOO_MUCH),
        nudged("genus in the hundreds", volume::<u8>(&large, gyroid))
            .with(|s| s.cut = Cut::Value(100.0))
            .may(&TOO_MUCH),
        nudged(
            "noise",
            volume::<u8>(&grid, |at| ((at[0] * 73 + at[1] * 179 + at[2] * 283) * 7919 % 251) as f64),
        )
        .with(|s| s.cut = Cut::Value(125.0))
        .may(&TOO_MUCH),
        nudged("all refined away", ball(16))
            .with(|s| s.refine.target = ivd_lattice::refine::Target::Level(9).into())
            .may(&TOO_MUCH),
    ]
}

/// Lattices that no volume gives. They stand in for the extracted one; the volume round them is a ball.
fn lattices() -> Vec<Case> {
    let grid = cube(12);
    let middle = [5.3, 5.4, 5.6];
    let pull = |case: Case| case.with(|s| s.refine.target = ivd_lattice::refine::Target::Level(0).into());
    let on = |name: &str, lattice| pull(nudged(name, ball(12)).on(lattice)).may(&TOO_MUCH);
    let isolated = on("handle at an isolated vertex", meshes::loose(&grid, middle, 3.0));
    vec![
        on("islands", meshes::islands(&grid, &[[3.2, 3.3, 3.4], [8.3, 8.2, 8.6]], 2.0)),
        on("isolated vertices", meshes::loose(&grid, middle, 3.0)),
        isolated.with(|s| s.handles[0].at = Anchor::Vertex(0)),
        on("an edge of no length", meshes::zero_length(&grid, middle, 3.0)),
        on("a triangle twice", meshes::doubled(&grid, middle, 3.0)),
        on("bow tie", meshes::joined(&grid, middle, 3.0, 1)),
        on("an edge with four triangles", meshes::joined(&grid, middle, 3.0, 2)),
    ]
}

/// Stiffness, time and force at their ends.
fn materials() -> Vec<Case> {
    let pulled = |name: String, force: f64| {
        nudged(&name, ball(12)).with(|s| {
            s.handles = vec![grip(3, Action::Force([force, -0.5 * force, 0.3 * force]), 6.0)];
        })
    };
    let mut all = Vec::new();
    for stiffness in [1e-6, 1e-3, 1.0, 1e6, 1e12] {
        for force in [0.0, 1e-30, 1e-6, 1.0, 1e6, 1e30] {
            let case = pulled(format!("stiffness {stiffness:e} N/m, force {force:e} mN"), force);
            all.push(case.with(|s| s.ring.stiffness = stiffness).may(&TOO_MUCH));
        }
    }
    for duration in [1e-9, 1e-3, 1e3] {
        for steps in [1e-9, 0.03, 1e3] {
            let case = pulled(format!("duration {duration:e} s, step {steps:e} of it"), 20.0);
            all.push(
                case.with(|s| {
                    s.ring.duration = duration;
                    // A step of 1e-9 of the duration is 20,000 steps, the most that are made.
                    s.ring.dt = Some(duration * f64::max(steps, 1e-3));
                })
                .may(&TOO_MUCH),
            );
        }
    }
    for (ground, damping) in [(1e-3, 0.0), (1e3, 0.0), (1e-3, 100.0), (1e3, 100.0)] {
        let case = pulled(format!("ground {ground:e}, damping {damping:e}"), 20.0);
        all.push(case.with(|s| (s.ring.ground, s.ring.damping) = (ground, damping)).may(&TOO_MUCH));
    }
    for (density, vertex) in [(1e-12, None), (1e6, None), (1e-3, Some(1e-12)), (1e-3, Some(1e9))] {
        let case = pulled(format!("density {density:e}, mass {vertex:?}"), 20.0);
        all.push(case.with(|s| (s.ring.density, s.ring.vertex_mass) = (density, vertex)).may(&TOO_MUCH));
    }
    all.push(pulled("the thesis to the letter".into(), 20.0).with(|s| s.ring.literal = true).may(&TOO_MUCH));
    // What differs is rings alone: the other ways take turns.
    all.into_iter().enumerate().map(|(i, case)| case.with(|s| s.turn = Some(i % TURNS))).collect()
}

/// Handles that contradict, miss, or ask for what can't be had.
fn handles() -> Vec<Case> {
    let hold = |name: &str, handles: Vec<Handle>| nudged(name, ball(14)).with(|s| s.handles = handles);
    let pick = |at: [f64; 3], by: [f64; 3]| Handle {
        at: Anchor::NearestTo(at),
        action: Action::Move(by),
        radius: 6.0,
    };
    let shift = Action::Move([1.0, 0.0, 0.0]);
    let back = Action::Move([-1.0, 0.0, 0.0]);
    let far = |d: f64| Action::Move([d, 0.0, 0.0]);
    let flaps = volume::<u8>(&cube(16), |at| {
        f64::from(u8::from((at[0] == 5 || at[0] == 9) && at[1] > 2 && at[1] < 13 && at[2] > 2 && at[2] < 13))
    });
    vec![
        hold("handle outside the lattice", vec![pick([500.0, 0.0, 0.0], [1.0, 0.0, 0.0])]).must(&NO_GRIP),
        hold("handle outside the volume and near", vec![pick([-4.0, 6.5, 6.5], [-0.5, 0.0, 0.0])])
            .may(&TOO_MUCH),
        hold("two handles in one cell", vec![grip(4, shift, 6.0), grip(5, shift, 6.0)]).may(&TOO_MUCH),
        hold("two handles in one cell, opposed", vec![grip(4, shift, 6.0), grip(5, back, 6.0)])
            .may(&TOO_MUCH),
        hold("two handles on one vertex, opposed", vec![grip(4, shift, 6.0), grip(4, back, 6.0)])
            .must(&NO_GRIP),
        hold("one handle twice", vec![grip(4, shift, 6.0), grip(4, shift, 6.0)]).may(&TOO_MUCH),
        hold("a move of nothing", vec![grip(4, far(0.0), 6.0)]),
        hold("a move of 1e-30 mm", vec![grip(4, far(1e-30), 6.0)]),
        hold("a move of 1e30 mm", vec![grip(4, far(1e30), 6.0)]).may(&TOO_MUCH),
        hold("a move of 1e30 mm, radius 1e60 mm", vec![grip(4, far(1e30), 1e60)]).may(&TOO_MUCH),
        hold("a move of 1e100 mm", vec![grip(4, far(1e100), 1e100)]).may(&TOO_MUCH),
        hold("a radius of 1e-9 mm", vec![grip(4, far(0.1), 1e-9)]).may(&TOO_MUCH),
        hold("a radius of 1e90 mm", vec![grip(4, far(0.5), 1e90)]).may(&TOO_MUCH),
        hold("everything fixed", vec![grip(4, shift, 6.0)])
            .with(|s| s.fixed = vec![Pin { at: Anchor::Vertex(0), radius: 1e3 }]),
        hold("the handle fixed", vec![grip(4, shift, 6.0)])
            .with(|s| s.fixed = vec![Pin { at: Anchor::Vertex(4), radius: 0.0 }]),
        nudged("opposing flaps", flaps)
            .with(|s| {
                s.refine.target = ivd_lattice::refine::Target::Level(0).into();
                s.cut = Cut::Value(0.5);
                s.handles =
                    vec![pick([5.5, 7.6, 7.4], [2.5, 0.0, 0.0]), pick([8.5, 7.6, 7.4], [-2.5, 0.0, 0.0])];
            })
            .may(&TOO_MUCH),
        nudged("180 degrees of twist", beam()).with(|s| s.handles = twisted()).may(&TOO_MUCH),
        hold("pushed through the middle", vec![pick([6.6, 6.6, 2.3], [0.0, 0.0, 9.0])]).may(&TOO_MUCH),
    ]
}

/// A beam along z.
fn beam() -> Volume {
    let grid = Grid::with_spacing([14, 14, 26], [1.0; 3]).expect("a sound grid");
    volume::<u8>(&grid, |at| {
        f64::from(u8::from((4..10).contains(&at[0]) && (4..10).contains(&at[1]) && (3..23).contains(&at[2])))
    })
}

/// The corners of the beam's upper end, turned by half a turn about its axis.
fn twisted() -> Vec<Handle> {
    let corners = [[3.6, 3.6], [9.4, 3.6], [3.6, 9.4], [9.4, 9.4]];
    let handle = |[x, y]: [f64; 2]| Handle {
        at: Anchor::NearestTo([x, y, 21.5]),
        action: Action::Move([13.0 - 2.0 * x, 13.0 - 2.0 * y, 0.0]),
        radius: 14.0,
    };
    corners.map(handle).into()
}
