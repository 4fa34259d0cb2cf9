//! Vertex clustering onto member vertices.
#![allow(clippy::unwrap_used, reason = "a helper of tests fails as a test does")]

use ivd_core::{Exec, Lattice, Volume, Voxels};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, StopReason, Target, refine};

use crate::refine::coarser::{assert_certified, assert_subset, assert_threads_change_nothing, awkward, by};
use crate::refine::{assert_sound, lattices};

/// By legal collapses alone.
fn merged(lattice: &Lattice, target: Target) -> Refined {
    by(Method::Merge, lattice, target)
}

/// By clustering, whatever becomes of the topology.
fn clustered(lattice: &Lattice, target: Target) -> Refined {
    let params = RefineParams {
        method: Method::Merge,
        target: target.into(),
        allow_topology: true,
        ..RefineParams::default()
    };
    refine(lattice, &params, Locks::NONE, &Exec::default()).expect("the parameters are in their domain")
}

fn phantoms() -> [Lattice; 4] {
    [lattices::sphere(22), lattices::torus(lattices::cube(24)), lattices::gyroid(20), lattices::shell(20)]
}

#[test]
fn legal_merges_meet_their_target_and_keep_the_topology() {
    for lattice in phantoms() {
        for target in [Target::Level(1), Target::Ratio(0.1), Target::Count(lattice.triangles().len() / 20)] {
            let out = merged(&lattice, target);
            assert_subset(&lattice, &out);
            assert_sound(&lattice, &out);
            assert_certified(&lattice, &out);
            assert_eq!(out.reached.stopped_by, StopReason::Target);
            let wanted = match target {
                Target::Level(_) => (lattice.keys().len() as f64 / 4.0).round(),
                Target::Ratio(ratio) => ratio * lattice.triangles().len() as f64,
                _ => lattice.triangles().len() as f64 / 20.0,
            };
            let level = matches!(target, Target::Level(_));
            let got = if level { out.lattice.keys().len() } else { out.lattice.triangles().len() } as f64;
            assert!((got - wanted).abs() < 2.0, "{got} where {wanted} were asked for");
        }
    }
}

#[test]
fn clustering_meets_its_target_from_below_and_tells_its_error() {
    for lattice in phantoms() {
        for keep in [lattice.triangles().len() / 4, lattice.triangles().len() / 20] {
            let out = clustered(&lattice, Target::Count(keep));
            assert_subset(&lattice, &out);
            assert_certified(&lattice, &out);
            assert_eq!(out.reached.stopped_by, StopReason::Target);
            let got = out.lattice.triangles().len();
            assert!(got <= keep && got * 3 > keep * 2, "{got} where {keep} were asked for");
            let figures = measure(&out.lattice);
            assert_eq!((figures.degenerate_triangles, figures.unused_vertices), (0, 0));
            let mut triples = out.lattice.triangles().to_vec();
            for t in &mut triples {
                t.sort_unstable();
            }
            triples.sort_unstable();
            assert!(triples.windows(2).all(|w| w[0] != w[1]), "two triangles on the same vertices");
        }
    }
}

#[test]
fn an_error_asked_for_is_kept_either_way() {
    let torus = lattices::torus(lattices::cube(40));
    for run in [merged, clustered] {
        let mut last = usize::MAX;
        for mm in [0.1, 0.5, 1.5] {
            let out = run(&torus, Target::MaxError(mm));
            assert_subset(&torus, &out);
            assert!(out.max_error_mm <= mm && out.reached.stopped_by != StopReason::Target);
            assert!(out.lattice.keys().len() < last);
            last = out.lattice.keys().len();
        }
    }
}

#[test]
fn a_thin_wall_goes_where_clustering_is_allowed_to_and_stays_where_it_is_not() {
    // A plate of one voxel with a ball at its end.
    let voxels = |[x, y, z]: [usize; 3]| {
        let plate = z == 12 && (2..30).contains(&x) && (2..22).contains(&y);
        let [x, y, z] = [x, y, z].map(|c| c as f64);
        plate || (x - 33.0).powi(2) + (y - 12.0).powi(2) + (z - 12.0).powi(2) < 81.0
    };
    let grid = ivd_core::Grid::with_spacing([46, 24, 24], [1.0; 3]).unwrap();
    let field: Vec<u8> = (0..grid.len()).map(|i| u8::from(voxels(grid.index(i).0))).collect();
    let lattice = lattices::at(&Volume::new(grid, Voxels::from(field)).unwrap(), 0.5);
    let keep = lattice.triangles().len() / 30;
    let out = merged(&lattice, Target::Count(keep));
    assert_sound(&lattice, &out);
    let wall = |out: &Refined| {
        let places = out.lattice.local_positions();
        places.iter().filter(|p| p.x < 20.0).count()
    };
    assert!(wall(&out) > 0);
    let out = clustered(&lattice, Target::Count(keep));
    assert!(out.lattice.triangles().len() <= keep);
    assert!(out.max_error_mm >= 0.4, "sheets met: {}", out.max_error_mm);
}

#[test]
fn random_fields_merge_to_the_least_and_say_what_stopped_them() {
    for seed in lattices::seeds(100) {
        let lattice = lattices::random(seed);
        let out = merged(&lattice, Target::Ratio(0.0));
        assert_subset(&lattice, &out);
        assert_sound(&lattice, &out);
        assert_ne!(out.reached.stopped_by, StopReason::Target);
        let out = clustered(&lattice, Target::Ratio(0.0));
        assert_subset(&lattice, &out);
        assert!(!out.lattice.triangles().is_empty() && out.reached.stopped_by == StopReason::Vanishing);
    }
}

#[test]
fn locked_vertices_stay_either_way() {
    let sphere = lattices::sphere(32);
    let some: Vec<u32> = (0..sphere.keys().len() as u32).step_by(37).collect();
    for allow_topology in [false, true] {
        let target = Target::Ratio(0.1);
        let params = RefineParams {
            method: Method::Merge,
            target: target.into(),
            allow_topology,
            ..RefineParams::default()
        };
        let out = refine(&sphere, &params, Locks { vertices: &some }, &Exec::default()).unwrap();
        assert!(some.iter().all(|&v| out.lattice.vertex_at(sphere.keys()[v as usize]).is_some()));
    }
}

#[test]
fn empty_far_sheared_and_mirrored_lattices_merge_too() {
    let empty = lattices::cut(lattices::cube(4), |_| 0.0);
    let sphere = lattices::sphere(16);
    for run in [merged, clustered] {
        for target in [Target::Ratio(0.0), Target::Level(3), Target::MaxError(1.0), Target::Count(0)] {
            let out = run(&empty, target);
            assert!(out.lattice.keys().is_empty() && out.max_error_mm == 0.0 && out.mean_error_mm == 0.0);
        }
        let out = run(&sphere, Target::Level(0));
        assert_eq!((&out.lattice, out.max_error_mm), (&sphere, 0.0));
    }
    for out in awkward(Method::Merge, Target::Level(1)) {
        assert!(measure(&out.lattice).is_closed_manifold());
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let lattice = lattices::gyroid(48);
    for (target, allow_topology) in
        [(Target::Ratio(0.1), false), (Target::Ratio(0.1), true), (Target::Level(1), false)]
    {
        let params = RefineParams {
            method: Method::Merge,
            target: target.into(),
            allow_topology,
            ..RefineParams::default()
        };
        assert_threads_change_nothing(&lattice, &params);
    }
}
