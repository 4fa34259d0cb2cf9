//! Decimation: the same that must hold for collapse, and what it gives beside it.

use ivd_core::{Exec, Lattice};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, StopReason, Target, refine};

use crate::refine::{assert_levels, assert_phantoms, assert_sound, lattices, sampled};

fn by(method: Method, lattice: &Lattice, target: Target) -> Refined {
    let params = RefineParams { method, target: target.into(), ..RefineParams::default() };
    refine(lattice, &params, Locks::NONE, &Exec::default()).expect("the parameters are in their domain")
}

fn decimated(lattice: &Lattice, target: Target) -> Refined {
    by(Method::Decimate, lattice, target)
}

#[test]
fn phantoms_stay_closed_and_of_their_genus_within_the_bound() {
    assert_phantoms(decimated);
}

#[test]
fn targets_are_met_exactly_where_nothing_is_in_the_way() {
    let sphere = lattices::sphere(32);
    assert_levels(&sphere, decimated);
    for method in [Method::Collapse, Method::Decimate] {
        for count in [1000, 200, 60] {
            let out = by(method, &sphere, Target::Count(count));
            assert_eq!((out.lattice.triangles().len(), out.reached.stopped_by), (count, StopReason::Target));
        }
        let all = by(method, &sphere, Target::Count(usize::MAX));
        assert_eq!(all.lattice, sphere);
    }
}

#[test]
fn random_fields_keep_every_speck_and_tunnel_and_the_bound() {
    for seed in lattices::seeds(300) {
        let lattice = lattices::random(seed);
        let out = decimated(&lattice, Target::Ratio(0.0));
        assert_sound(&lattice, &out);
        assert_ne!(out.reached.stopped_by, StopReason::Target);
        let again = decimated(&out.lattice, Target::Ratio(0.0));
        assert_eq!(again.lattice.keys().len(), out.lattice.keys().len(), "it gave up too early");
        if seed < 30 {
            let (hausdorff, _) = sampled::hausdorff_and_mean(&lattice, &out.lattice);
            assert!(out.max_error_mm >= hausdorff - 1e-9, "{} below {hausdorff}", out.max_error_mm);
        }
    }
}

#[test]
fn an_error_asked_for_is_kept_and_used() {
    let torus = lattices::torus(lattices::cube(32));
    let mut last = usize::MAX;
    for mm in [0.0, 0.05, 0.3] {
        let out = decimated(&torus, Target::MaxError(mm));
        assert_sound(&torus, &out);
        assert!(out.max_error_mm <= mm && out.reached.stopped_by == StopReason::MaxError);
        assert!(out.lattice.keys().len() < last || mm == 0.0, "a wider bound removes more");
        last = out.lattice.keys().len();
    }
}

#[test]
fn a_box_loses_all_but_its_shape_without_any_error() {
    let grid = lattices::cube(24);
    let block = lattices::cut(grid, |p| f64::from(u8::from(p.iter().all(|c| (4.0..20.0).contains(c)))));
    let out = decimated(&block, Target::MaxError(1e-9));
    assert_sound(&block, &out);
    let (left, of) = (out.lattice.keys().len(), block.keys().len());
    assert!(left * 20 < of, "{left} of {of}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let lattice = lattices::gyroid(32);
    let params = RefineParams {
        method: Method::Decimate,
        target: Target::Ratio(0.1).into(),
        ..RefineParams::default()
    };
    let with = |threads| {
        refine(&lattice, &params, Locks::NONE, &Exec::default().with_threads(threads)).expect("it is sound")
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        assert_eq!(with(threads), one);
    }
}

#[test]
fn at_equal_count_it_is_within_a_small_factor_of_collapse() {
    let lattice = lattices::gyroid(32);
    for count in [lattice.triangles().len() / 8 * 2, lattice.triangles().len() / 32 * 2] {
        let outs = [Method::Collapse, Method::Decimate].map(|m| by(m, &lattice, Target::Count(count)));
        let far = outs.each_ref().map(|out| sampled::hausdorff_and_mean(&lattice, &out.lattice));
        for ((out, far), name) in outs.iter().zip(far).zip(["collapse", "decimate"]) {
            println!(
                "{name} to {} of {}: Hausdorff {:.3} mm, mean {:.4}, bound {:.3}, mean told {:.4}",
                out.lattice.triangles().len(),
                lattice.triangles().len(),
                far.0,
                far.1,
                out.max_error_mm,
                out.mean_error_mm
            );
            assert_eq!(out.lattice.triangles().len(), count);
            assert!(out.max_error_mm >= far.0 - 1e-9);
        }
        // At a sixteenth it falls behind: its order remembers nothing of the planes that are gone.
        let most = if count > lattice.triangles().len() / 5 { 2.0 } else { 4.0 };
        assert!(far[1].0 < most * far[0].0 && far[1].1 < most * far[0].1, "{far:?}");
    }
}

#[test]
fn a_speck_ends_as_a_tetrahedron_and_says_so() {
    let speck = lattices::cut(lattices::cube(5), |p| f64::from(u8::from(p.iter().all(|&c| c == 2.0))));
    let out = decimated(&speck, Target::Level(4));
    assert_sound(&speck, &out);
    assert_eq!((out.lattice.keys().len(), out.reached.stopped_by), (4, StopReason::Specks));
}

#[test]
fn an_empty_lattice_stays_empty() {
    let empty = lattices::cut(lattices::cube(4), |_| 0.0);
    for target in [Target::Ratio(0.0), Target::Count(0), Target::Level(3), Target::MaxError(1.0)] {
        let out = decimated(&empty, target);
        assert!(out.lattice.keys().is_empty() && out.lattice.triangles().is_empty());
        assert_eq!((out.max_error_mm, out.mean_error_mm), (0.0, 0.0));
    }
    assert!(measure(&empty).is_closed_manifold());
}
