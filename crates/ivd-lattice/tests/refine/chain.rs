//! Chains of levels.

use ivd_core::Exec;
use ivd_lattice::refine::{Locks, Method, RefineParams, chain, vertices_within, with_levels};

use crate::refine::{assert_sound, lattices, sampled};

#[test]
fn every_level_is_a_subset_of_the_one_before_and_bounds_add_up() {
    let input = lattices::torus(lattices::cube(32));
    let locked = vertices_within(&input, input.world(7), 2.0);
    for method in [Method::Collapse, Method::Decimate] {
        let params = RefineParams { method, ..RefineParams::default() };
        let levels =
            chain(&input, &params, &[1, 2, 3], Locks { vertices: &locked }, &Exec::default()).unwrap();
        let (mut last, mut sum) = (&input, 0.0);
        for (step, level) in levels.iter().zip([1, 2, 3]) {
            assert_sound(last, step);
            let keep = (input.keys().len() as f64 * 0.25_f64.powi(level)).round() as usize;
            assert_eq!((step.lattice.keys().len(), i32::from(step.lattice.level())), (keep, level));
            assert!(locked.iter().all(|&v| step.lattice.vertex_at(input.keys()[v as usize]).is_some()));
            sum += step.max_error_mm;
            assert_eq!(step.lattice.max_error_mm(), sum);
            let (hausdorff, _) = sampled::hausdorff_and_mean(&input, &step.lattice);
            assert!(sum >= hausdorff, "{sum} below {hausdorff}");
            last = &step.lattice;
        }
        let stored = with_levels(input.clone(), &levels).unwrap();
        assert_eq!(stored.levels(), 4);
        assert_eq!(stored.at_level(0).as_ref(), Some(&input));
        for (i, step) in levels.iter().enumerate() {
            assert_eq!(stored.at_level(i + 1).as_ref(), Some(&step.lattice));
        }
        assert_eq!(stored.at_level(4), None);
        let turned: Vec<_> = levels.iter().rev().cloned().collect();
        let error = with_levels(input.clone(), &turned).expect_err("the levels are in the wrong order");
        assert!(error.to_string().contains("level 2"), "{error}");
    }
}

#[test]
fn a_chain_of_an_open_lattice_with_unused_vertices_comes_back_whole() {
    let open = lattices::open_sphere(24, 14.0);
    let levels = chain(&open, &RefineParams::default(), &[1, 2], Locks::NONE, &Exec::default()).unwrap();
    let stored = with_levels(open, &levels).unwrap();
    for (i, step) in levels.iter().enumerate() {
        assert_eq!(stored.at_level(i + 1).as_ref(), Some(&step.lattice));
    }
}

#[test]
fn levels_that_do_not_ascend_are_refused_and_none_is_no_level() {
    let sphere = lattices::sphere(16);
    let params = RefineParams::default();
    let sampled = RefineParams { method: Method::Sample, ..params.clone() };
    let error = chain(&sphere, &sampled, &[1, 2], Locks::NONE, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("coarser sampling"), "{error}");
    for levels in [&[2, 1][..], &[1, 1]] {
        let error = chain(&sphere, &params, levels, Locks::NONE, &Exec::default()).unwrap_err();
        assert!(error.to_string().contains("chain"), "{error}");
    }
    assert!(chain(&sphere, &params, &[], Locks::NONE, &Exec::default()).unwrap().is_empty());
    let same = chain(&sphere, &params, &[0], Locks::NONE, &Exec::default()).unwrap();
    assert_eq!(same[0].lattice, sphere);
}
