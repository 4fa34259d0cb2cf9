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
    let steps =
        chain(&lattice, &RefineParams::default(), &[1, 2, 3, 4], Locks::NONE, &Exec::default()).unwrap();
    for (step, share) in steps.iter().zip([4, 16, 64, 256]) {
        let of_ball = step.lattice.keys().iter().filter(|key| alone.vertex_at(**key).is_some()).count();
        assert!(of_ball.abs_diff(alone.keys().len() / share) <= 3, "{of_ball} of {}", alone.keys().len());
    }
}

#[test]
fn a_few_specks_keep_no_level_from_being_reached() {
    let lattice = lattices::ball_and_specks(72);
    // Of the specks a handful.
    let roots = lattice.triangles().iter().take(40).map(|t| t[0]).collect::<Vec<_>>();
    let ball =
        repair(&lattice, &RepairParams { min_triangles: 100, ..RepairParams::default() }, &Exec::default());
    let ball = ball.unwrap().lattice;
    let of_ball = |t: &[u32; 3]| ball.vertex_at(lattice.keys()[t[0] as usize]).is_some();
    let near = |t: &[u32; 3]| roots.iter().any(|root| t.contains(root));
    let first = lattice.triangles().iter().find(|t| !of_ball(t) && near(t)).unwrap()[0];
    // The whole speck about that vertex, and the ball.
    let mut speck = vec![first];
    loop {
        let more: Vec<u32> = lattice
            .triangles()
            .iter()
            .filter(|t| t.iter().any(|v| speck.contains(v)))
            .flatten()
            .copied()
            .collect();
        let before = speck.len();
        speck.extend(more);
        speck.sort_unstable();
        speck.dedup();
        if speck.len() == before {
            break;
        }
    }
    let kept: Vec<u32> = (0..lattice.keys().len() as u32)
        .filter(|v| speck.binary_search(v).is_ok() || ball.vertex_at(lattice.keys()[*v as usize]).is_some())
        .collect();
    let triangles =
        lattice.triangles().iter().filter(|t| of_ball(t) || speck.binary_search(&t[0]).is_ok()).copied();
    let both = lattice.subset(&kept, triangles.collect()).unwrap();
    assert_eq!(measure(&both).components, 2);
    let out = refine(
        &both,
        &RefineParams { target: Target::Level(1).into(), ..RefineParams::default() },
        Locks::NONE,
        &Exec::default(),
    )
    .unwrap();
    let wanted = both.keys().len() as f64 / 4.0;
    assert!(
        (out.lattice.keys().len() as f64 - wanted).abs() < 1.0
            && out.reached.stopped_by == StopReason::Target
    );
}
