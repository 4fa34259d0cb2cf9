//! The matrix against dense ones, the descent against Newton's method, implicit steps against the analytic answer.

use nalgebra::{DMatrix, DVector, Matrix3};

use super::factor::Factor;
use super::forces::dot;
use super::metric::Metric;
use super::objective::{Objective, PutIn};
use super::projective::descend;
use super::spring::{Law, Spring};
use super::*;

fn statics() -> Params {
    Params {
        solver: Solver::Projective,
        closeness: Closeness { tolerance: 1e-9, max_iterations: 5000 },
        ..with_springs(Springs::default())
    }
}

/// A sheet that is pulled up beside its middle, its border held.
fn tent() -> (Lattice, Vec<Handle>, Params) {
    (sheet(11), vec![pulled(61, [1.0, -2.0, 6.0], 4.8)], statics())
}

fn drives(body: &Body, handles: &[Handle], params: &Params) -> Drives {
    let targets: Vec<usize> = handles
        .iter()
        .map(|handle| match handle.at {
            Anchor::Vertex(v) => v as usize,
            Anchor::NearestTo(_) => unreachable!("tests name vertices"),
        })
        .collect();
    Drives::new(body, handles, &targets, &vec![false; 10_000], &Skeleton::default(), params).unwrap()
}

/// The matrix itself, one component of the vectors.
fn dense(springs: &[Spring], extra: &[f64]) -> DMatrix<f64> {
    let n = extra.len();
    let mut matrix = DMatrix::from_diagonal(&DVector::from_column_slice(extra));
    for spring in springs {
        let [i, j] = spring.ends.map(|v| v as usize);
        for (a, b) in [(i, j), (j, i)] {
            if a < n {
                matrix[(a, a)] += spring.stiffness;
                if b < n {
                    matrix[(a, b)] -= spring.stiffness;
                }
            }
        }
    }
    matrix
}

#[test]
fn the_factor_solves_what_the_dense_matrix_does() {
    for side in [2, 5, 9, 14] {
        let handle = [moved(side + 1, [0.0; 3], 4.5 + side as f64 / 4.0)];
        let body = body(&sheet(side), &handle, &[pin(0)], &statics());
        let extra: Vec<f64> = (0..body.loose).map(|v| (v % 3) as f64 + 1e-3).collect();
        let b = noise(body.loose);
        let factor = Factor::new(&body.rest, &body.list, &extra);
        let found = factor.solve(&b, true);
        let bits = |of: &[[f64; 3]]| -> Vec<u64> { of.iter().flatten().map(|c| c.to_bits()).collect() };
        assert_eq!(bits(&found), bits(&factor.solve_any(&b)), "the processor's wider lanes change no bit");
        let exact = dense(&body.list, &extra).lu();
        for a in 0..3 {
            let column = DVector::from_iterator(b.len(), b.iter().map(|v| v[a]));
            let exact = exact.solve(&column).unwrap();
            for (x, y) in found.iter().zip(exact.iter()) {
                assert!((x[a] - y).abs() < 1e-9 * exact.amax(), "side {side}: {} {y}", x[a]);
            }
        }
    }
}

#[test]
fn dissection_fills_the_factor_with_little_more_than_n_log_n() {
    let entries = |side: usize| {
        let params =
            Params { springs: Springs { shear: 0.0, flexion: 0.0, ..statics().springs }, ..statics() };
        let body = body(&sheet(side), &[moved(side + 1, [0.0; 3], 1e3)], &[], &params);
        let factor = Factor::new(&body.rest, &body.list, &vec![1.0; body.loose]);
        factor.entries() as f64 / (body.loose as f64 * (body.loose as f64).log2())
    };
    let [small, large] = [24, 96].map(entries);
    assert!(large < 3.0 && large < 1.3 * small, "{small} {large}");
}

#[test]
fn the_other_lip_is_not_gripped() {
    // A sheet folded into two, 1 mm apart.
    let (side, layer) = (9, 81);
    let grid = Grid::with_spacing([side, side, 3], [1.0; 3]).unwrap();
    let key = |i: usize| {
        let at = [i % side + 1, i / side % side + 1, i / layer + 1];
        ElementKey::new([side, side, 3], at, 2)
    };
    let mut triangles = Vec::new();
    for y in 0..side - 1 {
        let at = |x: usize, y: usize, z: usize| (x + side * y + layer * z) as u32;
        for (x, z) in (0..side - 1).flat_map(|x| [(x, 0), (x, 1)]) {
            let [a, b, c, d] = [at(x, y, z), at(x + 1, y, z), at(x + 1, y + 1, z), at(x, y + 1, z)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        let [a, b, c, d] = [at(0, y, 0), at(0, y + 1, 0), at(0, y + 1, 1), at(0, y, 1)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    let (keys, places) = ((0..2 * layer).map(key).collect(), vec![[0.0, 0.0, 0.5]; 2 * layer]);
    let lips = Lattice::new(grid, keys, places.into(), triangles.into()).unwrap();
    let lips = lips.with_source(LatticeSource::Mask);
    let handle = [moved(40, [0.0, 0.0, -0.2], 6.0)];
    let body = body(&lips, &handle, &[], &statics());
    assert!(body.loose_vertex(40 + layer).is_some(), "the fold joins them within the radius");
    let gripped = |grip| {
        let params = Params { springs: Springs { grip, ..statics().springs }, ..statics() };
        let moved = drives(&body, &handle, &params).moved;
        moved.iter().map(|(v, ..)| body.vertices[*v]).collect::<Vec<_>>()
    };
    assert_eq!(gripped(Some(1.2)), [31, 39, 40, 41, 49], "the other lip is as near");
    assert_eq!(gripped(None), [30, 31, 32, 39, 40, 41, 48, 49, 50]);
    assert!(gripped(Some(4.5)).contains(&(40 + layer as u32)), "the fold lies in this grip");
}

#[test]
fn handles_are_taken_out_of_the_matrix_as_if_it_had_been_made_without_them() {
    let lattice = sheet(9);
    for (handles, fixed, grip) in [
        (vec![moved(40, [0.1; 3], 3.5), moved(42, [0.2; 3], 3.5)], vec![], 1.1),
        // Held by the handles alone: the diagonal's help is taken out to its square root's digits.
        (vec![moved(40, [0.1; 3], 50.0)], vec![], 1.1),
        // So many that they are pinned instead.
        (vec![moved(40, [0.1, -0.2, 0.3], 4.1)], vec![], 2.95),
    ] {
        let params = Params { springs: Springs { grip: Some(grip), ..statics().springs }, ..statics() };
        let body = body(&lattice, &handles, &fixed, &params);
        let drives = drives(&body, &handles, &params);
        let mut metric = Metric::new(&body, &[]);
        metric.hold(&body, &drives);
        let mut b = noise(body.loose);
        for &(v, ..) in &drives.moved {
            b[v] = [0.0; 3];
        }
        let found = metric.apply(&b);
        let free: Vec<usize> = (0..body.loose).filter(|v| !drives.is_moved[*v]).collect();
        let whole = dense(&body.list, &vec![0.0; body.loose]);
        let part = DMatrix::from_fn(free.len(), free.len(), |i, j| whole[(free[i], free[j])]).lu();
        for a in 0..3 {
            let exact =
                part.solve(&DVector::from_iterator(free.len(), free.iter().map(|v| b[*v][a]))).unwrap();
            for (v, y) in free.iter().zip(exact.iter()) {
                let error = (found[*v][a] - y).abs() / exact.amax();
                assert!(error < if body.loose == 81 { 1e-4 } else { 1e-10 }, "{error}");
            }
        }
        assert!(drives.moved.iter().all(|(v, ..)| found[*v] == [0.0; 3]));
        assert_eq!(drives.moved.len() > 24, grip > 2.0, "{} are moved", drives.moved.len());
        let by: Vec<[f64; 3]> = drives.moved.iter().map(|(_, by, _)| *by).collect();
        let extended = metric.extend(&by, body.loose);
        for a in 0..3 {
            let pull = DVector::from_iterator(
                free.len(),
                free.iter()
                    .map(|&v| -drives.moved.iter().map(|&(m, by, _)| whole[(v, m)] * by[a]).sum::<f64>()),
            );
            let exact = part.solve(&pull).unwrap();
            for (v, y) in free.iter().zip(exact.iter()) {
                let error = (extended[*v][a] - y).abs() / 0.3;
                assert!(error < if body.loose == 81 { 1e-4 } else { 1e-8 }, "{error}");
            }
        }
    }
}

/// Newton's method with dense matrices: a step that the whole Hessian gives, shortened until the gradient is less.
fn newton(body: &Body, drives: &Drives) -> Vec<[f64; 3]> {
    let objective = Objective { body, drives, reached: 1.0, inertia: None };
    let mut moved = vec![[0.0; 3]; body.vertices.len()];
    drives.place(&mut moved, 1.0);
    let mut gradient = vec![[0.0; 3]; body.loose];
    for _ in 0..500 {
        let relative = objective.gradient(&moved, &mut gradient, &mut PutIn::default());
        if relative < 1e-13 {
            return moved;
        }
        let mut hessian = DMatrix::zeros(3 * body.loose, 3 * body.loose);
        let mut most = 0.0_f64;
        for spring in &body.list {
            let [i, j] = spring.ends.map(|v| v as usize);
            let at = |v: usize| Vector3::from(body.rest[v]) + Vector3::from(moved[v]);
            let (length, n) = ((at(j) - at(i)).norm(), (at(j) - at(i)).normalize());
            most = most.max(spring.stiffness);
            if length <= spring.length && !body.springs.law().push {
                continue;
            }
            let along = n * n.transpose();
            // Across a pushed spring the curvature is negative; left out, the way is still one down.
            let across = (1.0 - spring.length / length).max(0.0);
            let block: Matrix3<f64> = (along + (Matrix3::identity() - along) * across) * spring.stiffness;
            for (a, b, sign) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
                if a < body.loose && b < body.loose {
                    let mut view = hessian.view_mut((3 * a, 3 * b), (3, 3));
                    view += block * sign;
                }
            }
        }
        // What is flat has no curvature at all at first.
        let soften = most * relative.min(1.0) * 1e-2 + most * 1e-12;
        for k in 0..3 * body.loose {
            hessian[(k, k)] += soften;
        }
        for v in (0..body.loose).filter(|v| drives.is_moved[*v]) {
            for k in 3 * v..3 * v + 3 {
                hessian.row_mut(k).fill(0.0);
                hessian.column_mut(k).fill(0.0);
                hessian[(k, k)] = 1.0;
            }
        }
        let right = DVector::from_iterator(3 * body.loose, gradient.iter().flatten().map(|g| -g));
        let step = hessian.lu().solve(&right).unwrap();
        let mut way = vec![[0.0; 3]; moved.len()];
        for v in 0..body.loose {
            way[v] = [step[3 * v], step[3 * v + 1], step[3 * v + 2]];
        }
        let slope = dot(&gradient, &way[..body.loose]);
        while objective.growth(&moved, &way) > 1e-4 * slope && way.iter().flatten().any(|c| c.abs() > 1e-300)
        {
            for w in &mut way {
                *w = w.map(|c| c * 0.5);
            }
        }
        for (u, w) in moved.iter_mut().zip(&way) {
            *u = std::array::from_fn(|a| u[a] + w[a]);
        }
    }
    let relative = objective.gradient(&moved, &mut gradient, &mut PutIn::default());
    assert!(relative < 1e-10, "the twin ended at {relative}");
    moved
}

#[test]
fn the_descent_ends_where_newtons_method_does() {
    let (lattice, pull, params) = tent();
    let handles = [pull, vec![moved(61, [0.3, -0.4, 2.0], 4.8)]];
    for handles in handles {
        // Springs that only pull, and are stretched, have one balance; those that push may buckle on the way to theirs.
        let params =
            Params { springs: Springs { push: Some(false), ..params.springs.clone() }, ..params.clone() };
        let solved = run(&lattice, &handles, &[], &params).unwrap();
        assert!(solved.residual <= 1e-8, "{} after {}", solved.residual, solved.iterations);
        let body = body(&lattice, &handles, &[], &params);
        let exact = newton(&body, &drives(&body, &handles, &params));
        let far = exact.iter().flatten().fold(0.0_f64, |far, c| far.max(c.abs()));
        for (&v, exact) in body.vertices.iter().zip(&exact) {
            let error = (Vector3::from(last(&solved)[v as usize]) - Vector3::from(*exact)).norm();
            assert!(error < 1e-5 * far, "vertex {v}: {error} of {far}");
        }
    }
}

#[test]
fn springs_push_for_forces_and_not_for_moves_and_a_kept_body_knows_which() {
    let (lattice, pull, params) = tent();
    let shift = vec![moved(61, [1.0, 0.4, 0.5], 4.8)];
    let with = |push| Params { springs: Springs { push, ..params.springs.clone() }, ..params.clone() };
    let found = |push, handles: &[Handle]| run(&lattice, handles, &[], &with(push)).unwrap().motion;
    assert_eq!(found(None, &shift), found(Some(false), &shift));
    assert_ne!(found(None, &shift), found(Some(true), &shift));
    assert_eq!(found(None, &pull), found(Some(true), &pull));
    let exec = Exec::default();
    let mut kept = Prepared::new(&lattice, None, &shift, &[], &with(None), &exec).unwrap();
    for handles in [&shift, &pull, &shift] {
        kept.forget();
        assert_eq!(kept.update(handles, &exec).unwrap().motion, found(None, handles));
    }
}

#[test]
fn no_iteration_raises_the_objective_and_memory_saves_iterations() {
    let (lattice, handles, params) = tent();
    let body = body(&lattice, &handles, &[], &params);
    let drives = drives(&body, &handles, &params);
    let metric = Metric::new(&body, &[]);
    let objective = Objective { body: &body, drives: &drives, reached: 1.0, inertia: None };
    for history in [0, 8] {
        let rest = vec![[0.0; 3]; body.vertices.len()];
        let after = |iterations: usize| {
            let params = Params {
                closeness: Closeness { max_iterations: iterations, ..params.closeness },
                descent: Descent { history, ..params.descent },
                ..params.clone()
            };
            let mut moved = rest.clone();
            descend(&objective, &metric, &mut moved, &params, &Exec::default()).unwrap();
            objective.growth(&rest, &moved)
        };
        let values: Vec<f64> = (1..60).map(after).collect();
        assert!(values.windows(2).all(|w| w[1] <= w[0]) && values[0] < 0.0, "{values:?}");
    }
    let needed = |history| {
        let params = Params {
            closeness: Closeness { tolerance: 1e-3, ..params.closeness },
            descent: Descent { history, ..params.descent },
            ..params.clone()
        };
        let mut moved = vec![[0.0; 3]; body.vertices.len()];
        descend(&objective, &metric, &mut moved, &params, &Exec::default()).unwrap().0
    };
    assert!(needed(8) < needed(0), "{} {}", needed(8), needed(0));
}

#[test]
fn statics_of_two_masses_and_of_a_chain_are_analytic() {
    let params = Params {
        springs: Springs { stiffness: 2.0, ..statics().springs },
        closeness: Closeness { tolerance: 1e-12, ..statics().closeness },
        ..statics()
    };
    let two = run(&rod(2), &[pulled(1, [0.5, 0.0, 0.0], 5.0)], &[pin(0)], &params).unwrap();
    assert!((last(&two)[1][0] - 0.25).abs() < 1e-13, "{:?}", last(&two));
    let chain = run(&rod(11), &[pulled(3, [0.5, 0.0, 0.0], 50.0)], &[pin(0), pin(10)], &params).unwrap();
    let peak = 0.25 * 3.0 * 7.0 / 10.0;
    for (i, u) in last(&chain).iter().enumerate() {
        let exact = peak * (i as f64 / 3.0).min((10 - i) as f64 / 7.0);
        assert!((u[0] - exact).abs() < 1e-11, "joint {i}: {u:?} for {exact}");
    }
    let held = run(&rod(11), &[moved(3, [peak, 0.0, 0.0], 50.0)], &[pin(0), pin(10)], &params).unwrap();
    assert!((held.handle_forces_mn[0][0] - 0.5).abs() < 1e-10);
}

#[test]
fn stiffness_lessens_motion_under_a_force_and_cancels_under_a_motion() {
    let lattice = sheet(11);
    let height = |stiffness, handle| {
        let params =
            Params { springs: Springs { stiffness, push: Some(false), ..statics().springs }, ..statics() };
        let solved = run(&lattice, &[handle], &[], &params).unwrap();
        assert!(solved.residual < 1e-8, "{} at {stiffness}", solved.residual);
        last(&solved).to_vec()
    };
    let all = [1.0, 10.0, 100.0, 1e4];
    let pull = pulled(60, [0.0, 0.0, 3.0], 4.8);
    let heights = all.map(|k| height(k, pull)[60][2]);
    assert!(heights.windows(2).all(|w| w[1] < w[0] && w[1] > 0.0), "{heights:?}");
    let push = moved(60, [0.2, 0.1, 1.5], 4.8);
    let [soft, stiff] = [1.0, 1e8].map(|k| height(k, push));
    for (a, b) in soft.iter().zip(&stiff) {
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-6), "{a:?} {b:?}");
    }
}

#[test]
fn implicit_steps_err_by_their_length_and_both_solvers_take_the_same() {
    let at_end = |solver, steps: f64| {
        let params = Params {
            solver,
            springs: Springs {
                stiffness: 1.0,
                vertex_mass: Some(1.0),
                drag: 3.0,
                duration: 0.2,
                dt: Some(0.2 / steps),
                ramp: Some(0.0),
                ..Springs::default()
            },
            closeness: Closeness { tolerance: 1e-10, ..Closeness::default() },
            descent: Descent { inertia: solver == Solver::Projective, ..Descent::default() },
        };
        let solved = run(&rod(2), &[pulled(1, [0.1, 0.0, 0.0], 5.0)], &[pin(0)], &params).unwrap();
        assert_eq!(solved.steps as f64, steps);
        last(&solved)[1][0]
    };
    // u'' + γ u' + ω² u = F/m, from rest.
    let (omega, half) = (1000.0_f64, 1.5_f64);
    let swing = (omega - half * half).sqrt();
    let exact =
        0.1 * (1.0 - (-half * 0.2_f64).exp() * ((swing * 0.2).cos() + half / swing * (swing * 0.2).sin()));
    for solver in [Solver::Projective, Solver::Xpbd] {
        let errors = [400.0, 800.0, 1600.0, 3200.0].map(|steps| (at_end(solver, steps) - exact).abs());
        assert!(errors.windows(2).all(|w| (1.8..2.2).contains(&(w[0] / w[1]))), "{solver:?}: {errors:?}");
    }
    assert!((at_end(Solver::Projective, 100.0) - at_end(Solver::Xpbd, 100.0)).abs() < 1e-9);
}

#[test]
fn a_sheet_in_motion_is_much_the_same_by_both_implicit_solvers() {
    let params = |solver| Params {
        solver,
        springs: Springs {
            duration: 0.02,
            dt: Some(1e-3),
            stiffness: 0.5,
            ground: 0.1,
            strain_limit: Some(0.2),
            ..Springs::default()
        },
        closeness: Closeness { tolerance: 1e-6, ..Closeness::default() },
        descent: Descent { inertia: solver == Solver::Projective, ..Descent::default() },
    };
    let handles = [moved(60, [0.0, 0.3, 1.0], 4.5), pulled(63, [0.1, 0.0, 0.2], 4.5)];
    let [a, b] =
        [Solver::Projective, Solver::Xpbd].map(|s| run(&sheet(11), &handles, &[], &params(s)).unwrap());
    assert!(a.residual <= 1e-6 && b.residual.is_finite(), "{} {}", a.residual, b.residual);
    for (u, w) in last(&a).iter().zip(last(&b)) {
        assert!((0..3).all(|c| (u[c] - w[c]).abs() < 0.1), "{u:?} {w:?}");
    }
}

#[test]
fn what_is_pulled_against_nothing_has_no_balance_and_what_is_moved_goes_as_it_is() {
    let error = run(&sheet(9), &[pulled(40, [0.0, 0.0, 1.0], 50.0)], &[], &statics()).unwrap_err();
    assert!(error.to_string().contains("nothing holds"), "{error}");
    let whole = run(&sheet(9), &[moved(40, [0.5, 0.0, 1.0], 50.0)], &[], &statics()).unwrap();
    for u in last(&whole) {
        assert!((0..3).all(|a| (u[a] - [0.5, 0.0, 1.0][a]).abs() < 1e-4), "{u:?}");
    }
}

#[test]
fn a_handle_that_goes_on_ends_where_it_would_have_gone_at_once() {
    let lattice = sheet(13);
    let params = Params { springs: Springs { push: Some(false), ..statics().springs }, ..statics() };
    let by = |z: f64| moved(84, [0.1 * z, 0.0, z], 5.5);
    let mut prepared = Prepared::new(&lattice, None, &[by(0.0)], &[], &params, &Exec::default()).unwrap();
    let mut iterations = 0;
    for z in [0.5, 1.0, 1.5, 2.0] {
        iterations = prepared.update(&[by(z)], &Exec::default()).unwrap().iterations;
    }
    let there = prepared.update(&[by(2.0)], &Exec::default()).unwrap();
    assert_eq!(there.iterations, 0, "it is there, after {iterations} more");
    let at_once = run(&lattice, &[by(2.0)], &[], &params).unwrap();
    for (u, w) in last(&there).iter().zip(last(&at_once)) {
        assert!((0..3).all(|a| (u[a] - w[a]).abs() < 1e-5), "{u:?} {w:?}");
    }
}

#[test]
fn a_law_without_a_limit_has_no_stiffness_beyond_it() {
    let law = Law { push: true, limit: None };
    let spring = Spring { ends: [0, 1], length: 1.0, stiffness: 2.0 };
    let rest = [[0.0; 3], [1.0, 0.0, 0.0]];
    let pulled = forces::pull(&spring, law, &rest, &[[0.0; 3], [9.0, 0.0, 0.0]]);
    assert_eq!(pulled, Vector3::new(18.0, 0.0, 0.0));
}

#[test]
fn a_pulled_body_that_nothing_holds_gains_force_times_time_by_implicit_steps_too() {
    let lattice = sheet(9);
    let mass = body(&lattice, &[pulled(40, [0.0; 3], 100.0)], &[], &Params::default()).mass;
    for (solver, steps) in [(Solver::Projective, 20), (Solver::Projective, 100), (Solver::Xpbd, 100)] {
        let params = Params {
            solver,
            springs: Springs {
                stiffness: 1000.0,
                drag: 0.0,
                duration: 0.01,
                dt: Some(0.01 / steps as f64),
                ramp: Some(0.0),
                frames: steps,
                ..Springs::default()
            },
            closeness: Closeness { tolerance: 1e-12, max_iterations: 3000 },
            descent: Descent { inertia: solver == Solver::Projective, ..Descent::default() },
        };
        let solved = run(&lattice, &[pulled(40, [3.0, 0.0, 1.0], 100.0)], &[], &params).unwrap();
        assert_eq!(solved.steps, steps);
        let frames = solved.motion.frames();
        for pair in frames.windows(2) {
            let went =
                |v: usize| Vector3::from(pair[1].displacement[v]) - Vector3::from(pair[0].displacement[v]);
            let momentum: Vector3<f64> = (0..81).map(|v| went(v) * (mass[v] / solved.dt)).sum();
            let expected = Vector3::new(3e3, 0.0, 1e3) * pair[1].time;
            let apart = (momentum - expected).norm() / expected.norm();
            assert!(apart < 1e-8, "{solver:?}, {steps} steps, after {} s: {apart:e}", pair[1].time);
        }
    }
}
