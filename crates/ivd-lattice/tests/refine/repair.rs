//! Repair: what goes, what stays, and what is told of it.

use ivd_core::{Exec, Lattice};
use ivd_lattice::figures::measure;
use ivd_lattice::repair::{RepairParams, Repaired, repair, small_components};
use nalgebra::Vector3;

use crate::refine::{lattices, sampled};

fn repaired(lattice: &Lattice, params: &RepairParams) -> Repaired {
    repair(lattice, params, &Exec::default()).expect("the parameters are in their domain")
}

fn assert_subset(input: &Lattice, out: &Lattice) {
    for (i, key) in out.keys().iter().enumerate() {
        let old = input.vertex_at(*key).expect("every vertex is one of the input's") as usize;
        assert_eq!(out.places()[i], input.places()[old], "a vertex moved");
    }
    assert!(measure(out).is_closed_manifold());
}

#[test]
fn specks_go_by_triangles_area_or_volume_and_the_ball_stays() {
    let lattice = lattices::ball_and_specks(48);
    let before = measure(&lattice);
    assert!(before.components > 800);
    let none = RepairParams::default();
    assert_eq!(repaired(&lattice, &none).lattice, lattice);
    for params in [
        RepairParams { min_triangles: 100, ..none.clone() },
        RepairParams { min_area_mm2: 20.0, ..none.clone() },
        RepairParams { min_volume_mm3: 10.0, ..none.clone() },
    ] {
        let out = repaired(&lattice, &params);
        assert_subset(&lattice, &out.lattice);
        let after = measure(&out.lattice);
        assert_eq!((after.components, after.unused_vertices), (1, 0));
        let done = out.done;
        assert_eq!((done.components, done.components_removed), (before.components, before.components - 1));
        assert_eq!(done.triangles_removed, before.triangles - after.triangles);
        assert!((done.area_removed_mm2 - (before.area_mm2 - after.area_mm2)).abs() < 1e-6 * before.area_mm2);
        assert!(
            (done.volume_removed_mm3 - (before.volume_mm3 - after.volume_mm3)).abs()
                < 1e-6 * before.volume_mm3
        );
        assert_eq!((out.lattice.level(), out.lattice.max_error_mm()), (0, 0.0));
    }
    let all = repaired(&lattice, &RepairParams { min_triangles: u64::MAX, ..none });
    assert!(all.lattice.keys().is_empty() && all.lattice.triangles().is_empty());
}

#[test]
fn small_components_are_counted_where_something_holds_of_a_vertex() {
    let lattice = lattices::ball_and_specks(48);
    let all = measure(&lattice).components;
    assert_eq!(small_components(&lattice, 0.01, |_| true), all - 1, "all but the ball");
    assert_eq!(small_components(&lattice, 0.01, |_| false), 0);
    assert_eq!(small_components(&lattice, 0.0, |_| true), 0);
    // A plane apart, both sides together have all, and those that it cuts twice.
    let places = lattice.local_positions();
    let below = small_components(&lattice, 0.01, |v| places[v].z < 20.2);
    let above = small_components(&lattice, 0.01, |v| places[v].z >= 20.2);
    let cut = below + above - (all - 1);
    assert!(below > 50 && above > 50 && cut < all / 10, "{below} {above} {cut}");
}

/// Largest longest side over least height.
fn worst_aspect(lattice: &Lattice) -> f64 {
    let places = lattice.local_positions();
    let aspect = |t: &[u32; 3]| {
        let [a, b, c]: [Vector3<f64>; 3] = t.map(|v| places[v as usize]);
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        longest * longest / (b - a).cross(&(c - a)).norm()
    };
    lattice.triangles().iter().map(aspect).fold(0.0, f64::max)
}

#[test]
fn slivers_go_within_the_error_and_the_rest_keeps_its_topology() {
    for lattice in [lattices::sphere(32), lattices::torus(lattices::cube(32)), lattices::gyroid(32)] {
        let before = measure(&lattice);
        assert!(worst_aspect(&lattice) > 50.0);
        for (max_aspect, max_error_mm) in [(8.0, 0.3), (8.0, 0.02), (4.0, 0.3)] {
            let params =
                RepairParams { max_aspect: Some(max_aspect), max_error_mm, ..RepairParams::default() };
            let out = repaired(&lattice, &params);
            assert_subset(&lattice, &out.lattice);
            let after = measure(&out.lattice);
            assert_eq!((after.euler, after.components), (before.euler, before.components));
            let done = out.done;
            assert_eq!(done.vertices_collapsed, before.vertices - after.vertices);
            assert!(done.max_error_mm <= max_error_mm);
            assert_eq!(out.lattice.max_error_mm(), done.max_error_mm);
            let (hausdorff, _) = sampled::hausdorff_and_mean(&lattice, &out.lattice);
            assert!(done.max_error_mm >= hausdorff - 1e-9, "{} below {hausdorff}", done.max_error_mm);
            assert_eq!(worst_aspect(&out.lattice) > max_aspect, done.slivers_left > 0);
            // A small error leaves many where triangles are as small as these.
            let share = if max_error_mm < 0.1 { 1 } else { 4 };
            assert!(done.slivers_left * share < done.slivers_found, "{done:?}");
        }
        let high = RepairParams { min_height_mm: 0.1, max_error_mm: 0.3, ..RepairParams::default() };
        let done = repaired(&lattice, &high).done;
        assert!(done.slivers_found > 0 && done.slivers_left * 4 < done.slivers_found, "{done:?}");
    }
}

#[test]
fn random_fields_are_repaired_soundly() {
    for seed in lattices::seeds(100) {
        let lattice = lattices::random(seed);
        let before = measure(&lattice);
        let params = RepairParams { max_aspect: Some(3.0), max_error_mm: 1.0, ..RepairParams::default() };
        let out = repaired(&lattice, &params);
        assert_subset(&lattice, &out.lattice);
        let after = measure(&out.lattice);
        assert_eq!((after.euler, after.components), (before.euler, before.components));
        let (hausdorff, _) = sampled::hausdorff_and_mean(&lattice, &out.lattice);
        assert!(out.done.max_error_mm >= hausdorff - 1e-9);
    }
}

#[test]
fn an_empty_lattice_is_whole_and_bad_parameters_are_named() {
    let empty = lattices::cut(lattices::cube(4), |_| 0.0);
    let params = RepairParams { max_aspect: Some(8.0), min_triangles: 5, ..RepairParams::default() };
    assert_eq!(repaired(&empty, &params).lattice, empty);
    let none = RepairParams::default();
    for (params, field) in [
        (RepairParams { min_area_mm2: -1.0, ..none.clone() }, "min_area_mm2"),
        (RepairParams { min_volume_mm3: f64::NAN, ..none.clone() }, "min_volume_mm3"),
        (RepairParams { max_aspect: Some(1.0), ..none.clone() }, "max_aspect"),
        (RepairParams { min_height_mm: f64::INFINITY, ..none.clone() }, "min_height_mm"),
        (RepairParams { max_turn_degrees: 180.0, ..none }, "max_turn_degrees"),
    ] {
        let error = repair(&empty, &params, &Exec::default()).expect_err("it is outside its domain");
        assert!(error.to_string().contains(field), "{error}");
    }
}
