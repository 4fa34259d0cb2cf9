//! A body among specks: what they keep too many of isn't taken from it.

use ivd_core::Exec;
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, StopReason, Target, chain, refine};
use ivd_lattice::repair::{RepairParams, repair};

use crate::refine::{assert_sound, lattices};

#[test]
fn a_level_of_a_ball_among_specks_is_a_level_of_the_ball() {
    let lattice = lattices::ball_and_specks(72);
    let alone =
        repair(&lattice, &RepairParams { min_triangles: 100, ..RepairParams::default() }, &Exec::default());
    let alone = alone.unwrap().lattice;
    assert_eq!(measure(&alone).components, 1);
    for (method, level) in [(Method::Collapse, 2), (Method::Collapse, 3), (Method::Decimate, 2)] {
        let params = RefineParams { method, target: Target::Level(level).into(), ..RefineParams::default() };
        let [all, one] =
            [&lattice, &alone].map(|of| refine(of, &params, Locks::NONE, &Exec::default()).unwrap());
        let of_ball = all.lattice.keys().iter().filter(|key| alone.vertex_at(**key).is_some()).count();
        assert_eq!(of_ball, one.lattice.keys().len(), "{method:?} {level}");
        assert!(all.max_error_mm < 2.0 * one.max_error_mm, "{} for {}", all.max_error_mm, one.max_error_mm);
        assert_eq!(all.reached.stopped_by, StopReason::Specks);
        assert_sound(&lattice, &all);
    }
    let steps = chain(&lattice, &RefineParams::default(), &[1, 2], Locks::NONE, &Exec::default()).unwrap();
    for (step, share) in steps.iter().zip([4, 16]) {
        let of_ball = step.lattice.keys().iter().filter(|key| alone.vertex_at(**key).is_some()).count();
        assert!(of_ball.abs_diff(alone.keys().len() / share) <= 1, "{of_ball} of {}", alone.keys().len());
    }
}
