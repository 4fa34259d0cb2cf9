use ivd_core::{Exec, Frame, Grid, Motion};
use ivd_field::fixtures::{lattice as ball_lattice, middle, sheared_grid};
use ivd_field::shape::{Kind, Shape};
use nalgebra::{Matrix3, Vector3};

use super::lattice;

const KINDS: [Kind; 8] = [
    Kind::Translate { by: [3.0, -2.0, 1.0] },
    Kind::Rotate { angle: 70.0 },
    Kind::Scale { along: Some(1.6), across: Some(0.8) },
    Kind::Stretch { factor: 1.5 },
    Kind::Squeeze { factor: 0.8 },
    Kind::Twist { rate: 4.0, length: None },
    Kind::Taper { rate: 0.03, length: None },
    Kind::Bend { rate: 2.0, spine: [1.0, 0.2, 0.0], length: None },
];

fn shape(kind: Kind) -> Shape {
    Shape { kind, centre: [5.0, -3.0, 2.0], axis: [0.3, -0.2, 0.9], radius: 40.0, core: 0.5 }
}

fn points() -> impl Iterator<Item = Vector3<f64>> {
    (0..4000_u64).map(|i| {
        let part = |shift: u64| {
            let hash = (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(shift as u32) >> 40;
            hash as f64 / (1_u64 << 24) as f64 * 100.0 - 50.0
        };
        Vector3::new(part(0) + 5.0, part(21) - 3.0, part(43) + 2.0)
    })
}

/// Derivative of a shape at a point, by central differences.
fn jacobian(shape: &Shape, at: Vector3<f64>) -> Matrix3<f64> {
    let h = 1e-5;
    let columns = [Vector3::x(), Vector3::y(), Vector3::z()]
        .map(|e| (shape.apply(at + e * h, 1.0) - shape.apply(at - e * h, 1.0)) / (2.0 * h));
    Matrix3::from_columns(&columns)
}

#[test]
fn beyond_the_radius_nothing_moves_and_no_work_is_the_identity() {
    for kind in KINDS {
        let shape = shape(kind);
        let centre = Vector3::from(shape.centre);
        let mut inside = 0;
        for p in points() {
            if (p - centre).norm() >= shape.radius {
                assert_eq!(shape.apply(p, 1.0), p, "{kind:?}");
            } else {
                inside += 1;
            }
            assert_eq!(shape.apply(p, 0.0), p, "{kind:?}");
        }
        assert!(inside > 500);
    }
}

#[test]
fn the_work_fades_without_a_jump_or_a_kink() {
    for kind in KINDS {
        let shape = shape(kind);
        let centre = Vector3::from(shape.centre);
        for direction in [Vector3::new(1.0, 0.3, -0.2), Vector3::new(-0.1, 0.4, 1.0)] {
            for edge in [shape.radius, shape.core * shape.radius] {
                let along = |d: f64| shape.apply(centre + direction.normalize() * d, 1.0);
                let [before, at, after] = [-1e-4, 0.0, 1e-4].map(|d| along(edge + d));
                assert!((after - before).norm() < 1e-2, "{kind:?}: a jump at {edge} mm");
                let kink = ((after - at) - (at - before)) / 1e-4;
                assert!(kink.norm() < 1e-2, "{kind:?}: a kink of {} at {edge} mm", kink.norm());
            }
        }
    }
}

#[test]
fn in_the_core_the_maps_are_their_definitions() {
    let centre = Vector3::from(shape(KINDS[0]).centre);
    let axis = Vector3::new(0.3, -0.2, 0.9).normalize();
    for p in points().filter(|p| (p - centre).norm() < 19.9) {
        let q = p - centre;
        let (s, across) = (q.dot(&axis), q - axis * q.dot(&axis));
        let to = |kind| shape(kind).apply(p, 1.0) - centre;
        // A turn keeps what lies along the axis, and turns the rest in its plane.
        let turned = |degrees: f64| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            axis * s + across * cosine + axis.cross(&across) * sine
        };
        let cases = [
            (KINDS[0], q + Vector3::new(3.0, -2.0, 1.0)),
            (KINDS[1], turned(70.0)),
            (KINDS[2], axis * (1.6 * s) + across * 0.8),
            (KINDS[3], axis * (1.5 * s) + across / 1.5_f64.sqrt()),
            (KINDS[4], axis * (s / 0.64) + across * 0.8),
            (KINDS[5], turned(4.0 * s)),
            (KINDS[6], axis * s + across * (0.03 * s).exp()),
        ];
        for (kind, expected) in cases {
            assert!((to(kind) - expected).norm() < 1e-12, "{kind:?} at {q:?}");
        }
    }
}

#[test]
fn a_bend_rolls_its_line_up_to_an_arc_and_keeps_lengths_along_it() {
    let rate = 3.0_f64;
    let bend = Shape {
        kind: Kind::Bend { rate, spine: [1.0, 0.0, 7.0], length: Some(60.0) },
        centre: [0.0; 3],
        axis: [0.0, 0.0, 2.0],
        radius: 1e3,
        core: 0.9,
    };
    let radius = 1.0 / rate.to_radians();
    let at = |x: f64, y: f64| bend.apply(Vector3::new(x, y, 5.0), 1.0);
    for x in [-29.0, -3.0, 0.0, 11.0, 29.9] {
        // The arc's middle is at (0, radius); a point y above the line lies y nearer to it.
        for y in [-4.0, 0.0, 6.0] {
            let p = at(x, y);
            assert!(((p - Vector3::new(0.0, radius, 5.0)).norm() - (radius - y)).abs() < 1e-9, "{x}, {y}");
            assert!((p.x / (radius - p.y) - (x / radius).tan()).abs() < 1e-6, "{x}, {y}");
        }
    }
    // Beyond the bent part the line goes straight on, and everything moves as a rigid body.
    let [end, beyond] = [at(30.0, 0.0), at(45.0, 0.0)];
    assert!(((beyond - end) - Vector3::new(0.0, 15.0, 0.0)).norm() < 1e-9, "{:?}", beyond - end);
    assert!(((at(45.0, 3.0) - at(33.0, -2.0)).norm() - 13.0).abs() < 1e-9);
}

#[test]
fn volume_is_kept_by_turns_twists_and_what_says_so() {
    for kind in [KINDS[1], KINDS[3], KINDS[4], KINDS[5]] {
        let shape = shape(kind);
        let centre = Vector3::from(shape.centre);
        // A turn by an angle that depends on the distance from the centre keeps volume everywhere.
        let within = if matches!(kind, Kind::Rotate { .. }) { 40.0 } else { 19.9 };
        for p in points().filter(|p| (p - centre).norm() < within) {
            let det = jacobian(&shape, p).determinant();
            assert!((det - 1.0).abs() < 1e-6, "{kind:?} at {p:?}: det J = {det}");
        }
    }
}

#[test]
fn two_opposite_turns_undo_each_other_and_order_matters() {
    let grid = sheared_grid([40, 30, 14]);
    let at = middle(&grid);
    let (ball, _) = ball_lattice(&grid, |p| 6.0 - (p - at).norm());
    let centre: [f64; 3] = (at + Vector3::from(grid.origin())).into();
    let turn = |angle, axis| Shape { kind: Kind::Rotate { angle }, centre, axis, radius: 9.0, core: 0.2 };
    let [x, y] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let shaped = |shapes: &[Shape]| lattice(&ball, None, shapes, &Exec::default()).unwrap();
    let back = shaped(&[turn(40.0, x), turn(-40.0, x)]);
    assert!(back.max_displacement_mm < 1e-10, "{}", back.max_displacement_mm);
    let [xy, yx] = [[x, y], [y, x]].map(|[a, b]| shaped(&[turn(40.0, a), turn(40.0, b)]));
    assert!(xy.max_displacement_mm > 1.0 && xy.motion.frames() != yx.motion.frames());
    assert_eq!(xy.motion.reach().len(), 2);
    assert_eq!(xy.vertices_moved, ball.keys().len());
}

#[test]
fn shapes_go_on_from_a_motion_and_grow_with_its_frames() {
    let grid = Grid::with_spacing([30; 3], [1.0; 3]).unwrap();
    let at = middle(&grid);
    let (ball, _) = ball_lattice(&grid, |p| 8.0 - (p - at).norm());
    let n = ball.keys().len();
    let frame = |time: f64| Frame { time, displacement: vec![[0.0, 0.0, time]; n].into() };
    let start = Motion::new(grid.clone(), n, vec![frame(1.0), frame(2.0)]).unwrap();
    let push = Shape {
        kind: Kind::Translate { by: [2.0, 0.0, 0.0] },
        centre: at.into(),
        axis: [0.0, 0.0, 1.0],
        radius: 100.0,
        core: 0.5,
    };
    let shaped = lattice(&ball, Some(&start), &[push], &Exec::default()).unwrap();
    for (frame, [x, z]) in shaped.motion.frames().iter().zip([[1.0, 1.0], [2.0, 2.0]]) {
        assert!(
            frame.displacement.iter().all(|u| (Vector3::from(*u) - Vector3::new(x, 0.0, z)).norm() < 1e-12)
        );
    }
    // Out of reach the start's displacement stays, bit for bit.
    let far = Shape { centre: [1e4; 3], ..push };
    assert_eq!(
        lattice(&ball, Some(&start), &[far], &Exec::default()).unwrap().motion.frames(),
        start.frames()
    );
    let other = Motion::new(grid, n + 1, vec![]).unwrap();
    assert!(lattice(&ball, Some(&other), &[push], &Exec::default()).is_err());
}

#[test]
fn a_shape_out_of_its_domain_is_refused_by_name() {
    let good = shape(KINDS[0]);
    let bad = [
        ("radius", Shape { radius: 0.0, ..good }),
        ("axis", Shape { axis: [0.0; 3], ..good }),
        ("centre", Shape { centre: [f64::NAN, 0.0, 0.0], ..good }),
        ("core", Shape { core: 1.0, ..good }),
        ("length", shape(Kind::Twist { rate: 1.0, length: Some(-1.0) })),
        ("factor", shape(Kind::Stretch { factor: 0.0 })),
        ("length", shape(Kind::Taper { rate: 1.0, length: Some(1e101) })),
        ("across are missing", shape(Kind::Scale { along: None, across: None })),
        ("radius", Shape { radius: 1e101, ..good }),
        ("along", shape(Kind::Scale { along: Some(-1.0), across: Some(1.0) })),
        ("angle", shape(Kind::Rotate { angle: f64::INFINITY })),
        ("spine", shape(Kind::Bend { rate: 1.0, spine: good.axis, length: None })),
        ("spine", shape(Kind::Bend { rate: 1.0, spine: [0.0; 3], length: None })),
    ];
    for (field, shape) in bad {
        let error = shape.check().unwrap_err().to_string();
        assert!(error.contains(field), "{field}: {error}");
    }
    for kind in KINDS {
        shape(kind).check().unwrap();
    }
}
