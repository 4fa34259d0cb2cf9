//! What holds for every solver, and what must not break one.

use super::*;
use ivd_core::{Classified, ErrorClass, Role};

/// Every solver as it is by default, with a motion that is quick to find.
fn solvers() -> Vec<Params> {
    let params = with_springs(Springs { duration: 0.02, ..Springs::default() });
    let projective = Params {
        solver: Solver::Projective,
        closeness: Closeness { tolerance: 1e-6, ..params.closeness },
        ..params.clone()
    };
    vec![
        params.clone(),
        projective.clone(),
        Params {
            springs: Springs { dt: Some(2e-3), ..projective.springs },
            descent: Descent { inertia: true, ..projective.descent },
            ..projective
        },
        Params { solver: Solver::Xpbd, springs: Springs { dt: Some(2e-3), ..params.springs }, ..params },
    ]
}

#[test]
fn no_motion_and_no_force_leave_every_bit() {
    for params in solvers() {
        for handle in [moved(40, [0.0, -0.0, 0.0], 3.0), pulled(40, [-0.0; 3], 3.0)] {
            let solved = run(&sheet(9), &[handle], &[], &params).unwrap();
            assert!(last(&solved).iter().flatten().all(|c| c.to_bits() == 0), "{params:?}");
            assert_eq!((solved.vertices_moved, solved.residual, solved.energy_last), (0, 0.0, 0.0));
            assert_eq!((solved.truncation, solved.truncation_mn), (0.0, 0.0));
        }
    }
}

#[test]
fn beyond_the_radius_nothing_moves_and_a_moved_target_is_where_it_was_sent() {
    for params in solvers() {
        let solved = run(&sheet(21), &[moved(220, [0.3, -0.2, 1.0], 5.5)], &[], &params).unwrap();
        assert_eq!(last(&solved)[220], [0.3, -0.2, 1.0]);
        for (i, u) in last(&solved).iter().enumerate() {
            let distance = ((i % 21) as f64 - 10.0).hypot((i / 21) as f64 - 10.0);
            assert!(distance < 5.5 || *u == [0.0; 3], "vertex {i}");
        }
        assert!(solved.vertices_moved > 80 && solved.vertices_moved <= solved.vertices_loose);
    }
}

#[test]
fn mirrored_handles_give_mirrored_motion() {
    for params in solvers() {
        // A sweep over springs has an order.
        if params.solver == Solver::Xpbd {
            continue;
        }
        let params = Params {
            springs: Springs { push: Some(false), ..params.springs },
            closeness: Closeness { tolerance: 1e-10, max_iterations: 20_000 },
            ..params
        };
        let close = if params.solver == Solver::Dynamics { 1e-12 } else { 1e-6 };
        let lattice = sheet(12);
        let mirror = |v: u32| v / 12 * 12 + 11 - v % 12;
        let turned = lattice.triangles().iter().map(|t| [t[0], t[2], t[1]].map(mirror));
        let mirrored = lattice.clone().with_triangles(turned.collect()).unwrap();
        for (one, other) in [
            (moved(3 + 12 * 5, [0.2, 0.1, 0.7], 4.0), moved(8 + 12 * 5, [-0.2, 0.1, 0.7], 4.0)),
            (pulled(3 + 12 * 5, [2.0, 1.0, 1.0], 4.0), pulled(8 + 12 * 5, [-2.0, 1.0, 1.0], 4.0)),
        ] {
            let left = run(&lattice, &[one], &[], &params).unwrap();
            let right = run(&mirrored, &[other], &[], &params).unwrap();
            for v in 0..144 {
                let (u, w) = (last(&left)[v as usize], last(&right)[mirror(v) as usize]);
                let apart = (0..3).map(|a| (if a == 0 { u[a] + w[a] } else { u[a] - w[a] }).abs());
                let apart = apart.fold(0.0, f64::max);
                assert!(apart < close, "{:?}, vertex {v}: {u:?} {w:?}", params.solver);
            }
        }
    }
}

#[test]
fn fixed_vertices_stay_islands_go_along_and_isolated_vertices_drive_alone() {
    for params in solvers() {
        let whole = sheet(11);
        let apart = |t: &[u32; 3]| t.iter().all(|v| v % 11 < 5) || t.iter().all(|v| v % 11 > 5);
        let triangles = whole.triangles().iter().copied().filter(apart).chain([[3, 3, 4]]);
        let lattice = whole.clone().with_triangles(triangles.collect()).unwrap();
        let all = Pin { at: Anchor::Vertex(60), radius: 100.0 };
        for handle in [moved(58, [0.5; 3], 20.0), pulled(58, [1.0; 3], 20.0)] {
            let solved = run(&lattice, &[handle], &[all], &params).unwrap();
            assert_eq!((solved.vertices_moved, solved.vertices_loose), (0, 0));
        }
        let fix = Pin { at: Anchor::Vertex(55), radius: 1.5 };
        let solved = run(&lattice, &[moved(59, [0.0, 0.0, 0.5], 20.0)], &[fix], &params).unwrap();
        for v in [55, 56, 44, 66, 45, 67] {
            assert_eq!(last(&solved)[v], [0.0; 3], "vertex {v}");
        }
        for v in (0..121).filter(|v| v % 11 >= 5) {
            let beside = v / 11 * 11 + 4;
            assert_eq!(last(&solved)[v], last(&solved)[beside], "vertex {v} of the island");
            assert_eq!(solved.motion.role(v), Role::Carried);
        }
        assert!(last(&solved)[58][2] > 0.0);
        let alone = run(&lattice, &[moved(60, [0.5; 3], 20.0)], &[], &params).unwrap();
        assert_eq!((alone.vertices_loose, last(&alone)[60]), (1, [0.5; 3]));
        assert_eq!((0..121).filter(|v| alone.motion.role(*v) == Role::Driven).count(), 1);
    }
}

#[test]
fn handles_on_one_vertex_agree_or_are_refused() {
    for params in solvers() {
        let pull = pulled(40, [0.0, 0.0, 0.5], 3.0);
        let once = run(&sheet(9), &[pull], &[pin(0)], &params).unwrap();
        let twice = run(&sheet(9), &[pull, pull], &[pin(0)], &params).unwrap();
        assert_eq!(last(&once), last(&twice));
        assert_eq!(once.truncation, twice.truncation);
        let error = run(&sheet(9), &[pull, moved(40, [0.0; 3], 3.0)], &[], &params).unwrap_err();
        assert!(error.error_class() == ErrorClass::Usage && error.to_string().contains("vertex 40"));
        let both = [moved(39, [0.0, 0.0, 0.3], 3.0), moved(41, [0.0, 0.0, -0.3], 3.0)];
        let solved = run(&sheet(9), &both, &[], &params).unwrap();
        assert_eq!((last(&solved)[39][2], last(&solved)[41][2]), (0.3, -0.3));
    }
}

#[test]
fn a_grip_moves_a_patch_and_shares_a_force() {
    for params in solvers() {
        let params = Params { springs: Springs { grip: Some(1.2), ..params.springs }, ..params };
        let solved = run(&sheet(11), &[moved(60, [0.1, 0.2, 0.6], 4.5)], &[], &params).unwrap();
        for v in [60, 59, 61, 49, 71] {
            assert_eq!(last(&solved)[v], [0.1, 0.2, 0.6]);
        }
        let pull = run(&sheet(11), &[pulled(60, [0.0, 0.0, 0.5], 4.5)], &[], &params).unwrap();
        let [_, _, z] = pull.handle_forces_mn[0];
        assert!((z - 0.5).abs() < 1e-12);
    }
}

#[test]
fn a_handle_grips_a_tenth_of_its_radius_and_its_neighbours() {
    for params in solvers() {
        let by = [0.05, 0.0, 0.1];
        let goes = |radius: f64, grip| {
            let params = Params { springs: Springs { grip, ..params.springs.clone() }, ..params.clone() };
            let solved = run(&sheet(25), &[moved(312, by, radius)], &[], &params).unwrap();
            last(&solved).iter().filter(|u| **u == by).count()
        };
        // Of a sheet whose squares are 1 mm wide and halved: the vertices across a square at least, but not of a handle that
        // reaches them hardly.
        assert_eq!([goes(10.0, None), goes(4.8, None), goes(3.0, None)], [9, 9, 1]);
        assert_eq!([goes(11.9, Some(2.01)), goes(11.9, Some(0.0))], [13, 1]);
        assert_eq!(goes(20.1, None), 13, "two squares away");
        // A force is shared with the neighbours, and none of it is lost beside a handle that moves.
        let params = Params { springs: Springs { grip: None, ..params.springs.clone() }, ..params.clone() };
        let handles = [moved(312, by, 10.0), pulled(313, [0.0, 0.0, 0.5], 10.0)];
        let body = body(&sheet(25), &handles, &[], &params);
        let targets = [312, 313];
        let drives = Drives::new(&body, &handles, &targets, &[false; 625], &Skeleton::default(), &params);
        let drives = drives.unwrap();
        let [x, y, z] = drives.force.iter().fold([0.0; 3], |sum, f| [0, 1, 2].map(|a| sum[a] + f[a]));
        assert!(x == 0.0 && y == 0.0 && (z - 500.0).abs() < 1e-9, "{z} µN");
        let shares = drives.force.iter().filter(|f| f[2] > 1.0).count();
        assert!(shares > 2 && !drives.is_moved[body.loose_vertex(313).unwrap()], "{shares}");
    }
}

#[test]
fn ground_springs_take_what_a_small_reach_would_cut_off() {
    for params in solvers() {
        let params = Params {
            springs: Springs { ground: 1.0, duration: 0.2, ramp: Some(0.05), drag: 500.0, ..params.springs },
            closeness: Closeness { max_iterations: 100, ..params.closeness },
            ..params
        };
        let cut = |radius| run(&sheet(25), &[moved(312, [0.2, 0.0, 0.3], radius)], &[], &params).unwrap();
        let parts: Vec<f64> = [3.5, 6.5, 9.5, 11.5].map(|r| cut(r).truncation).to_vec();
        assert!(parts.windows(2).all(|w| w[1] < w[0]), "{parts:?}");
        assert!(parts[3] < 0.05, "{parts:?}");
        assert_eq!(cut(100.0).truncation, 0.0);
    }
}

#[test]
fn a_strain_limit_holds_springs_together() {
    for params in solvers() {
        let params = Params {
            springs: Springs { duration: 0.2, ramp: Some(0.05), drag: 500.0, ..params.springs },
            ..params
        };
        let longest = |limit| {
            let params = Params {
                springs: Springs { strain_limit: limit, ..params.springs.clone() },
                ..params.clone()
            };
            let solved = run(&rod(6), &[pulled(5, [20.0, 0.0, 0.0], 50.0)], &[pin(0)], &params).unwrap();
            let x: Vec<f64> = last(&solved).iter().map(|u| u[0]).collect();
            x.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max)
        };
        // 20 mN on 50 N/m strains by 0.4; beyond 0.1 the rest is a hundred times as stiff: 0.1 + (20 − 5) / 5050.
        assert!((longest(None) - 0.4).abs() < 1e-3);
        assert!((longest(Some(0.1)) - (0.1 + 15.0 / 5050.0)).abs() < 1e-4, "{}", longest(Some(0.1)));
    }
}

#[test]
fn extremes_end_in_finite_motion_or_say_why_not() {
    let mut right = 0;
    for params in solvers() {
        for stiffness in [1e-6, 1.0, 1e6, 1e12] {
            for dt in [None, Some(1e-9), Some(1e-3), Some(1e3)] {
                for force in [0.0, 1e-30, 1.0, 1e30] {
                    let params = Params {
                        springs: Springs { stiffness, dt, ..params.springs.clone() },
                        closeness: Closeness { max_iterations: 30, ..params.closeness },
                        ..params.clone()
                    };
                    for handle in
                        [pulled(40, [force, 0.0, force], 3.5), moved(40, [force.min(1e3), 0.0, force], 3.5)]
                    {
                        match run(&sheet(9), &[handle], &[], &params) {
                            Ok(solved) => {
                                right += 1;
                                assert!(solved.energy_last.is_finite());
                                assert!(solved.residual.is_finite() && solved.truncation.is_finite());
                            }
                            Err(error) => {
                                let text = error.to_string();
                                assert_eq!(error.error_class(), ErrorClass::Untrusted, "{text}");
                            }
                        }
                    }
                }
            }
        }
    }
    assert!(right > 0);
}

#[test]
fn mixed_stiffness_and_edges_of_no_length_end_well() {
    for params in solvers() {
        let whole = sheet(9);
        let (keys, mut places, triangles) = whole.clone().into_parts();
        // Two vertices in one place: the places lie on one voxel, 1 mm further by key and by place.
        places.make_mut()[40][0] = 1.0;
        let lattice = Lattice::new(whole.grid().clone(), keys, places, triangles).unwrap();
        let labels = ivd_core::Labels::new(
            lattice.grid().clone(),
            (0..162).map(|i| u16::from(i % 9 > 4) + 1).collect::<Vec<u16>>().into(),
            Vec::new(),
        )
        .unwrap();
        let stiff = Material { stiffness: Some(5e4), ..Material::default() };
        for modulus in [None, Some(10.0)] {
            let params = Params {
                springs: Springs {
                    material: [(2, stiff)].into(),
                    stiffness: 0.05,
                    youngs_kpa: modulus,
                    ..params.springs.clone()
                },
                ..params.clone()
            };
            for handle in [moved(40, [0.0, 0.0, 0.5], 3.5), pulled(42, [0.1, 0.0, 0.1], 3.5)] {
                let solved =
                    solve(&lattice, Some(&labels), &[handle], &[], &params, &Exec::default()).unwrap();
                assert!(solved.vertices_moved > 0, "{handle:?} {solved:?}");
            }
        }
    }
}

#[test]
fn a_handle_outside_and_bad_parameters_are_named() {
    let far = Handle { at: Anchor::NearestTo([4.0, 4.0, 99.0]), ..moved(0, [0.0; 3], 3.0) };
    let error = run(&sheet(9), &[far], &[], &Params::default()).unwrap_err();
    assert!(error.error_class() == ErrorClass::Usage && error.to_string().contains("mm away"), "{error}");
    assert!(run(&sheet(9), &[], &[], &Params::default()).is_err());
    let field = |params: Params| params.check().unwrap_err().field;
    assert_eq!(field(with_springs(Springs { stiffness: 0.0, ..Springs::default() })), "stiffness");
    assert_eq!(field(with_springs(Springs { youngs_kpa: Some(-1.0), ..Springs::default() })), "youngs_kpa");
    assert_eq!(field(with_springs(Springs { drag: f64::NAN, ..Springs::default() })), "drag");
    assert_eq!(field(with_springs(Springs { frames: 0, ..Springs::default() })), "frames");
    assert_eq!(
        field(with_springs(Springs { strain_limit: Some(-0.1), ..Springs::default() })),
        "strain_limit"
    );
    let both = Material { stiffness: Some(1.0), youngs_kpa: Some(1.0), ..Material::default() };
    assert_eq!(
        field(with_springs(Springs { material: [(3, both)].into(), ..Springs::default() })),
        "material.3.stiffness"
    );
}

#[test]
fn a_prepared_body_takes_handles_inside_its_reach_and_no_others() {
    for params in solvers() {
        let lattice = sheet(15);
        let first = [moved(112, [0.0, 0.0, 0.4], 5.0)];
        let mut prepared = Prepared::new(&lattice, None, &first, &[], &params, &Exec::default()).unwrap();
        let again = |prepared: &mut Prepared<_>, handle| prepared.update(&[handle], &Exec::default());
        assert_eq!(last(&again(&mut prepared, first[0]).unwrap())[112][2], 0.4);
        let beside = again(&mut prepared, moved(114, [0.0, 0.3, 0.1], 5.0)).unwrap();
        assert_eq!(last(&beside)[114], [0.0, 0.3, 0.1]);
        let error = again(&mut prepared, moved(0, [0.0; 3], 5.0)).unwrap_err();
        assert!(error.to_string().contains("outside the reach"), "{error}");
    }
}

#[test]
fn threads_do_not_change_a_byte_and_cancel_stops() {
    for params in solvers() {
        let lattice = sheet(90);
        let handles = [moved(4000, [0.0, 1.0, 2.0], 60.0), pulled(4040, [0.0, 0.1, 0.2], 60.0)];
        let params = Params {
            springs: Springs { duration: 2e-3, dt: Some(1e-4), stiffness: 10.0, ..params.springs },
            closeness: Closeness { max_iterations: 15, ..params.closeness },
            ..params
        };
        let with = |threads| {
            let exec = Exec::default().with_threads(threads);
            solve(&lattice, None, &handles, &[], &params, &exec).unwrap()
        };
        let one = with(1);
        assert!(one.vertices_loose > 6144 && one == with(2) && one == with(5));
        let stopped = Exec::default();
        stopped.cancel.cancel();
        let error = solve(&lattice, None, &handles, &[], &params, &stopped).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Cancelled);
    }
}
