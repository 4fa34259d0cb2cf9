//! Explicit steps: order, energy, momentum, and a plain twin.

use super::drives::Carried;
use super::dynamics::{Motion, longest_step};
use super::*;

/// A mass of 1 g on a spring of 1 N/m beside a fixed one.
fn oscillator(dt: f64, duration: f64, frames: usize) -> MassSpringResult {
    let params = with_springs(Springs {
        stiffness: 1.0,
        vertex_mass: Some(1.0),
        drag: 0.0,
        duration,
        dt: Some(dt),
        ramp: Some(0.0),
        frames,
        ..Springs::default()
    });
    run(&rod(2), &[pulled(1, [0.1, 0.0, 0.0], 5.0)], &[pin(0)], &params).unwrap()
}

#[test]
fn an_oscillators_period_errs_by_the_square_of_the_step() {
    // It swings about 0.1 mm with ω = √1000 / s.
    let exact = std::f64::consts::TAU / 1000.0_f64.sqrt();
    let error = |dt: f64| {
        let steps = (2.1 / dt).round() as usize;
        let solved = oscillator(dt, steps as f64 * dt, steps);
        let x: Vec<f64> = solved.motion.frames().iter().map(|f| f.displacement[1][0] - 0.1).collect();
        let rises: Vec<f64> = (1..x.len())
            .filter(|&k| x[k - 1] < 0.0 && x[k] >= 0.0)
            .map(|k| (k as f64 - x[k] / (x[k] - x[k - 1])) * dt)
            .collect();
        let period = (rises[rises.len() - 1] - rises[0]) / (rises.len() - 1) as f64;
        (period - exact) / exact
    };
    let errors = [1e-2, 5e-3, 2.5e-3, 1.25e-3].map(error);
    // cos ω'dt = 1 − ω²dt²/2: the period shrinks by ω²dt²/24.
    assert!((errors[3] + 1000.0 * 1.25e-3_f64.powi(2) / 24.0).abs() < 2e-6, "{errors:?}");
    for pair in errors.windows(2) {
        assert!((3.5..4.6).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

/// Positions after steps of the plainest loop there is: from each vertex over its neighbours, with positions.
fn plain(
    lattice: &Lattice,
    target: usize,
    by: [f64; 3],
    pinned: &[usize],
    dt: f64,
    steps: usize,
) -> Vec<Vector3<f64>> {
    let (stiffness, ground, drag) = (1000.0, 5.0, 2.0);
    let rest = lattice.local_positions();
    let mut neighbours = vec![Vec::new(); rest.len()];
    for t in lattice.triangles() {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            neighbours[a as usize].push(b as usize);
            neighbours[b as usize].push(a as usize);
        }
    }
    for around in &mut neighbours {
        around.sort_unstable();
        around.dedup();
    }
    let (mut x, mut v) = (rest.clone(), vec![Vector3::zeros(); rest.len()]);
    for step in 1..=steps {
        let force: Vec<Vector3<f64>> = (0..rest.len())
            .map(|i| {
                neighbours[i].iter().fold(-ground * (x[i] - rest[i]), |sum, &j| {
                    let (d, l) = (x[j] - x[i], (x[j] - x[i]).norm());
                    sum + d * (stiffness * (l - (rest[j] - rest[i]).norm()) / l)
                })
            })
            .collect();
        for i in (0..rest.len()).filter(|i| !pinned.contains(i)) {
            let faster = v[i] + dt * (force[i] - drag * v[i]);
            v[i] = faster;
            x[i] += dt * faster;
        }
        x[target] = rest[target] + Vector3::from(by) * (step as f64 * dt / 0.2).min(1.0);
    }
    x.iter().zip(&rest).map(|(x, rest)| x - rest).collect()
}

#[test]
fn a_thousand_steps_are_those_of_the_plain_loop() {
    let lattice = sheet(13);
    let params = with_springs(Springs {
        stiffness: 1.0,
        shear: 0.0,
        flexion: 0.0,
        ground: 0.005,
        vertex_mass: Some(1.0),
        drag: 2.0,
        duration: 1.0,
        dt: Some(1e-3),
        ramp: Some(0.2),
        course: LoadRamp::Linear,
        ..Springs::default()
    });
    let by = [0.3, 0.2, 1.5];
    let solved = run(&lattice, &[moved(84, by, 100.0)], &[pin(0), pin(12)], &params).unwrap();
    assert_eq!((solved.steps, solved.vertices_loose), (1000, 167));
    for (a, b) in last(&solved).iter().zip(plain(&lattice, 84, by, &[0, 12], 1e-3, 1000)) {
        assert!((Vector3::from(*a) - b).norm() < 1e-10, "{a:?} {b:?}");
    }
}

/// A free sheet that flies, spins and rings.
fn flying(steps: usize) {
    let lattice = sheet(7);
    let params = with_springs(Springs { drag: 0.0, flexion: 0.2, ..Springs::default() });
    let handle = moved(24, [0.0; 3], 100.0);
    let body = body(&lattice, &[handle], &[], &params);
    let drives = Drives {
        moved: Vec::new(),
        is_moved: vec![false; body.loose],
        force: vec![[0.0; 3]; body.loose],
        bones: Carried::default(),
    };
    let dt = longest_step(&body, &drives, 0.0, 1.0);
    let mut motion = Motion::at_rest(&body, &drives, 0.0);
    motion.velocity =
        noise(body.loose).iter().map(|[x, y, z]| [100.0 * x, 100.0 * y, 100.0 * z, 0.0]).collect();
    let momentum = |motion: &Motion| -> Vector3<f64> {
        body.mass.iter().zip(&motion.velocity).map(|(m, v)| Vector3::new(v[0], v[1], v[2]) * *m).sum()
    };
    let (first, energy) = (momentum(&motion), motion.energy());
    let scale: f64 =
        body.mass.iter().zip(&motion.velocity).map(|(m, v)| m * Vector3::new(v[0], v[1], v[2]).norm()).sum();
    for step in 1..=steps {
        motion.step(dt, 0.0, 0.0);
        if step % 97 == 0 {
            let share = motion.energy() / energy;
            assert!((1.0 / 3.0..3.0).contains(&share), "{share} of the energy after {step} steps");
        }
    }
    let drift = (momentum(&motion) - first).norm() / scale;
    assert!(drift < 1e-15 * steps as f64, "{drift}");
    assert!(motion.moved().iter().any(|u| u[2].abs() > 0.1), "it moved");
}

#[test]
fn energy_stays_within_its_envelope_and_momentum_stays_over_a_million_steps() {
    flying(1_000_000);
}

#[test]
fn a_pulled_body_that_nothing_holds_gains_force_times_time() {
    let lattice = sheet(9);
    let params = with_springs(Springs {
        stiffness: 1000.0,
        drag: 0.0,
        duration: 0.01,
        ramp: Some(0.0),
        frames: 100,
        ..Springs::default()
    });
    let solved = run(&lattice, &[pulled(40, [3.0, 0.0, 1.0], 100.0)], &[], &params).unwrap();
    let mass = body(&lattice, &[pulled(40, [0.0; 3], 100.0)], &[], &params).mass;
    let frames = solved.motion.frames();
    let momentum: Vector3<f64> = (0..81)
        .map(|v| {
            let [a, b] = [98, 99].map(|f: usize| Vector3::from(frames[f].displacement[v]));
            (b - a) * (mass[v] / (frames[99].time - frames[98].time))
        })
        .sum();
    // The mean over the last frame's steps is that at its middle, half a step on.
    let at = 0.5 * (frames[98].time + frames[99].time + solved.dt);
    assert!((momentum - Vector3::new(3e3, 0.0, 1e3) * at).norm() < 1e-9 * 3e3 * at, "{momentum}");
}

#[test]
fn statics_of_two_masses_and_of_a_chain_are_analytic() {
    let settled = with_springs(Springs {
        stiffness: 2.0,
        vertex_mass: Some(1e-2),
        drag: 300.0,
        duration: 3.0,
        ramp: Some(0.1),
        ..Springs::default()
    });
    let two = run(&rod(2), &[pulled(1, [0.5, 0.0, 0.0], 5.0)], &[pin(0)], &settled).unwrap();
    // 0.5 mN on 2 N/m.
    assert!((last(&two)[1][0] - 0.25).abs() < 1e-12 && two.residual < 1e-9, "{:?}", last(&two));
    // Ten springs between two pins, pulled at the third joint: 3/K and 7/K side by side.
    let chain = run(&rod(11), &[pulled(3, [0.5, 0.0, 0.0], 50.0)], &[pin(0), pin(10)], &settled).unwrap();
    let peak = 0.25 * 3.0 * 7.0 / 10.0;
    for (i, u) in last(&chain).iter().enumerate() {
        let exact = peak * (i as f64 / 3.0).min((10 - i) as f64 / 7.0);
        assert!((u[0] - exact).abs() < 1e-9, "joint {i}: {u:?} for {exact}");
    }
    // What is moved instead takes the force that would move it so.
    let by = [peak, 0.0, 0.0];
    let held = run(&rod(11), &[moved(3, by, 50.0)], &[pin(0), pin(10)], &settled).unwrap();
    assert!((held.handle_forces_mn[0][0] - 0.5).abs() < 1e-9, "{:?}", held.handle_forces_mn);
}

#[test]
fn frames_are_the_states_on_the_way() {
    let lattice = sheet(9);
    let params = with_springs(Springs { frames: 4, dt: Some(2e-5), ..Springs::default() });
    let many = run(&lattice, &[moved(40, [0.0, 0.0, 1.0], 3.5)], &[], &params).unwrap();
    let times: Vec<f64> = many.motion.frames().iter().map(|f| f.time).collect();
    assert!(times.iter().zip([0.05, 0.1, 0.15, 0.2]).all(|(a, b)| (a - b).abs() < 1e-15));
    let reached: Vec<f64> = many.motion.frames().iter().map(|f| f.displacement[40][2]).collect();
    assert!(
        reached.iter().zip([0.15625, 0.5, 0.84375, 1.0]).all(|(a, b)| (a - b).abs() < 1e-12),
        "{reached:?}"
    );
    let one = Params { springs: Springs { frames: 1, ..params.springs }, ..params };
    let one = run(&lattice, &[moved(40, [0.0, 0.0, 1.0], 3.5)], &[], &one).unwrap();
    assert_eq!((last(&one), one.motion.frames().len()), (last(&many), 1));
}
