//! Fits, chains, which bone holds what, and bones in a body of springs.

use ivd_core::{Exec, Grid, Labels, Lattice};
use ivd_field::fixtures::{lattice as cut, sheared_grid};
use ivd_map::BiharmonicParams;
use nalgebra::{Rotation3, Unit, UnitQuaternion, Vector3};

use super::fit::{self, Unsure};
use super::*;
use crate::Error;
use crate::handles::{Action, Anchor, Handle, Pin};
use crate::mass_spring::{Closeness, MassSpringResult, Params, Prepared, Solver, Springs, solve, with_bones};

/// Numbers in −1…1 without a pattern.
fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        out.push((state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0);
    }
    out
}

fn vectors(count: usize, seed: u64) -> Vec<Vector3<f64>> {
    noise(3 * count, seed).chunks(3).map(|c| Vector3::new(c[0], c[1], c[2])).collect()
}

/// The largest difference between a fitted turn and the one that made the data.
fn missed(places: &[Vector3<f64>], turn: &Rotation3<f64>) -> f64 {
    let arms: Vec<_> = places.iter().map(|x| (*x, turn * x)).collect();
    let found = Rotation3::new(fit::turn(&arms).unwrap());
    (found.matrix() - turn.matrix()).amax()
}

#[test]
fn a_fit_recovers_turns_to_rounding_from_bodies_planes_and_three_points() {
    for seed in 1..40 {
        let [a, b, c] = [0, 1, 2].map(|i| noise(3, seed)[i]);
        let axis = Unit::new_normalize(Vector3::new(a, b, c + 0.01));
        // Half a turn and nearly none among them.
        for angle in [3.0 * a, std::f64::consts::PI, 1e-9 * b] {
            let turn = Rotation3::from_axis_angle(&axis, angle);
            let body: Vec<_> = vectors(30, seed).iter().map(|p| p * 1e3).collect();
            let flat: Vec<_> = body.iter().map(|p| Vector3::new(p.x, p.y, 0.0)).collect();
            for places in [&body[..], &flat, &body[..3], &flat[..2]] {
                assert!(missed(places, &turn) < 1e-12, "{} points: {}", places.len(), missed(places, &turn));
            }
        }
    }
}

#[test]
fn thin_data_is_met_at_its_points_and_lines_turn_as_little_as_they_can() {
    let turn = Rotation3::new(Vector3::new(0.3, -0.4, 1.1));
    for thin in [1e-2, 1e-4, 1e-6, 0.0] {
        let places: Vec<_> =
            vectors(20, 3).iter().map(|p| Vector3::new(50.0 * p.x, thin * p.y, thin * p.z)).collect();
        let arms: Vec<_> = places.iter().map(|x| (*x, turn * x)).collect();
        let found = Rotation3::new(fit::turn(&arms).unwrap());
        let worst = arms.iter().map(|(x, y)| (found * x - y).norm()).fold(0.0, f64::max);
        assert!(worst < 1e-9 + 3.0 * thin * f64::from(u8::from(thin < 1e-2)), "{thin}: {worst}");
    }
    // A line turned in a plane turns about the plane's normal, and not about itself.
    let line = |t: f64| Vector3::x() * t;
    let arms: Vec<_> = [-2.0, 1.0, 5.0].map(|t| (line(t), Vector3::y() * t)).to_vec();
    let found = fit::turn(&arms).unwrap();
    assert!((found - Vector3::z() * std::f64::consts::FRAC_PI_2).norm() < 1e-12, "{found}");
    let about: Vec<_> = [-2.0, 1.0, 5.0].map(|t| (line(t), -line(t))).to_vec();
    assert_eq!(fit::turn(&about), Err(Unsure::HalfTurn));
    assert_eq!(fit::turn(&[]), Ok(Vector3::zeros()));
    assert_eq!(fit::turn(&[(Vector3::zeros(), Vector3::zeros())]), Ok(Vector3::zeros()));
}

#[test]
fn mirrored_data_never_gives_a_reflection() {
    // A mirrored body has a best turn where its extents differ; it is one, and nothing nearby is better.
    let body: Vec<_> = vectors(40, 5).iter().map(|p| Vector3::new(9.0 * p.x, 4.0 * p.y, p.z)).collect();
    let arms: Vec<_> = body.iter().map(|x| (*x, Vector3::new(x.x, x.y, -x.z))).collect();
    let found = fit::turn(&arms).unwrap();
    let left = |turn: Vector3<f64>| -> f64 {
        arms.iter().map(|(x, y)| (Rotation3::new(turn) * x - y).norm_squared()).sum()
    };
    for step in vectors(60, 9) {
        assert!(left(found) <= left(found + 1e-3 * step), "{step}");
    }
    // A mirrored cube has none.
    let cube = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(Vector3::from);
    let arms: Vec<_> = cube.iter().map(|x| (*x, -x)).collect();
    assert_eq!(fit::turn(&arms), Err(Unsure::Mirrored));
    // Nor has a plane that is squashed onto a line.
    let squashed: Vec<_> =
        vectors(9, 2).iter().map(|p| (Vector3::new(p.x, p.y, 0.0), Vector3::new(p.x, 0.0, 0.0))).collect();
    assert!(fit::turn(&squashed).is_err() || left_over(&squashed) > 0.0);
}

fn left_over(arms: &[(Vector3<f64>, Vector3<f64>)]) -> f64 {
    let turn = Rotation3::new(fit::turn(arms).unwrap());
    arms.iter().map(|(x, y)| (turn * x - y).norm()).sum()
}

#[test]
fn every_part_of_a_turn_is_a_true_rotation_and_whole_turns_leave_nothing() {
    let axis = Unit::new_normalize(Vector3::new(0.2, -0.5, 0.7));
    for angle in [-360.0, 3.0, 90.0, 180.0, 270.0, 720.0, 1e4] {
        let turn = RigidTransform {
            pivot: [4.0, 5.0, 6.0],
            axis: (axis.into_inner() * 3.0).into(),
            angle,
            by: [1.0, 0.0, -2.0],
        };
        for part in [0.0, 0.125, 0.3, 0.5, 1.0] {
            let pose = turn.after(part);
            let exact = UnitQuaternion::from_axis_angle(&axis, (angle * part % 360.0).to_radians());
            for p in vectors(50, 8).into_iter().map(|p| p * 100.0) {
                let arm = p - Vector3::from(turn.pivot);
                let expected = exact * arm - arm + Vector3::from(turn.by) * part;
                assert!((pose.displacement(p) - expected).norm() < 1e-12 * 100.0, "{angle}, {part}");
                assert!((pose.back(p + pose.displacement(p)) - p).norm() < 1e-12 * 100.0, "its inverse");
            }
            assert_eq!(pose.displacement(turn.pivot.into()), Vector3::from(turn.by) * part, "the pivot");
        }
    }
    let whole = RigidTransform { pivot: [0.1, 0.2, 0.3], axis: [1.0, 2.0, 3.0], angle: 720.0, by: [0.0; 3] }
        .after(1.0);
    assert!(vectors(9, 1).iter().all(|p| whole.displacement(*p) == Vector3::zeros()));
}

/// A rod along z, 24 voxels long, cut at a voxel's accuracy, on a sheared grid far from the origin or an upright one.
fn rod(sheared: bool) -> Lattice {
    let grid = if sheared {
        sheared_grid([28, 24, 14])
    } else {
        Grid::with_spacing([16, 16, 32], [1.0; 3]).unwrap()
    };
    let (x, y, z) = if sheared { (6.5, 10.0, -14.0) } else { (7.5, 7.5, 15.5) };
    let size = if sheared { 3.0 } else { 4.0 };
    cut(&grid, |p| {
        let across = Vector3::new(p.x - x, p.y - y, 0.0).norm() - size;
        (-across).min(12.0 - (p.z - z).abs())
    })
    .0
}

/// The box of the world between two heights over the grid's origin.
fn slab(lattice: &Lattice, from: f64, to: f64) -> Region {
    let origin = lattice.grid().origin();
    let corner = |side: f64, z: f64| [origin[0] + side, origin[1] + side, origin[2] + z];
    Region::Box { low: corner(-500.0, from), high: corner(500.0, to) }
}

fn bone(name: &str, region: Region, drive: Drive) -> BoneSpec {
    BoneSpec { name: name.into(), parent: None, region: Some(region), class: None, drive, reach: 60.0 }
}

fn turned(lattice: &Lattice, pivot: [f64; 3], angle: f64) -> Drive {
    let origin = Vector3::from(lattice.grid().origin());
    let pivot = (origin + Vector3::from(pivot)).into();
    Drive::Prescribed(RigidTransform { pivot, axis: [1.0, 0.3, 0.0], angle, by: [0.0; 3] })
}

fn run(
    lattice: &Lattice,
    handles: &[Handle],
    bones: &[BoneSpec],
    params: &Params,
) -> Result<MassSpringResult, Error> {
    with_bones(lattice, None, handles, &[], bones, params, &Exec::default())
}

fn statics() -> Params {
    Params {
        solver: Solver::Projective,
        closeness: Closeness { tolerance: 1e-6, ..Closeness::default() },
        ..Params::default()
    }
}

/// The largest relative change of a distance between any two vertices of a bone.
fn strain(lattice: &Lattice, vertices: &[u32], displacement: &[[f64; 3]]) -> f64 {
    let rest = lattice.local_positions();
    let mut worst = 0.0_f64;
    for (i, &a) in vertices.iter().enumerate() {
        for &b in &vertices[..i] {
            let [a, b] = [a as usize, b as usize];
            let before = (rest[a] - rest[b]).norm();
            let after =
                (rest[a] + Vector3::from(displacement[a]) - rest[b] - Vector3::from(displacement[b])).norm();
            worst = worst.max((after / before - 1.0).abs());
        }
    }
    worst
}

/// A chain of three bones up the rod: the lowest stays.
fn chain(lattice: &Lattice, angles: [f64; 2]) -> Vec<BoneSpec> {
    let up = if lattice.grid().spacing()[2] > 1.0 { -1.0 } else { 1.0 };
    let at = |a: f64, b: f64| {
        let (a, b) = if up > 0.0 { (a, b) } else { (-b - 1.0, -a - 1.0) };
        slab(lattice, a, b)
    };
    let joint = |z: f64| if up > 0.0 { [7.5, 7.5, z] } else { [6.5, 10.0, -z] };
    let mut bones = vec![
        bone("low", at(0.0, 8.0), Drive::Prescribed(RigidTransform::NONE)),
        bone("middle", at(12.0, 18.0), turned(lattice, joint(10.0), angles[0])),
        bone("high", at(22.0, 30.0), turned(lattice, joint(20.0), angles[1])),
    ];
    bones[1].parent = Some("low".into());
    bones[2].parent = Some("middle".into());
    bones
}

#[test]
fn bones_stay_rigid_in_every_frame_of_every_solver_and_joints_stay_together() {
    for sheared in [false, true] {
        let lattice = rod(sheared);
        let bones = chain(&lattice, [25.0, 180.0]);
        let skeleton =
            Skeleton::new(&lattice, None, &bones, &[], &vec![false; lattice.keys().len()]).unwrap();
        for solver in [Solver::Dynamics, Solver::Projective, Solver::Xpbd] {
            let params = Params {
                solver,
                springs: Springs { frames: 5, duration: 0.02, ..Springs::default() },
                closeness: Closeness { max_iterations: 60, ..Closeness::default() },
                ..Params::default()
            };
            let solved = run(&lattice, &[], &bones, &params).unwrap();
            assert_eq!(solved.motion.frames().len(), 5);
            for (k, frame) in solved.motion.frames().iter().enumerate() {
                for bone in skeleton.bones() {
                    let strain = strain(&lattice, &bone.vertices, &frame.displacement);
                    assert!(strain < 1e-12, "{solver:?}, frame {k}, {}: {strain}", bone.name);
                }
            }
            let last = &solved.motion.frames()[4].displacement;
            for (b, bone) in skeleton.bones().iter().enumerate() {
                for &v in &bone.vertices {
                    let exact = skeleton.displacement(b, lattice.world(v as usize).0, 1.0);
                    assert!((Vector3::from(last[v as usize]) - exact).norm() < 1e-11, "{solver:?}");
                }
            }
            assert_eq!(solved.bones.len(), 3);
            assert!(solved.bones.iter().all(|b| b.strain < 1e-12), "{:?}", solved.bones);
            assert!((solved.bones[1].angle - 25.0).abs() < 1e-9 && solved.bones[0].angle == 0.0);
            assert!(
                (solved.bones[2].angle - 155.0).abs() < 1e-9,
                "25 and 180 about one axis: {:?}",
                solved.bones
            );
        }
        // The joint's image under both motions, to the bit, at any part of the way.
        for (child, joint) in [(1, bones[1].clone()), (2, bones[2].clone())] {
            let Drive::Prescribed(turn) = joint.drive else { unreachable!() };
            for s in [0.0, 0.1, 0.5, 0.77, 1.0] {
                let pivot = Vector3::from(turn.pivot);
                let [of_child, of_parent] = [child, child - 1].map(|b| skeleton.displacement(b, pivot, s));
                assert_eq!(of_child, of_parent, "bone {child} at {s}");
            }
        }
    }
}

#[test]
fn soft_tissue_between_bones_follows_and_balances_and_action_is_reaction() {
    let lattice = rod(false);
    let push = |by| Drive::Prescribed(RigidTransform { by, ..RigidTransform::NONE });
    let bones = [
        bone("low", slab(&lattice, 0.0, 8.0), push([0.0; 3])),
        bone("high", slab(&lattice, 22.0, 32.0), push([0.0, 0.0, 2.0])),
    ];
    let solved = run(&lattice, &[], &bones, &statics()).unwrap();
    assert!(solved.residual <= 1e-6, "{}", solved.residual);
    let rest = lattice.local_positions();
    let last = &solved.motion.frames()[0].displacement;
    // Pulled apart by 2 mm, the tissue between stretches evenly, to what its ends and its mesh make of it.
    for (p, u) in rest.iter().zip(&last[..]) {
        let even = 2.0 * ((p.z - 8.0) / 14.0).clamp(0.0, 1.0);
        assert!((u[2] - even).abs() < 0.35, "at {}: {} instead of {even}", p.z, u[2]);
    }
    assert!(solved.bones[1].force_mn[2] > 0.0, "it takes a pull to hold it: {:?}", solved.bones[1]);
    assert_eq!(solved.bones[0].force_mn, [0.0; 3], "what stays is no bone to the solver");
    // Where both move there is no outside: what one is held with the other is held against.
    let apart = [
        BoneSpec { drive: push([0.0, 0.0, -1.0]), ..bones[0].clone() },
        BoneSpec { drive: push([0.0, 0.0, 1.0]), ..bones[1].clone() },
    ];
    let solved = run(&lattice, &[], &apart, &statics()).unwrap();
    let [low, high] = [0, 1].map(|b| Vector3::from(solved.bones[b].force_mn));
    assert!((low + high).norm() < 1e-4 * high.norm(), "{low} and {high}");
}

#[test]
fn a_rigid_motion_of_all_bones_strains_nothing() {
    // Every bone of the chain is carried by the first: the tissue between goes along, and no spring is longer than at rest.
    let lattice = rod(false);
    let mut bones = chain(&lattice, [0.0, 0.0]);
    bones[0].drive = turned(&lattice, [3.0, 2.0, 1.0], 40.0);
    let solved = run(
        &lattice,
        &[],
        &bones,
        &Params { closeness: Closeness { tolerance: 1e-9, ..statics().closeness }, ..statics() },
    )
    .unwrap();
    let skeleton = Skeleton::new(&lattice, None, &bones, &[], &vec![false; lattice.keys().len()]).unwrap();
    let last = &solved.motion.frames()[0].displacement;
    assert!(solved.energy_last < 1e-6, "{} nJ, of springs of 50 N/m on ways of 12 mm", solved.energy_last);
    for (v, u) in last.iter().enumerate() {
        // The rod's flat end has no stiffness along its normal to first order.
        let exact = skeleton.displacement(0, lattice.world(v).0, 1.0);
        assert!((Vector3::from(*u) - exact).norm() < 2e-3, "vertex {v}: {u:?} instead of {exact:?}");
    }
}

#[test]
fn no_motion_is_no_motion_to_the_bit_and_a_still_bone_is_a_fixed_one() {
    let lattice = rod(false);
    let still = chain(&lattice, [0.0, 0.0]);
    for solver in [Solver::Dynamics, Solver::Projective, Solver::Xpbd] {
        let params = Params {
            solver,
            springs: Springs { duration: 0.01, ..Springs::default() },
            closeness: Closeness { max_iterations: 50, ..Closeness::default() },
            ..Params::default()
        };
        let solved = run(&lattice, &[], &still, &params).unwrap();
        assert!(
            solved
                .motion
                .frames()
                .iter()
                .flat_map(|f| &f.displacement[..])
                .flatten()
                .all(|c| c.to_bits() == 0)
        );
        assert_eq!((solved.vertices_moved, solved.residual, solved.motion.reach().len()), (0, 0.0, 0));
        // A handle between a bone that stays and one.
        let handle = Handle {
            at: Anchor::NearestTo([11.5, 7.5, 20.0]),
            action: Action::Move([1.0, 0.5, 0.0]),
            radius: 30.0,
        };
        let one = &still[..1];
        let with_bone = run(&lattice, &[handle], one, &params).unwrap();
        let held = Skeleton::new(&lattice, None, one, &[], &vec![false; lattice.keys().len()]).unwrap();
        let fixed: Vec<Pin> =
            held.bones()[0].vertices.iter().map(|&v| Pin { at: Anchor::Vertex(v), radius: 0.0 }).collect();
        let with_fix = solve(&lattice, None, &[handle], &fixed, &params, &Exec::default()).unwrap();
        assert_eq!(with_bone.motion, with_fix.motion, "{solver:?}");
        assert_eq!(with_bone.residual, with_fix.residual);
    }
}

/// Handles on vertices, which go where a motion takes them.
fn handles(lattice: &Lattice, vertices: &[u32], to: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Vec<Handle> {
    let handle = |&v: &u32| {
        let at = lattice.world(v as usize).0;
        Handle { at: Anchor::Vertex(v), action: Action::Move((to(at) - at).into()), radius: 5.0 }
    };
    vertices.iter().map(handle).collect()
}

#[test]
fn fitted_bones_go_where_their_handles_go_and_a_fitted_child_keeps_its_joint() {
    let lattice = rod(false);
    let free = vec![false; lattice.keys().len()];
    let fitted = Drive::Fitted { pivot: None };
    let bones = [bone("high", slab(&lattice, 20.0, 32.0), fitted)];
    let held = Skeleton::at_rest(&lattice, None, &lattice.local_positions(), &bones).unwrap();
    let mine = &held.bones()[0].vertices;
    let (turn, shift) = (Rotation3::new(Vector3::new(0.2, 0.5, -0.3)), Vector3::new(1.0, -2.0, 0.5));
    let picked = [mine[0], mine[mine.len() / 3], mine[mine.len() / 2], mine[mine.len() - 1]];
    let all = handles(&lattice, &picked, |p| turn * p + shift);
    let solved = run(&lattice, &all, &bones, &statics()).unwrap();
    let last = &solved.motion.frames()[0].displacement;
    for &v in mine {
        let at = lattice.world(v as usize).0;
        assert!(
            (Vector3::from(last[v as usize]) - (turn * at + shift - at)).norm() < 1e-12 * 60.0,
            "vertex {v}"
        );
    }
    assert!(solved.bones[0].left_mm.unwrap() < 1e-12, "{:?}", solved.bones);
    // One handle is a translation.
    let one = run(&lattice, &all[..1], &bones, &statics()).unwrap();
    let by = one.motion.frames()[0].displacement[picked[0] as usize];
    assert!(mine.iter().all(|&v| one.motion.frames()[0].displacement[v as usize] == by));
    // A drag of the handles is a new fit, and the same as one from the start.
    let mut prepared =
        Prepared::with_bones(&lattice, None, &all[..1], &[], &bones, &statics(), &Exec::default()).unwrap();
    let moved: Vec<Handle> = handles(&lattice, &picked[..1], |p| p + shift / 2.0);
    let dragged = prepared.update(&moved, &Exec::default()).unwrap();
    assert_eq!(dragged.motion, run(&lattice, &moved, &bones, &statics()).unwrap().motion);

    // A child: its parent turns, its handles go where the parent and a turn about the joint take them.
    let mut chain = chain(&lattice, [30.0, 0.0]);
    let joint = Vector3::new(7.5, 7.5, 20.0);
    chain[2].drive = Drive::Fitted { pivot: Some(joint.into()) };
    let known = Skeleton::new(&lattice, None, &chain[..2], &[], &free).unwrap();
    let goes = |p: Vector3<f64>| {
        let own = joint + turn * (p - joint);
        own + known.displacement(1, own, 1.0)
    };
    let held = Skeleton::at_rest(&lattice, None, &lattice.local_positions(), &chain).unwrap();
    let mine = &held.bones()[2].vertices;
    let aimed = handles(&lattice, &[mine[0], mine[9], mine[mine.len() - 1]], goes);
    let solved = run(&lattice, &aimed, &chain, &statics()).unwrap();
    for &v in mine {
        let at = lattice.world(v as usize).0;
        let u = Vector3::from(solved.motion.frames()[0].displacement[v as usize]);
        assert!((u - (goes(at) - at)).norm() < 1e-12 * 60.0, "vertex {v}");
    }
}

#[test]
fn bones_that_contradict_are_refused_by_name() {
    let lattice = rod(false);
    let good = chain(&lattice, [5.0, 5.0]);
    let refused = |handles: &[Handle], fixed: &[Pin], bones: &[BoneSpec], words: &[&str]| {
        let all = with_bones(&lattice, None, handles, fixed, bones, &statics(), &Exec::default());
        let error = all.unwrap_err().to_string();
        for word in words {
            assert!(error.contains(word), "{word}: {error}");
        }
    };
    let with = |b: usize, change: &dyn Fn(&mut BoneSpec)| {
        let mut bones = good.clone();
        change(&mut bones[b]);
        bones
    };
    refused(&[], &[], &[], &["handle"]);
    let nowhere = with(1, &|p| p.region = Some(slab(&lattice, 900.0, 901.0)));
    refused(&[], &[], &nowhere, &["middle", "no vertex"]);
    let twice = with(1, &|p| p.region = Some(slab(&lattice, 6.0, 18.0)));
    refused(&[], &[], &twice, &["low and middle both hold vertex"]);
    refused(&[], &[], &with(2, &|p| p.name = "low".into()), &["two bones are called low"]);
    refused(&[], &[], &with(2, &|p| p.parent = Some("top".into())), &["high", "top"]);
    refused(&[], &[], &with(0, &|p| p.parent = Some("high".into())), &["carried by itself"]);
    refused(&[], &[], &with(1, &|p| p.class = Some(3)), &["no labels", "class 3", "middle"]);
    refused(&[], &[], &with(1, &|p| p.region = None), &["middle", "region"]);
    let off_joint = Drive::Prescribed(RigidTransform { by: [1.0, 0.0, 0.0], ..RigidTransform::NONE });
    refused(&[], &[], &with(1, &|p| p.drive = off_joint), &["joint"]);
    let fitted = with(2, &|p| p.drive = Drive::Fitted { pivot: Some([7.5, 7.5, 20.0]) });
    refused(&[], &[], &fitted, &["high", "no handle lies on it"]);

    let held = Skeleton::at_rest(&lattice, None, &lattice.local_positions(), &good).unwrap();
    let mine = &held.bones()[2].vertices;
    let push = handles(&lattice, &mine[..1], |p| p + Vector3::x());
    refused(&push, &[], &good, &["high", "given"]);
    let pull = [Handle { action: Action::Force([1.0, 0.0, 0.0]), ..push[0] }];
    refused(&pull, &[], &fitted, &["high", "force"]);
    let pin = [Pin { at: Anchor::Vertex(mine[0]), radius: 0.0 }];
    refused(&[], &pin, &good, &["fixed", "high"]);
    // What stays may be fixed as well.
    let low = [Pin { at: Anchor::Vertex(held.bones()[0].vertices[0]), radius: 0.0 }];
    with_bones(&lattice, None, &[], &low, &good, &statics(), &Exec::default()).unwrap();
    // Two handles turned round their line.
    let far = |p: Vector3<f64>| Vector3::new(7.5, 7.5, 26.0) * 2.0 - p;
    let bones = [bone("high", slab(&lattice, 20.0, 32.0), Drive::Fitted { pivot: None })];
    let ends = [mine[0], mine[mine.len() - 1]];
    refused(&handles(&lattice, &ends, far), &[], &bones, &["high", "line"]);
}

#[test]
fn a_class_holds_the_vertices_beside_its_voxels_and_a_region_narrows_it() {
    let lattice = rod(false);
    let grid = lattice.grid().clone();
    // Two bones of one class, with another class between.
    let ids: Vec<u16> = (0..grid.len())
        .map(|i| match grid.index(i).0[2] {
            0..=9 | 22..=31 => 4,
            _ => 2,
        })
        .collect();
    let labels = Labels::new(grid.clone(), ids.into(), Vec::new()).unwrap();
    let rest = lattice.local_positions();
    let of = |region: Option<Region>| {
        let mut part = bone("b", slab(&lattice, 0.0, 1.0), Drive::Prescribed(RigidTransform::NONE));
        (part.region, part.class) = (region, Some(4));
        Skeleton::at_rest(&lattice, Some(&labels), &rest, &[part])
    };
    let both = of(None).unwrap();
    for (v, p) in rest.iter().enumerate() {
        // A vertex of this lattice lies inside a cell, between the layers below and above it.
        let beside = p.z < 10.0 || p.z > 21.0;
        assert_eq!(both.holder(v).is_some(), beside, "at {}", p.z);
    }
    let low = of(Some(slab(&lattice, -1.0, 16.0))).unwrap();
    assert!(low.bones()[0].vertices.iter().all(|&v| rest[v as usize].z < 10.0));
    assert!(low.bones()[0].vertices.len() < both.bones()[0].vertices.len());
    let between = of(Some(slab(&lattice, 13.0, 18.0))).unwrap_err().to_string();
    assert!(between.contains("class 4") && between.contains("within its region"), "{between}");
    let other = Labels::new(Grid::with_spacing([2; 3], [1.0; 3]).unwrap(), vec![4; 8].into(), Vec::new());
    let mut part = bone("b", slab(&lattice, 0.0, 1.0), Drive::Prescribed(RigidTransform::NONE));
    part.class = Some(4);
    assert!(Skeleton::at_rest(&lattice, Some(&other.unwrap()), &rest, &[part]).is_err());
}

#[test]
fn regions_hold_their_border_and_nothing_beyond() {
    let origin = Vector3::new(1e6, -1e6, 5.0);
    let world = |p: [f64; 3]| (origin + Vector3::from(p)).into();
    let ball = Region::Ball { centre: world([0.0; 3]), radius: 2.0 };
    let capsule = Region::Capsule { from: world([0.0; 3]), to: world([0.0, 0.0, 8.0]), radius: 1.0 };
    let cube = Region::Box { low: world([0.0; 3]), high: world([1.0, 2.0, 3.0]) };
    for (region, at, inside) in [
        (ball, [2.0, 0.0, 0.0], true),
        (ball, [2.0, 0.1, 0.0], false),
        (capsule, [1.0, 0.0, 4.0], true),
        (capsule, [0.0, 0.0, 9.0], true),
        (capsule, [0.8, 0.0, 8.8], false),
        (cube, [1.0, 2.0, 3.0], true),
        (cube, [1.0, 2.0, 3.1], false),
    ] {
        region.check().unwrap();
        assert_eq!(region.holds(at.into(), origin), inside, "{region:?} at {at:?}");
    }
    let dot = Region::Capsule { from: [1.0; 3], to: [1.0; 3], radius: 1.0 };
    assert!(dot.holds(Vector3::new(2.0, 1.0, 1.0), Vector3::zeros()), "a line without length");
    assert!(Region::Ball { centre: [f64::NAN, 0.0, 0.0], radius: 1.0 }.check().is_err());
}

#[test]
fn threads_do_not_change_a_byte() {
    let lattice = rod(false);
    let bones = chain(&lattice, [20.0, -35.0]);
    for solver in [Solver::Dynamics, Solver::Projective] {
        let params =
            Params { solver, springs: Springs { duration: 0.01, ..Springs::default() }, ..Params::default() };
        let [one, four] = [1, 4].map(|threads| {
            let exec = Exec::default().with_threads(threads);
            with_bones(&lattice, None, &[], &[], &bones, &params, &exec).unwrap()
        });
        assert_eq!(one, four);
    }
}

/// The distance (mm) of the voxels inside a lattice from where the bone that holds them takes them: largest, root mean square.
fn off(lattice: &Lattice, skeleton: &Skeleton, motion: &ivd_core::Motion, bones: &[BoneSpec]) -> (f64, f64) {
    let params = BiharmonicParams::default();
    let mapped = ivd_map::biharmonic(lattice, motion, 0, &params, &Exec::default()).unwrap();
    assert!(mapped.figures.folds == 0 && mapped.figures.min_det_j > 0.05, "{}", mapped.figures.min_det_j);
    let inside = ivd_octree::inside(lattice, &Exec::default()).unwrap();
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
    for i in (0..inside.inside().len()).filter(|&i| inside.inside()[i] != 0) {
        let index = lattice.grid().index(i);
        let at = Vector3::from(index.0).map(|c| c as f64);
        let Some(b) = bones.iter().position(|b| b.region.unwrap().holds(at, Vector3::zeros())) else {
            continue;
        };
        let by = Vector3::from(mapped.displacement.forward().at(index)).map(f64::from);
        let off = (by - skeleton.displacement(b, at, 1.0)).norm();
        (worst, count) = (worst.max(off), count + 1.0);
        squares += off * off;
    }
    (worst, f64::sqrt(squares / count))
}

#[test]
fn the_map_takes_a_bones_voxels_along_with_it() {
    let lattice = rod(false);
    let grid = lattice.grid();
    let inside = ivd_octree::inside(&lattice, &Exec::default()).unwrap();
    let ids: Vec<u16> = inside.inside().iter().map(|i| u16::from(*i)).collect();
    let labels = Labels::new(grid.clone(), ids.into(), Vec::new()).unwrap();
    let mut bones = chain(&lattice, [8.0, 8.0]);
    for bone in &mut bones {
        bone.class = Some(1);
    }
    let solved = with_bones(&lattice, Some(&labels), &[], &[], &bones, &statics(), &Exec::default()).unwrap();
    let skeleton =
        Skeleton::new(&lattice, Some(&labels), &bones, &[], &vec![false; lattice.keys().len()]).unwrap();
    let inner = solved.motion.inner();
    assert!(inner.places.len() > 500 && inner.frames.len() == 1);
    let with = off(&lattice, &skeleton, &solved.motion, &bones);
    let told = &solved.motion;
    let blind = ivd_core::Motion::new(told.grid().clone(), told.vertex_count(), told.frames().to_vec());
    let blind = blind.unwrap().with_reach(told.reach().to_vec()).unwrap();
    let without = off(&lattice, &skeleton, &blind, &bones);
    assert!(with.0 < 0.15 && with.0 < without.0, "{with:?}, without inner points {without:?}");
    assert!(with.1 < 0.7 * without.1, "{with:?}, without inner points {without:?}");
}
