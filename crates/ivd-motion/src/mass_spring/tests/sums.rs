//! The springs' forces against one spring at a time, energies against forces.

use super::blocks::{Padded, padded, unpadded};
use super::forces::{After, CHUNK, Springs, dot, norm, pull};
use super::spring::{Law, Spring};
use super::*;

type Positions = Vec<[f64; 3]>;

/// Nothing comes after.
struct Nothing;

impl After for Nothing {
    fn go_on(self, _: &Padded, _: &Padded) {}
}

fn laws() -> Vec<Law> {
    let limits = [None, Some(0.2), Some(0.0)];
    limits.iter().flat_map(|&limit| [true, false].map(|push| Law { push, limit })).collect()
}

/// A sheet of several chunks, a part of its vertices held, scattered.
fn scattered(side: usize) -> (Positions, Vec<Spring>, usize, Positions) {
    let lattice = sheet(side);
    let rest = lattice.local_positions();
    let list = links(lattice.triangles(), &rest, |_| true).into_iter().enumerate().map(|(i, link)| Spring {
        ends: link.ends,
        length: (rest[link.ends[1] as usize] - rest[link.ends[0] as usize]).norm(),
        stiffness: 1.0 + (i % 7) as f64,
    });
    let loose = rest.len() - side;
    let mut moved = noise(rest.len());
    moved[loose..].fill([0.0; 3]);
    (rest.iter().map(|p| (*p).into()).collect(), list.collect(), loose, moved)
}

#[test]
fn forces_are_the_sum_of_the_springs_one_at_a_time() {
    let (rest, list, loose, moved) = scattered(70);
    for law in laws() {
        let mut plain = vec![Vector3::zeros(); rest.len()];
        for spring in &list {
            let [i, j] = spring.ends.map(|v| v as usize);
            let on_first = pull(spring, law, &rest, &moved);
            plain[i] += on_first;
            plain[j] -= on_first;
        }
        let mut fast = vec![[0.0; 3]; loose];
        let springs = Springs::new(&list, &rest, loose, law);
        springs.forces(&moved, &mut fast);
        let bits = |of: &[[f64; 3]]| -> Vec<u64> { of.iter().flatten().map(|c| c.to_bits()).collect() };
        for springs in [springs.clone(), plain_loops(&springs)] {
            let mut without = fast.clone();
            springs.forces(&moved, &mut without);
            assert_eq!(bits(&fast), bits(&without), "the processor's wider lanes change no bit");
            let (moved, mut force) = (padded(&moved), vec![[7.0; 4]; loose]);
            for (chunk, force) in force.chunks_mut(CHUNK).enumerate() {
                springs.on_padded(chunk, &moved, force, Nothing);
            }
            assert_eq!(bits(&fast), bits(&unpadded(&force)), "four at a time change no bit either");
            assert!(force.iter().all(|f| f[3].to_bits() == 0));
        }
        for (a, b) in fast.iter().zip(&plain) {
            assert!((Vector3::from(*a) - b).norm() < 1e-12 * (1.0 + b.norm()), "{a:?} {b:?}");
        }
    }
}

#[test]
fn forces_are_the_slope_of_the_energy_and_its_growth_is_exact() {
    let (rest, list, loose, moved) = scattered(50);
    let mut way = noise(rest.len() + 5)[5..].to_vec();
    way[loose..].fill([0.0; 3]);
    let along = |step: f64| -> Vec<[f64; 3]> {
        moved.iter().zip(&way).map(|(u, w)| std::array::from_fn(|a| u[a] + step * w[a])).collect()
    };
    for law in laws() {
        let springs = Springs::new(&list, &rest, loose, law);
        let mut force = vec![[0.0; 3]; loose];
        springs.forces(&moved, &mut force);
        let slope = -dot(&force, &way[..loose]);
        let scale = norm(&force) * norm(&way);
        let h = 1e-5;
        let found = (springs.energy(&rest, &along(h)) - springs.energy(&rest, &along(-h))) / (2.0 * h);
        assert!((found - slope).abs() < 1e-8 * scale, "{law:?}: {found} {slope}");
        // For a large step, the difference; for a tiny one, the slope to all its digits.
        let growth = |step: f64| {
            let scaled: Vec<[f64; 3]> = way.iter().map(|w| w.map(|c| c * step)).collect();
            springs.energy_growth(&moved, &scaled)
        };
        let plain: f64 = list.iter().map(|spring| growth_of(spring, law, &rest, &moved, &way)).sum();
        assert!((growth(1.0) - plain).abs() < 1e-12 * scale, "one spring at a time");
        let lanes = plain_loops(&springs).energy_growth(&moved, &way);
        assert_eq!(growth(1.0).to_bits(), lanes.to_bits(), "the processor's wider lanes change no bit");
        let difference = springs.energy(&rest, &along(0.5)) - springs.energy(&rest, &moved);
        assert!((growth(0.5) - difference).abs() < 1e-11 * springs.energy(&rest, &moved));
        assert!((growth(1e-11) / 1e-11 - slope).abs() < 1e-9 * scale);
    }
}

/// The same springs without the processor's wider lanes.
fn plain_loops(springs: &Springs) -> Springs {
    let mut springs = springs.clone();
    springs.use_simd(false);
    springs
}

/// What one spring's energy grows by, from its lengths.
fn growth_of(spring: &Spring, law: Law, rest: &Positions, moved: &Positions, way: &Positions) -> f64 {
    let [i, j] = spring.ends.map(|v| v as usize);
    let apart = |of: &Positions| Vector3::from(of[j]) - Vector3::from(of[i]);
    let energy = |by: Vector3<f64>| {
        let stretch = (apart(rest) + by).norm() - spring.length;
        let counts = if law.push { stretch } else { stretch.max(0.0) };
        let beyond = law.limit.map_or(0.0, |limit| (stretch - limit * spring.length).max(0.0));
        0.5 * spring.stiffness * (counts * counts + 100.0 * beyond * beyond)
    };
    energy(apart(moved) + apart(way)) - energy(apart(moved))
}

#[test]
fn rigid_motion_strains_nothing() {
    let (rest, list, ..) = scattered(50);
    let springs = Springs::new(&list, &rest, rest.len(), Law { push: true, limit: Some(0.0) });
    for (angle, shift) in [(0.0, [1e3, -2.0, 5.0]), (2.5, [0.0; 3]), (0.7, [30.0, 40.0, -50.0])] {
        let turn = nalgebra::Rotation3::from_scaled_axis(Vector3::new(0.6, -0.64, 0.48) * angle);
        let moved: Vec<[f64; 3]> = rest
            .iter()
            .map(|p| (turn * Vector3::from(*p) - Vector3::from(*p) + Vector3::from(shift)).into())
            .collect();
        let mut force = vec![[0.0; 3]; rest.len()];
        springs.forces(&moved, &mut force);
        assert!(norm(&force) < 1e-8, "{} at {angle}", norm(&force));
        assert!(springs.energy(&rest, &moved) < 1e-18);
    }
}

#[test]
fn a_spring_of_no_length_pulls_and_one_that_has_collapsed_has_no_direction() {
    let law = Law { push: true, limit: None };
    let spring = Spring { ends: [0, 1], length: 0.0, stiffness: 3.0 };
    let rest = [[1.0; 3]; 2];
    assert_eq!(pull(&spring, law, &rest, &[[0.0; 3], [2.0, 0.0, 0.0]]), Vector3::new(6.0, 0.0, 0.0));
    assert_eq!(pull(&spring, law, &rest, &[[0.0; 3]; 2]), Vector3::zeros());
    let collapsed = Spring { length: 1.0, ..spring };
    let rest = [[0.0; 3], [1.0, 0.0, 0.0]];
    let onto = [[1.0, 0.0, 0.0], [0.0; 3]];
    assert_eq!(pull(&collapsed, law, &rest, &onto), Vector3::zeros());
    let mut force = [[1.0; 3]; 2];
    Springs::new(&[collapsed], &rest, 2, law).forces(&onto, &mut force);
    assert_eq!(force, [[0.0; 3]; 2]);
    let mut force = [[1.0; 4]; 2];
    Springs::new(&[collapsed], &rest, 2, law).on_padded(0, &padded(&onto), &mut force, Nothing);
    assert_eq!(force, [[0.0; 4]; 2]);
}

#[test]
fn lengths_of_lists_survive_their_squares() {
    for scale in [1e200, 1.0, 1e-200] {
        assert!((norm(&[[3.0 * scale, 0.0, 4.0 * scale]]) / scale - 5.0).abs() < 1e-12);
    }
    assert_eq!(norm(&[]), 0.0);
    assert!(norm(&[[f64::NAN, 1.0, 0.0]]).is_infinite());
}
