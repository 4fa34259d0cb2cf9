//! Lattices that break simplification elsewhere, by every method: hundreds of tunnels, ties everywhere, edges of no length, scales.

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, StoppedBy, Target, refine};

use crate::{assert_bounded, assert_sound, lattices};

/// Those that keep the topology.
const METHODS: [Method; 4] = [Method::Collapse, Method::Decimate, Method::Loop, Method::Merge];

fn run(lattice: &Lattice, method: Method, target: Target) -> Refined {
    let params = RefineParams { method, target, ..RefineParams::default() };
    refine(lattice, &params, Locks::NONE, &Exec::default()).expect("the parameters are in their domain")
}

#[test]
fn a_sponge_of_hundreds_of_tunnels_keeps_them_all() {
    let sponge = lattices::sponge(30);
    assert_eq!(measure(&sponge).genus, Some(325));
    for method in METHODS {
        let out = run(&sponge, method, Target::Ratio(0.0));
        assert_sound(&sponge, &out);
        assert_ne!(out.reached.stopped_by, StoppedBy::Target, "{method:?}");
        // A closed manifold of genus g has at least (7 + √(1 + 48 g)) / 2 vertices (Heawood).
        assert!(out.lattice.keys.len() >= 66 && out.lattice.keys.len() < sponge.keys.len(), "{method:?}");
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
                assert_eq!(a.lattice.keys, b.lattice.keys, "{method:?}, {target:?}, {scale}");
                assert_eq!(a.lattice.triangles, b.lattice.triangles, "{method:?}, {target:?}, {scale}");
                let close = |a: f64, b: f64| (b / scale - a).abs() <= 1e-9 * a;
                assert!(close(a.max_error_mm, b.max_error_mm) && close(a.mean_error_mm, b.mean_error_mm));
            }
        }
    }
}

#[test]
fn edges_of_no_length_and_isolated_vertices_do_no_harm() {
    let mut lattice = lattices::torus(lattices::cube(24));
    let whole = measure(&lattice);
    // Vertices of one voxel now lie at one place, and a tenth of the triangles has no area.
    for place in &mut lattice.places {
        *place = [0.0; 3];
    }
    assert!(measure(&lattice).degenerate_triangles > lattice.triangles.len() as u64 / 10);
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
    let mut holed = sphere.clone();
    let gone = sphere.triangles[0];
    holed.triangles.retain(|t| !t.contains(&gone[0]));
    for method in METHODS {
        let out = run(&holed, method, Target::Ratio(0.2));
        assert_eq!(measure(&out.lattice).unused_vertices, 1, "{method:?}: the isolated vertex stays");
        assert!(out.lattice.vertex_at(holed.keys[gone[0] as usize]).is_some(), "{method:?}");
        assert!(out.lattice.keys.len() * 2 < holed.keys.len());
    }
}
