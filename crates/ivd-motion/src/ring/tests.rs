use ivd_core::{Classified, ElementKey, ErrorClass, Grid, LatticeSource};

use super::*;
use crate::handles::Anchor;

const SIDE: usize = 21;

/// A flat sheet of `SIDE`² vertices, 1 mm apart along x and y, its diagonals mirrored about the middle.
fn sheet(origin: [f64; 3]) -> Lattice {
    on(&Grid::new([SIDE, SIDE, 2], [1.0; 3], origin, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        .unwrap())
}

fn on(grid: &Grid) -> Lattice {
    let at = |x: usize, y: usize| (x + SIDE * y) as u32;
    let mut triangles = Vec::new();
    for y in 0..SIDE - 1 {
        for x in 0..SIDE - 1 {
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            if x < SIDE / 2 {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    let keys = (0..SIDE * SIDE).map(|i| ElementKey::new(grid.dims(), [i % SIDE + 1, i / SIDE + 1, 1], 2));
    Lattice::new(grid.clone(), keys.collect(), vec![[0.0, 0.0, 0.5]; SIDE * SIDE].into(), triangles.into())
        .unwrap()
        .with_source(LatticeSource::Mask)
}

fn vertex(x: usize, y: usize) -> Anchor {
    Anchor::Vertex((x + SIDE * y) as u32)
}

fn moved(at: Anchor, by: [f64; 3], radius: f64) -> Handle {
    Handle { at, action: Action::Move(by), radius }
}

fn pulled(at: Anchor, force: [f64; 3], radius: f64) -> Handle {
    Handle { at, action: Action::Force(force), radius }
}

fn solve(handles: &[Handle], fixed: &[Pin], params: &RingParams) -> Result<RingResult, Error> {
    super::solve(&sheet([0.0; 3]), handles, fixed, params, &Exec::default())
}

fn displacement(solved: &RingResult) -> &[[f64; 3]] {
    &solved.motion.frames()[0].displacement
}

fn at(solved: &RingResult, x: usize, y: usize) -> Vector3<f64> {
    displacement(solved)[x + SIDE * y].into()
}

fn distance(i: usize, x: f64, y: f64) -> f64 {
    ((i % SIDE) as f64 - x).hypot((i / SIDE) as f64 - y)
}

#[test]
fn the_target_moves_exactly_and_beyond_the_radius_nothing_does() {
    for by in [[0.0, 0.0, 3.0], [1.5, -0.7, 0.3], [-4.0, 0.0, 0.0]] {
        let solved = solve(&[moved(vertex(10, 10), by, 6.5)], &[], &RingParams::default()).unwrap();
        assert_eq!(displacement(&solved)[10 + SIDE * 10], by);
        for (i, u) in displacement(&solved).iter().enumerate() {
            let d = distance(i, 10.0, 10.0);
            assert_eq!(*u != [0.0; 3], d < 6.5, "vertex {i} at {d}");
        }
        assert_eq!(solved.motion.reach(), [Ball { centre: [10.0, 10.0, 0.5], radius: 6.5 }]);
        assert_eq!(solved.max_displacement_mm, Vector3::from(by).norm());
        assert_eq!(solved.steps, 200);
    }
}

#[test]
fn followers_fall_off_smoothly_and_no_neighbours_are_torn_apart() {
    let solved = solve(&[moved(vertex(10, 10), [0.0, 0.0, 4.0], 9.0)], &[], &RingParams::default()).unwrap();
    let lattice = sheet([0.0; 3]);
    let edges = Edges::new(&lattice, &lattice.local_positions(), |_| true);
    for v in 0..SIDE * SIDE {
        for &u in edges.of(v) {
            let [a, b] = [v, u as usize].map(|i| Vector3::from(displacement(&solved)[i]));
            // The taper's steepest slope is 1.54 moves a radius; a diagonal is √2 long.
            assert!((a - b).norm() < 1.54 * 4.0 / 9.0 * 2.0_f64.sqrt() + 0.05, "{v} {u}: {a} {b}");
        }
    }
    let profile: Vec<f64> = (10..20).map(|x| at(&solved, x, 10).z).collect();
    assert!(profile.windows(2).all(|w| w[0] > w[1] || w[1] == 0.0), "{profile:?}");
}

#[test]
fn soft_springs_follow_the_taper_alone() {
    let params = RingParams { stiffness: 1e-9, ..RingParams::default() };
    let solved = solve(&[moved(vertex(10, 10), [0.0, 2.0, 0.0], 8.0)], &[], &params).unwrap();
    for (i, u) in displacement(&solved).iter().enumerate() {
        let t = distance(i, 10.0, 10.0) / 8.0;
        let expected = if t < 1.0 { 2.0 * (1.0 - t * t).powi(2) } else { 0.0 };
        assert!((u[1] - expected).abs() < 1e-5 && u[0].abs() < 1e-5, "vertex {i}: {u:?} for {expected}");
    }
}

#[test]
fn no_force_and_no_move_leave_every_bit() {
    for handle in [moved(vertex(10, 10), [0.0; 3], 5.0), pulled(vertex(10, 10), [0.0, -0.0, 0.0], 5.0)] {
        let solved = solve(&[handle], &[], &RingParams::default()).unwrap();
        let bits = displacement(&solved).iter().flatten().all(|c| c.to_bits() == 0);
        assert!(bits && solved.vertices_moved == 0);
        assert_eq!((solved.residual, solved.energy_last), (0.0, 0.0));
    }
}

#[test]
fn a_ring_never_holds_more_force_than_the_one_before() {
    for force in [[0.0, 0.0, 1000.0], [300.0, 0.0, 0.0], [5.0, 5.0, 5.0]] {
        let params = RingParams { stiffness: 500.0, ..RingParams::default() };
        let solved = solve(&[pulled(vertex(10, 10), force, 9.0)], &[], &params).unwrap();
        let sums = &solved.ring_sums[0];
        assert_eq!(sums[0], 1.0);
        assert!(sums.len() > 2 && sums[1] > 0.0);
        assert!(sums.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-12)), "{sums:?}");
    }
    let literal = RingParams { literal: true, stiffness: 500.0, ..RingParams::default() };
    let solved = solve(&[pulled(vertex(10, 10), [0.0, 0.0, 5000.0], 9.0)], &[], &literal).unwrap();
    assert!(solved.ring_sums[0][1] > 1.5, "to the letter a ring gains force: {:?}", solved.ring_sums);
}

#[test]
fn a_pull_along_the_normal_spreads_by_the_angle_to_the_moved_target() {
    // The target's displacement by which angles are taken is F / K: 200 mN at 500 N/m is 0.4 mm.
    let params = RingParams { stiffness: 500.0, ..RingParams::default() };
    let lattice = sheet([0.0; 3]);
    let rest = lattice.local_positions();
    let edges = Edges::new(&lattice, &rest, |_| true);
    let rings = Rings::new(&edges, &rest, 10 + SIDE * 10, 9.0);
    let (shares, _) = rings.shares(&edges, &rest, Vector3::new(0.0, 0.0, 0.4), params.epsilon, true);
    let beside = shares.iter().find(|(v, _)| *v == 11 + SIDE * 10).unwrap().1;
    assert!((beside - 0.4 / 1.16_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn more_stiffness_is_less_motion_under_a_force() {
    let reach = |stiffness: f64| {
        let params = RingParams { stiffness, ..RingParams::default() };
        let solved = solve(&[pulled(vertex(10, 10), [0.0, 0.0, 100.0], 9.0)], &[], &params).unwrap();
        assert!(solved.residual < 0.05, "residual {} at {stiffness}", solved.residual);
        at(&solved, 10, 10).z
    };
    let depths: Vec<f64> = [10.0, 30.0, 50.0, 100.0, 1e3, 1e6, 1e12].map(reach).to_vec();
    assert!(depths.windows(2).all(|w| w[0] > w[1] && w[1] > 0.0), "{depths:?}");
    // The ground spring alone would let the target go F / K = 2 mm.
    assert!((1.0..2.2).contains(&depths[2]), "{depths:?}");
}

#[test]
fn mirrored_handles_give_mirrored_motion() {
    let params = RingParams::default();
    for [one, other] in [
        [moved(vertex(8, 9), [1.0, 0.5, 2.0], 6.0), moved(vertex(12, 9), [-1.0, 0.5, 2.0], 6.0)],
        [pulled(vertex(8, 9), [20.0, 5.0, 9.0], 6.0), pulled(vertex(12, 9), [-20.0, 5.0, 9.0], 6.0)],
    ] {
        let [a, b] = [one, other].map(|h| solve(&[h], &[], &params).unwrap());
        for y in 0..SIDE {
            for x in 0..SIDE {
                let (u, v) = (at(&a, x, y), at(&b, SIDE - 1 - x, y));
                assert!((u - Vector3::new(-v.x, v.y, v.z)).norm() < 1e-12, "{u} {v}");
            }
        }
    }
}

#[test]
fn a_far_origin_costs_no_digit() {
    let params = RingParams::default();
    let by = [0.3, 0.1, 2.0];
    let near =
        super::solve(&sheet([0.0; 3]), &[moved(vertex(7, 8), by, 6.0)], &[], &params, &Exec::default())
            .unwrap();
    let pick = Anchor::NearestTo([1e6 + 7.1, -1e6 + 7.9, 3e5 + 0.6]);
    let far = super::solve(&sheet([1e6, -1e6, 3e5]), &[moved(pick, by, 6.0)], &[], &params, &Exec::default())
        .unwrap();
    assert_eq!(displacement(&near), displacement(&far));
}

#[test]
fn fixed_vertices_stay_and_the_sheet_leads_up_to_them() {
    let fixed = [Pin { at: vertex(14, 10), radius: 1.5 }];
    let solved =
        solve(&[moved(vertex(10, 10), [0.0, 0.0, 3.0], 9.0)], &fixed, &RingParams::default()).unwrap();
    for (i, u) in displacement(&solved).iter().enumerate() {
        assert!(distance(i, 14.0, 10.0) > 1.5 || *u == [0.0; 3], "vertex {i}");
    }
    assert_eq!(at(&solved, 10, 10).z, 3.0);
    let profile: Vec<f64> = (10..14).map(|x| at(&solved, x, 10).z).collect();
    assert!(profile.windows(2).all(|w| w[0] > w[1]), "{profile:?}");
    let everything = [Pin { at: vertex(10, 10), radius: 100.0 }];
    for handle in [moved(vertex(10, 10), [1.0; 3], 9.0), pulled(vertex(3, 3), [9.0; 3], 9.0)] {
        assert_eq!(solve(&[handle], &everything, &RingParams::default()).unwrap().vertices_moved, 0);
    }
}

#[test]
fn several_handles_each_reach_their_own_move_without_adding_up() {
    let handles = [moved(vertex(8, 10), [0.0, 0.0, 2.0], 6.0), moved(vertex(11, 10), [0.0, 0.0, 2.0], 6.0)];
    let solved = solve(&handles, &[], &RingParams::default()).unwrap();
    assert_eq!((at(&solved, 8, 10).z, at(&solved, 11, 10).z), (2.0, 2.0));
    assert!(displacement(&solved).iter().all(|u| u[2] <= 2.0 + 1e-9));
    let opposing = [moved(vertex(8, 10), [0.0, 0.0, 2.0], 6.0), moved(vertex(9, 10), [0.0, 0.0, -2.0], 6.0)];
    let solved = solve(&opposing, &[], &RingParams::default()).unwrap();
    assert_eq!((at(&solved, 8, 10).z, at(&solved, 9, 10).z), (2.0, -2.0));
    let twice = [moved(vertex(8, 10), [1.0; 3], 6.0), moved(vertex(8, 10), [2.0; 3], 3.0)];
    let error = solve(&twice, &[], &RingParams::default()).unwrap_err();
    assert!(error.to_string().contains("vertex 218") && error.error_class() == ErrorClass::Usage, "{error}");
}

#[test]
fn islands_are_carried_and_isolated_vertices_and_coincident_ones_do_no_harm() {
    let whole = sheet([0.0; 3]);
    let cut = |t: &[u32; 3]| {
        t.iter().all(|v| *v as usize % SIDE < 10) || t.iter().all(|v| *v as usize % SIDE >= 12)
    };
    let triangles = whole.triangles().iter().copied().filter(cut).chain([[3, 3, 4]]);
    let lattice = whole.clone().with_triangles(triangles.collect()).unwrap();
    let alone = |h| super::solve(&lattice, &[h], &[], &RingParams::default(), &Exec::default()).unwrap();
    let solved = alone(moved(vertex(9, 10), [0.0, 0.0, 2.0], 8.0));
    // The island goes along as far as the taper says, and constrains nothing.
    for (x, y) in (0..SIDE).flat_map(|y| (10..SIDE).map(move |x| (x, y))) {
        let v = x + SIDE * y;
        let expected = 2.0 * super::rings::taper(distance(v, 9.0, 10.0) / 8.0);
        assert!((at(&solved, x, y).z - expected).abs() < 1e-12, "{x} {y}");
        assert_eq!(solved.motion.role(v), ivd_core::Role::Carried);
    }
    assert_eq!(solved.motion.role(8 + SIDE * 10), ivd_core::Role::Driven);
    let literal = RingParams { literal: true, ..RingParams::default() };
    let handle = moved(vertex(9, 10), [0.0, 0.0, 2.0], 8.0);
    let thesis = super::solve(&lattice, &[handle], &[], &literal, &Exec::default()).unwrap();
    assert!((0..SIDE).all(|y| (10..SIDE).all(|x| at(&thesis, x, y).norm() == 0.0)), "the island stays");
    assert!(at(&solved, 8, 10).z > 1.0);
    for handle in [moved(vertex(10, 5), [1.0; 3], 8.0), pulled(vertex(10, 5), [1.0; 3], 8.0)] {
        let solved = alone(handle);
        let driven = (0..SIDE * SIDE).filter(|v| solved.motion.role(*v) == ivd_core::Role::Driven);
        assert_eq!(driven.count(), 1, "an isolated vertex drives alone");
    }
    // Every vertex in one place: edges of no length.
    let point = on(&Grid::with_spacing([SIDE, SIDE, 2], [1e-12; 3]).unwrap());
    let solved = super::solve(
        &point,
        &[moved(vertex(9, 9), [0.0, 0.0, 1.0], 5.0)],
        &[],
        &RingParams::default(),
        &Exec::default(),
    );
    assert!(solved.is_ok());
}

#[test]
fn extremes_end_in_finite_motion_or_say_why_not() {
    for stiffness in [1e-6, 1.0, 1e12] {
        for dt in [None, Some(1e-9), Some(1e3)] {
            let params = RingParams { stiffness, dt, duration: 0.02, ..RingParams::default() };
            let solved = solve(&[moved(vertex(10, 10), [1.0, 2.0, 3.0], 4.0)], &[], &params).unwrap();
            assert_eq!(at(&solved, 10, 10), Vector3::new(1.0, 2.0, 3.0));
            assert!(solved.max_displacement_mm <= 14.0_f64.sqrt() * 1.001, "{}", solved.max_displacement_mm);
            assert!(solved.steps >= 32 && solved.steps <= 20_000);
            match solve(&[pulled(vertex(10, 10), [0.0, 0.0, 10.0], 4.0)], &[], &params) {
                Ok(_) => {}
                Err(error) => assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}"),
            }
        }
    }
    let error =
        solve(&[pulled(vertex(10, 10), [0.0, 0.0, 1e30], 4.0)], &[], &RingParams::default()).unwrap_err();
    assert!(
        error.error_class() == ErrorClass::Untrusted && error.to_string().contains("radius of 4 mm"),
        "{error}"
    );
    let huge = solve(&[moved(vertex(10, 10), [1e30, 0.0, 0.0], 4.0)], &[], &RingParams::default()).unwrap();
    assert_eq!(huge.max_displacement_mm, 1e30);
}

#[test]
fn lengths_scale_together() {
    let by = [0.5, 0.0, 2.0];
    let base = solve(&[moved(vertex(10, 10), by, 6.0)], &[], &RingParams::default()).unwrap();
    for scale in [1e-3, 1e3] {
        let lattice = on(&Grid::with_spacing([SIDE, SIDE, 2], [scale; 3]).unwrap());
        // Masses that scale with length squared must be kept for the same clock.
        let params = RingParams { density: 1e-3 / (scale * scale), ..RingParams::default() };
        let handle = moved(vertex(10, 10), by.map(|c| c * scale), 6.0 * scale);
        let solved = super::solve(&lattice, &[handle], &[], &params, &Exec::default()).unwrap();
        for (u, v) in displacement(&solved).iter().zip(displacement(&base)) {
            assert!((0..3).all(|a| (u[a] / scale - v[a]).abs() < 1e-9), "{u:?} {v:?}");
        }
    }
}

#[test]
fn picks_take_the_nearest_vertex_or_say_how_far_it_is() {
    let near = moved(Anchor::NearestTo([10.3, 9.8, 2.0]), [0.0, 0.0, 1.0], 4.0);
    let solved = solve(&[near], &[], &RingParams::default()).unwrap();
    assert_eq!(at(&solved, 10, 10).z, 1.0);
    let far = moved(Anchor::NearestTo([10.0, 10.0, 100.5]), [0.0, 0.0, 1.0], 4.0);
    let error = solve(&[far], &[], &RingParams::default()).unwrap_err();
    assert!(
        error.to_string().contains("100.000 mm away") && error.error_class() == ErrorClass::Usage,
        "{error}"
    );
    let beyond = moved(Anchor::Vertex(1_000_000), [0.0, 0.0, 1.0], 4.0);
    assert!(solve(&[beyond], &[], &RingParams::default()).unwrap_err().to_string().contains("441 vertices"));
}

#[test]
fn bad_parameters_name_their_field() {
    let field = |params: RingParams| params.check().unwrap_err().field;
    assert_eq!(field(RingParams { stiffness: 0.0, ..RingParams::default() }), "stiffness");
    assert_eq!(field(RingParams { duration: f64::NAN, ..RingParams::default() }), "duration");
    assert_eq!(field(RingParams { dt: Some(0.0), ..RingParams::default() }), "dt");
    assert_eq!(field(RingParams { epsilon: 2.0, ..RingParams::default() }), "epsilon");
    for (handle, name) in [
        (moved(vertex(1, 1), [f64::NAN, 0.0, 0.0], 1.0), "move"),
        (pulled(vertex(1, 1), [f64::INFINITY, 0.0, 0.0], 1.0), "force"),
        (moved(vertex(1, 1), [0.0; 3], 0.0), "radius"),
        (moved(Anchor::NearestTo([f64::NAN; 3]), [0.0; 3], 1.0), "pick"),
    ] {
        assert_eq!(handle.check().unwrap_err().field, name);
    }
    assert!(solve(&[], &[], &RingParams::default()).is_err());
}

#[test]
fn threads_do_not_change_a_byte_and_cancel_stops() {
    let handles = [moved(vertex(8, 10), [0.0, 1.0, 2.0], 9.0), pulled(vertex(13, 4), [9.0, 0.0, 3.0], 7.0)];
    let with = |threads| {
        let exec = Exec::default().with_threads(threads);
        super::solve(&sheet([0.0; 3]), &handles, &[], &RingParams::default(), &exec).unwrap()
    };
    assert_eq!(with(1), with(4));
    let stopped = Exec::default();
    stopped.cancel.cancel();
    let error = super::solve(&sheet([0.0; 3]), &handles, &[], &RingParams::default(), &stopped).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Cancelled);
}
