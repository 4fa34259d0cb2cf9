//! Lattices that break simplification elsewhere, by every method: hundreds of tunnels, ties everywhere, edges of no length, scales.

use ivd_core::{Classified, ElementKey, ErrorClass, Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, StopReason, Target, refine};
use ivd_lattice::repair::{RepairParams, repair};

use crate::refine::{assert_bounded, assert_sound, lattices};

/// Those that keep the topology.
const METHODS: [Method; 4] = [Method::Collapse, Method::Decimate, Method::Loop, Method::Merge];

fn run(lattice: &Lattice, method: Method, target: Target) -> Refined {
    let params = RefineParams { method, target: target.into(), ..RefineParams::default() };
    refine(lattice, &params, Locks::NONE, &Exec::default()).expect("the parameters are in their domain")
}

#[test]
fn a_sponge_of_hundreds_of_tunnels_keeps_them_all() {
    let sponge = lattices::sponge(30);
    assert_eq!(measure(&sponge).genus, Some(325));
    for method in METHODS {
        let out = run(&sponge, method, Target::Ratio(0.0));
        assert_sound(&sponge, &out);
        assert_ne!(out.reached.stopped_by, StopReason::Target, "{method:?}");
        // A closed manifold of genus g has at least (7 + √(1 + 48 g)) / 2 vertices (Heawood).
        assert!(
            out.lattice.keys().len() >= 66 && out.lattice.keys().len() < sponge.keys().len(),
            "{method:?}"
        );
    }
    // With all their tunnels: within a voxel.
    for method in [Method::Collapse, Method::Decimate] {
        let out = run(&sponge, method, Target::MaxError(0.5));
        assert_sound(&sponge, &out);
        assert_bounded(&sponge, &out);
    }
}

#[test]
fn checkerboards_are_refined_to_nothing_soundly() {
    for (n, iso) in [(6, 0.5), (7, 1.0), (8, 0.75)] {
        let voxels: Vec<u8> = (0..n * n * n).map(|i| ((i % n + i / n % n + i / n / n) % 2) as u8).collect();
        let volume = Volume::new(lattices::cube(n), Voxels::from(voxels)).expect("one value a voxel");
        let board = lattices::at(&volume, iso);
        for method in METHODS {
            for target in [Target::Ratio(0.4), Target::Ratio(0.0)] {
                assert_sound(&board, &run(&board, method, target));
            }
        }
    }
}

#[test]
fn a_lattice_of_any_scale_is_refined_alike() {
    let at = |scale: f64| {
        let grid = Grid::with_spacing([28; 3], [0.5 * scale, 0.75 * scale, scale]).expect("a grid");
        lattices::torus(grid)
    };
    let one = at(1.0);
    // Powers of two, so that no rounding differs.
    for scale in [1.0 / 1024.0, 1024.0] {
        let other = at(scale);
        for method in METHODS {
            for (target, scaled) in [
                (Target::Ratio(0.1), Target::Ratio(0.1)),
                (Target::MaxError(0.25), Target::MaxError(0.25 * scale)),
            ] {
                let (a, b) = (run(&one, method, target), run(&other, method, scaled));
                assert_eq!(a.lattice.keys(), b.lattice.keys(), "{method:?}, {target:?}, {scale}");
                assert_eq!(a.lattice.triangles(), b.lattice.triangles(), "{method:?}, {target:?}, {scale}");
                let close = |a: f64, b: f64| (b / scale - a).abs() <= 1e-9 * a;
                assert!(close(a.max_error_mm, b.max_error_mm) && close(a.mean_error_mm, b.mean_error_mm));
            }
        }
    }
}

#[test]
fn edges_of_no_length_and_isolated_vertices_do_no_harm() {
    let torus = lattices::torus(lattices::cube(24));
    let whole = measure(&torus);
    // Vertices of one voxel now lie at one place, and a tenth of the triangles has no area.
    let (keys, _, triangles) = torus.clone().into_parts();
    let nowhere = vec![[0.0; 3]; keys.len()];
    let lattice =
        Lattice::new(torus.grid().clone(), keys, nowhere.into(), triangles).expect("places in order");
    assert!(measure(&lattice).degenerate_triangles > lattice.triangles().len() as u64 / 10);
    for method in METHODS {
        for target in [Target::Ratio(0.5), Target::Ratio(0.0), Target::MaxError(0.4)] {
            let out = run(&lattice, method, target);
            let after = measure(&out.lattice);
            assert_eq!((after.euler, after.components), (whole.euler, whole.components), "{method:?}");
            assert_eq!((after.boundary_edges, after.non_manifold_edges, after.bow_tie_vertices), (0, 0, 0));
            assert!(out.max_error_mm.is_finite() && out.mean_error_mm <= out.max_error_mm);
        }
    }
    // Without its triangles a vertex is isolated, and its neighbours are a border.
    let sphere = lattices::sphere(24);
    let gone = sphere.triangles()[0];
    let left: Vec<_> = sphere.triangles().iter().filter(|t| !t.contains(&gone[0])).copied().collect();
    let holed = sphere.with_triangles(left.into()).expect("vertices stay");
    for method in METHODS {
        let out = run(&holed, method, Target::Ratio(0.2));
        assert_eq!(measure(&out.lattice).unused_vertices, 1, "{method:?}: the isolated vertex stays");
        assert!(out.lattice.vertex_at(holed.keys()[gone[0] as usize]).is_some(), "{method:?}");
        assert!(out.lattice.keys().len() * 2 < holed.keys().len());
    }
}

/// Two vertices that share a ring of `k`, a voxel or so apart.
fn bipyramid(k: usize) -> Lattice {
    let grid = Grid::with_spacing([k + 20; 3], [1.0; 3]).expect("a grid");
    let (middle, radius) = (k as f64 / 2.0 + 10.0, k as f64 / 2.0);
    let mut places = vec![[middle, middle, middle + radius / 4.0], [middle, middle, middle - radius / 4.0]];
    places.extend((0..k).map(|i| {
        let (sin, cos) = ((i as f64 + 0.1) * std::f64::consts::TAU / k as f64).sin_cos();
        [middle + radius * cos, middle + radius * sin, middle + 0.3]
    }));
    let key = |i: &usize| ElementKey::new(grid.dims(), places[*i].map(|c| c as usize + 1), 6);
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_unstable_by_key(key);
    let mut rank = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        rank[old] = new as u32;
    }
    let sides = (0..k).map(|i| [2 + i, 2 + (i + 1) % k]);
    let triangles = sides.flat_map(|[a, b]| [[0, a, b], [1, b, a]]).map(|t| t.map(|v| rank[v])).collect();
    Lattice::new(
        grid.clone(),
        order.iter().map(key).collect(),
        order.iter().map(|&i| places[i].map(|c| c.fract() as f32)).collect(),
        triangles,
    )
    .expect("they fit")
}

#[test]
fn slivers_round_a_hub_of_thousands_of_triangles_go_without_its_whole_star_being_queued_each_time() {
    let lattice = bipyramid(4000);
    let params = RepairParams { max_aspect: Some(8.0), max_error_mm: 4000.0, ..RepairParams::default() };
    let out = repair(&lattice, &params, &Exec::default()).expect("it is sound");
    assert_eq!((out.done.slivers_found, out.done.slivers_left), (8000, 0));
    let after = measure(&out.lattice);
    assert!(after.is_closed_manifold() && after.genus == Some(0) && after.triangles < 200, "{after:?}");
}

#[test]
fn what_every_step_allocates_is_counted_before_it_does() {
    let sponge = lattices::sponge(21);
    let (vertices, triangles) = (sponge.keys().len() as u64, sponge.triangles().len() as u64);
    let run = |method, target: Target, limit| {
        let params =
            RefineParams { method, target: target.into(), allow_topology: true, ..RefineParams::default() };
        refine(&sponge, &params, Locks::NONE, &Exec::default().with_memory_limit(Some(limit)))
    };
    // Enough for collapses that keep the topology, not for those that follow.
    let surface = 140 * vertices + 44 * triangles;
    assert!(run(Method::Collapse, Target::Ratio(0.5), surface).is_ok());
    let pinched = run(Method::Collapse, Target::Ratio(0.0), surface).expect_err("the stars are counted");
    let merged = run(Method::Merge, Target::Ratio(0.5), surface).expect_err("the clusters are counted");
    let slivers = RepairParams { max_aspect: Some(3.0), max_error_mm: 1.0, ..RepairParams::default() };
    let mesh = 132 * vertices + 80 * triangles;
    let repaired = repair(&sponge, &slivers, &Exec::default().with_memory_limit(Some(mesh)))
        .map(|_| ())
        .expect_err("the queue is counted");
    for (error, what) in [(pinched, "tunnels"), (merged, "clustered"), (repaired, "slivers")] {
        assert_eq!(error.error_class(), ErrorClass::Limit);
        assert!(error.to_string().contains(what), "{error}");
    }
    // Twice that is enough for each of them.
    assert!(run(Method::Collapse, Target::Ratio(0.0), 2 * surface).is_ok());
    assert!(repair(&sponge, &slivers, &Exec::default().with_memory_limit(Some(2 * mesh))).is_ok());
}
