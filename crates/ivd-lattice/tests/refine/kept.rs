//! What either method leaves alone: locks, features, borders, broken places, far grids.

use std::collections::HashMap;

use ivd_core::{ElementKey, Exec, Grid, Lattice, LatticeSource};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{
    Locks, Method, RefineParams, Refined, StopReason, Target, refine, vertices_within,
};
use nalgebra::Vector3;

use crate::refine::{assert_bounded, assert_sound, lattices};

const METHODS: [Method; 2] = [Method::Collapse, Method::Decimate];

fn params(method: Method, target: Target) -> RefineParams {
    RefineParams { method, target: target.into(), ..RefineParams::default() }
}

fn run(lattice: &Lattice, params: &RefineParams, locked: &[u32]) -> Refined {
    refine(lattice, params, Locks { vertices: locked }, &Exec::default())
        .expect("the parameters are in their domain")
}

#[test]
fn locked_vertices_stay_and_nothing_else_is_kept_for_them() {
    let torus = lattices::torus(lattices::cube(32));
    let locked = vertices_within(&torus, torus.world(100), 5.0);
    assert!(locked.len() > 40 && locked.contains(&100));
    for method in METHODS {
        let out = run(&torus, &params(method, Target::Ratio(0.25)), &locked);
        assert_sound(&torus, &out);
        assert_bounded(&torus, &out);
        assert_eq!(out.reached.stopped_by, StopReason::Target);
        assert!(locked.iter().all(|&v| out.lattice.vertex_at(torus.keys()[v as usize]).is_some()));
        let free = run(&torus, &params(method, Target::Ratio(0.25)), &[]);
        assert!(locked.iter().any(|&v| free.lattice.vertex_at(torus.keys()[v as usize]).is_none()));
        let all: Vec<u32> = (0..torus.keys().len() as u32).rev().collect();
        let out = run(&torus, &params(method, Target::Ratio(0.25)), &all);
        assert_eq!((out.lattice, out.reached.stopped_by), (torus.clone(), StopReason::Locks));
    }
    let none = torus.keys().len() as u32;
    let error = refine(
        &torus,
        &params(Method::Collapse, Target::Level(1)),
        Locks { vertices: &[none] },
        &Exec::default(),
    );
    assert!(error.expect_err("there is no such vertex").to_string().contains("locks"));
}

/// Ends of the edges where the surface turns by more than an angle, in world places.
fn creases(lattice: &Lattice, degrees: f64) -> Vec<[Vector3<f64>; 2]> {
    let places = lattice.local_positions();
    let mut normals: HashMap<[u32; 2], Vec<Vector3<f64>>> = HashMap::new();
    for &t in lattice.triangles() {
        let [a, b, c] = t.map(|v| places[v as usize]);
        let normal = (b - a).cross(&(c - a)).normalize();
        for (v, w) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            normals.entry([v.min(w), v.max(w)]).or_default().push(normal);
        }
    }
    let sharp = |n: &[Vector3<f64>]| n[0].dot(&n[1]) < degrees.to_radians().cos();
    let edges = normals.iter().filter(|e| sharp(e.1));
    edges.map(|(e, _)| e.map(|v| places[v as usize])).collect()
}

fn off_segment(p: &Vector3<f64>, [a, b]: &[Vector3<f64>; 2]) -> f64 {
    let along = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
    (a + (b - a) * along - p).norm()
}

#[test]
fn the_edges_of_a_cube_stay_where_they_are_and_its_corners_too() {
    let block =
        lattices::cut(lattices::cube(20), |p| f64::from(u8::from(p.iter().all(|c| (4.0..16.0).contains(c)))));
    let before = creases(&block, 30.0);
    assert!(before.len() > 200);
    for method in METHODS {
        let params = RefineParams { feature_degrees: Some(30.0), ..params(method, Target::Ratio(0.0)) };
        let out = run(&block, &params, &[]);
        assert_sound(&block, &out);
        let after = creases(&out.lattice, 30.0);
        for p in before.iter().flatten() {
            let off = after.iter().map(|e| off_segment(p, e)).fold(f64::INFINITY, f64::min);
            assert!(off < 1e-6, "{method:?}: the crease at {p:?} is {off} mm away");
        }
        // Chamfered: a corner is a triangle, so that 24 vertices are the least.
        assert!(
            out.lattice.keys().len() < 60,
            "{method:?}: {} of {}",
            out.lattice.keys().len(),
            block.keys().len()
        );
        assert!(out.reached.refused.features >= 24, "{:?}", out.reached);
        assert!(out.max_error_mm < 1e-5, "{method:?}: {}", out.max_error_mm);
        let plain = run(&block, &RefineParams { feature_degrees: None, ..params }, &[]);
        assert!(plain.lattice.keys().len() < out.lattice.keys().len());
    }
}

/// Lengths (mm) of a lattice's edges.
fn edges(lattice: &Lattice) -> impl Iterator<Item = f64> {
    let length = |[a, b]: [u32; 2]| (lattice.world(a as usize).0 - lattice.world(b as usize).0).norm();
    lattice.triangles().iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).map(length)
}

#[test]
fn no_edge_is_made_that_is_longer_than_any_may_be() {
    let block =
        lattices::cut(lattices::cube(40), |p| f64::from(u8::from(p.iter().all(|c| (4.0..36.0).contains(c)))));
    for method in METHODS {
        for max_edge in [3.0, 8.0] {
            let free = params(method, Target::Ratio(0.0));
            let params = RefineParams { max_edge: Some(max_edge), ..free.clone() };
            let (out, free) = (run(&block, &params, &[]), run(&block, &free, &[]));
            assert_sound(&block, &out);
            let longest = |lattice| edges(lattice).fold(0.0, f64::max);
            assert!(longest(&out.lattice) <= max_edge, "{method:?}: {}", longest(&out.lattice));
            assert!(longest(&free.lattice) > 2.0 * max_edge, "{method:?}");
            // As few as such edges let there be, about: each of a side's equilateral triangles has an area of √3/4 of a square.
            let least = 6.0 * 32.0 * 32.0 / (0.433 * max_edge * max_edge);
            let many = out.lattice.triangles().len() as f64;
            assert!(many > 0.9 * least && many < 6.0 * least, "{method:?}: {many} of {least}");
            assert!(out.reached.refused.edges > out.lattice.keys().len() as u64 / 2, "{:?}", out.reached);
            assert_eq!(out.reached.stopped_by, StopReason::Edges, "{method:?}");
        }
        // Where it may be pinched, and by legal merges.
        for (by, allow_topology) in [(method, true), (Method::Merge, false)] {
            let params =
                RefineParams { max_edge: Some(5.0), allow_topology, ..params(by, Target::Ratio(0.0)) };
            let out = run(&block, &params, &[]);
            assert!(edges(&out.lattice).all(|mm| mm <= 5.0), "{by:?}");
            assert!(out.lattice.keys().len() < block.keys().len() / 2, "{by:?}");
        }
        let far = RefineParams { max_edge: Some(1e3), ..params(method, Target::Ratio(0.2)) };
        let plain = run(&block, &params(method, Target::Ratio(0.2)), &[]);
        assert_eq!(run(&block, &far, &[]), plain, "{method:?}");
        let bad = RefineParams { max_edge: Some(0.0), ..far };
        let error = refine(&block, &bad, Locks::NONE, &Exec::default()).expect_err("0 mm is no edge");
        assert!(error.to_string().contains("max_edge"));
    }
}

#[test]
fn a_feature_angle_beyond_all_edges_changes_nothing() {
    let sphere = lattices::sphere(24);
    for method in METHODS {
        let plain = run(&sphere, &params(method, Target::Ratio(0.2)), &[]);
        let params = RefineParams { feature_degrees: Some(179.0), ..params(method, Target::Ratio(0.2)) };
        assert_eq!(run(&sphere, &params, &[]), plain);
        let bad = RefineParams { feature_degrees: Some(0.0), ..params };
        let error = refine(&sphere, &bad, Locks::NONE, &Exec::default()).expect_err("0 degrees is no angle");
        assert!(error.to_string().contains("feature_degrees"));
    }
}

/// Two octahedra of several rings that share one vertex, at the origin of an otherwise empty grid.
fn bow_tie() -> Lattice {
    let ball = lattices::sphere(12);
    let grid = Grid::with_spacing([40, 12, 12], [1.0; 3]).expect("a grid");
    let n = ball.keys().len() as u32;
    let top = (0..n)
        .max_by(|&a, &b| ball.voxel(a as usize).0.x.total_cmp(&ball.voxel(b as usize).0.x))
        .expect("some");
    // The second ball is the first, moved and mirrored along x so that its first vertex meets the other's last.
    let key = |v: u32, mirrored: bool| {
        let key = ball.keys()[v as usize];
        let mut padded = key.padded(ball.grid().dims());
        if mirrored {
            padded[0] = 30 - padded[0];
        }
        ElementKey::new(grid.dims(), padded, key.element())
    };
    let mut vertices: Vec<(ElementKey, [f32; 3])> = (0..n)
        .flat_map(|v| [(key(v, false), ball.places()[v as usize]), (key(v, true), ball.places()[v as usize])])
        .collect();
    vertices.sort_unstable_by_key(|v| v.0);
    let at = |k: ElementKey| vertices.iter().position(|v| v.0 == k).expect("listed") as u32;
    let mut triangles: Vec<[u32; 3]> =
        ball.triangles().iter().map(|t| t.map(|v| at(key(v, false)))).collect();
    let shared = at(key(top, false));
    let twin = at(key(top, true));
    triangles.extend(ball.triangles().iter().map(|t| {
        let [a, b, c] = t.map(|v| at(key(v, true))).map(|v| if v == twin { shared } else { v });
        [a, c, b]
    }));
    // The twin has no triangle left.
    vertices.remove(twin as usize);
    for corner in triangles.iter_mut().flatten() {
        *corner -= u32::from(*corner > twin);
    }
    Lattice::new(
        grid,
        vertices.iter().map(|v| v.0).collect(),
        vertices.iter().map(|v| v.1).collect(),
        triangles.into(),
    )
    .expect("they fit")
    .with_source(LatticeSource::Mask)
}

#[test]
fn bow_ties_stay_and_the_rest_goes() {
    let lattice = bow_tie();
    let before = measure(&lattice);
    assert_eq!((before.bow_tie_vertices, before.boundary_edges, before.components), (1, 0, 1));
    for method in METHODS {
        let out = run(&lattice, &params(method, Target::Ratio(0.2)), &[]);
        let after = measure(&out.lattice);
        assert_eq!((after.bow_tie_vertices, after.boundary_edges, after.non_manifold_edges), (1, 0, 0));
        assert_eq!((after.euler, after.components), (before.euler, before.components));
        assert!(out.lattice.keys().len() * 3 < lattice.keys().len());
    }
}

#[test]
fn open_borders_stay_as_they_are() {
    let open = lattices::open_sphere(24, 14.0);
    let border = |lattice: &Lattice| {
        let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let all: Vec<_> = lattice
            .triangles()
            .iter()
            .flat_map(sides)
            .map(|e| e.map(|v| lattice.keys()[v as usize]))
            .collect();
        let mut open: Vec<_> = all.iter().copied().filter(|[a, b]| !all.contains(&[*b, *a])).collect();
        open.sort_unstable();
        open
    };
    for method in METHODS {
        let out = run(&open, &params(method, Target::Ratio(0.1)), &[]);
        assert!(!border(&open).is_empty());
        assert_eq!(border(&out.lattice), border(&open));
    }
}

#[test]
fn far_thick_slanted_and_mirrored_grids_lose_nothing() {
    let (s, c) = 0.4_f64.sin_cos();
    let axes = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, -1.0]];
    let grid = |origin| Grid::new([28; 3], [0.5, 0.5, 5.0], origin, axes).expect("a grid");
    let (near, far) = (lattices::torus(grid([0.0; 3])), lattices::torus(grid([1e6, -1e6, 1e6])));
    let params = params(Method::Decimate, Target::Ratio(0.2));
    let (a, b) = (run(&near, &params, &[]), run(&far, &params, &[]));
    assert_sound(&near, &a);
    assert_bounded(&near, &a);
    assert_eq!((a.lattice.keys(), a.lattice.triangles()), (b.lattice.keys(), b.lattice.triangles()));
    assert_eq!(a.max_error_mm, b.max_error_mm);
    let locked = |lattice: &Lattice| vertices_within(lattice, lattice.world(50), 3.0);
    assert_eq!(locked(&near), locked(&far));
}

#[test]
fn costs_that_are_all_the_same_give_the_same_bytes_for_any_number_of_threads() {
    // Flat faces: every cost on them is 0 but for the shape.
    let block =
        lattices::cut(lattices::cube(40), |p| f64::from(u8::from(p.iter().all(|c| (4.0..36.0).contains(c)))));
    for method in METHODS {
        for feature_degrees in [None, Some(30.0)] {
            let params =
                RefineParams { shape_weight: 0.0, feature_degrees, ..params(method, Target::Ratio(0.1)) };
            let with = |threads| {
                refine(&block, &params, Locks::NONE, &Exec::default().with_threads(threads))
                    .expect("it is sound")
            };
            let one = with(1);
            for threads in [2, 3, 8] {
                assert_eq!(with(threads), one, "{method:?}");
            }
        }
    }
}

#[test]
fn what_kept_vertices_is_told_of_each_that_is_left_and_of_no_other() {
    for seed in lattices::seeds(40) {
        let lattice = lattices::random(seed);
        for (method, allow_topology) in
            [(Method::Collapse, false), (Method::Decimate, false), (Method::Collapse, true)]
        {
            let params = RefineParams { allow_topology, ..params(method, Target::Ratio(0.0)) };
            let out = run(&lattice, &params, &[]);
            let refused = out.reached.refused;
            let told = [
                refused.links,
                refused.flips,
                refused.specks,
                refused.locks,
                refused.features,
                refused.max_error,
            ];
            assert_eq!(
                told.iter().sum::<u64>(),
                out.lattice.keys().len() as u64,
                "{seed}, {method:?}: {refused:?}"
            );
        }
    }
}
