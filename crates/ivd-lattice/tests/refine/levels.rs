//! Levels of an inverse Loop scheme: exact on subdivided surfaces, by collapse on all others.
#![allow(clippy::unwrap_used, reason = "a helper of tests fails as a test does")]

use std::collections::{BTreeMap, BTreeSet};

use ivd_core::{ElementKey, Exec, Grid, Lattice, LatticeSource};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{Locks, Method, RefineParams, Refined, StopReason, Target, refine};
use nalgebra::Vector3;

use crate::refine::coarser::{assert_certified, assert_subset, assert_threads_change_nothing, awkward, by};
use crate::refine::{assert_sound, lattices};

fn levels(lattice: &Lattice, target: Target) -> Refined {
    by(Method::Loop, lattice, target)
}

/// A lattice with a vertex in the cell of each place (voxels).
fn on_cells(places: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Lattice {
    let grid = Grid::with_spacing([400; 3], [0.5, 0.5, 1.0]).unwrap();
    let cell = |p: &Vector3<f64>| p.map(f64::floor);
    let key = |p: &Vector3<f64>| {
        let c = cell(p).map(|c| c as usize + 1);
        ElementKey::new(grid.dims(), [c.x, c.y, c.z], 6)
    };
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&v| key(&places[v]));
    let mut rank = vec![0; places.len()];
    for (new, &v) in order.iter().enumerate() {
        rank[v] = new as u32;
    }
    Lattice::new(
        grid.clone(),
        order.iter().map(|&v| key(&places[v])).collect(),
        order.iter().map(|&v| (places[v] - cell(&places[v])).cast::<f32>().into()).collect(),
        triangles.iter().map(|t| t.map(|v| rank[v as usize])).collect(),
    )
    .expect("no two vertices share a cell")
    .with_source(LatticeSource::Mask)
}

type Mesh = (Vec<Vector3<f64>>, Vec<[u32; 3]>);

fn octahedron() -> Mesh {
    let middle = Vector3::new(200.3, 200.4, 200.6);
    let places = (0..6).map(|i| {
        let mut p = middle;
        p[i / 2] += if i % 2 == 0 { 180.0 } else { -180.0 };
        p
    });
    let triangles =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    (places.collect(), triangles)
}

fn torus() -> Mesh {
    let (n, m) = (8, 5);
    let places = (0..n * m).map(|v| {
        let turn = std::f64::consts::TAU;
        let (s, t) = (f64::from(v % n) / f64::from(n) * turn, f64::from(v / n) / f64::from(m) * turn);
        let r = 120.0 + 60.0 * t.cos();
        Vector3::new(200.3 + r * s.cos(), 200.4 + r * s.sin(), 200.6 + 60.0 * t.sin())
    });
    let at = |i: u32, j: u32| i % n + n * (j % m);
    let triangles = (0..n * m).map(|v| (v % n, v / n)).flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    (places.collect(), triangles.collect())
}

/// Cuts each triangle into four. With `round`, the new vertices are moved outwards by a share of their side's length.
fn subdivided((places, triangles): &Mesh, round: f64) -> Mesh {
    let mut places = places.clone();
    let mut middles = BTreeMap::new();
    let mut fine = Vec::new();
    for &t in triangles {
        let m = [0, 1, 2].map(|i| {
            let (a, b) = (t[i].min(t[(i + 1) % 3]), t[i].max(t[(i + 1) % 3]));
            *middles.entry((a, b)).or_insert_with(|| {
                let (p, q) = (places[a as usize], places[b as usize]);
                let middle = (p + q) / 2.0;
                let out = (middle - Vector3::repeat(200.0)).normalize();
                places.push(middle + out * (round * (p - q).norm()));
                places.len() as u32 - 1
            })
        });
        fine.extend([[t[0], m[0], m[2]], [t[1], m[1], m[0]], [t[2], m[2], m[1]], m]);
    }
    (places, fine)
}

/// Triangles by their keys, each from the least on.
fn by_keys(lattice: &Lattice) -> BTreeSet<[ElementKey; 3]> {
    let from_least = |t: &[u32; 3]| {
        let mut keys = t.map(|v| lattice.keys()[v as usize]);
        let least = (0..3).min_by_key(|&i| keys[i]).unwrap();
        keys.rotate_left(least);
        keys
    };
    lattice.triangles().iter().map(from_least).collect()
}

#[test]
fn subdivided_surfaces_come_back_exactly_from_each_of_four_levels() {
    for (start, round) in [(octahedron(), 0.0), (octahedron(), 0.02), (torus(), 0.0)] {
        let mut meshes = vec![start];
        for level in 0..4 {
            meshes.push(subdivided(&meshes[level], round));
        }
        let lattices: Vec<Lattice> = meshes.iter().map(|m| on_cells(&m.0, &m.1)).collect();
        for level in 1..=4_u8 {
            let out = levels(&lattices[4], Target::Level(level));
            assert_subset(&lattices[4], &out);
            let expected = &lattices[4 - usize::from(level)];
            assert_eq!(by_keys(&out.lattice), by_keys(expected), "level {level}");
            assert_eq!(out.lattice.triangles().len(), expected.triangles().len());
            assert_eq!((out.reached.stopped_by, out.passes), (StopReason::Target, u32::from(level)));
            if round == 0.0 {
                assert!(out.max_error_mm < 1e-4, "flat parts stay where they are: {}", out.max_error_mm);
            } else {
                assert!(out.max_error_mm > 1e-3);
            }
        }
        let out = levels(&lattices[4], Target::Count(lattices[2].triangles().len()));
        assert_eq!(by_keys(&out.lattice), by_keys(&lattices[2]));
    }
}

#[test]
fn a_count_between_two_levels_is_met_by_collapse_from_the_coarser_of_them() {
    let fine = (0..4).fold(octahedron(), |mesh, _| subdivided(&mesh, 0.02));
    let lattice = on_cells(&fine.0, &fine.1);
    let out = levels(&lattice, Target::Count(300));
    assert_sound(&lattice, &out);
    assert_eq!((out.lattice.triangles().len(), out.reached.stopped_by), (300, StopReason::Target));
    let out = levels(&lattice, Target::MaxError(2.0));
    assert_sound(&lattice, &out);
    assert!(
        out.max_error_mm <= 2.0 && out.lattice.triangles().len() < 600,
        "{}",
        out.lattice.triangles().len()
    );
}

#[test]
fn phantoms_keep_about_a_quarter_a_level_and_their_topology() {
    for lattice in [lattices::sphere(26), lattices::torus(lattices::cube(26)), lattices::gyroid(20)] {
        for level in 1..=3 {
            let out = levels(&lattice, Target::Level(level));
            assert_subset(&lattice, &out);
            assert_sound(&lattice, &out);
            assert_certified(&lattice, &out);
            assert_eq!(out.reached.stopped_by, StopReason::Target);
            let (asked, got) = (f64::from(level), out.reached.level);
            assert!(got > 0.7 * asked && got < 1.1 * asked, "level {got} of {asked}");
            assert!(measure(&out.lattice).volume_mm3 > 0.0);
        }
    }
}

#[test]
fn ratio_count_and_error_are_met() {
    let torus = lattices::torus(lattices::cube(40));
    for ratio in [0.7, 0.3, 0.05] {
        let out = levels(&torus, Target::Ratio(ratio));
        assert_sound(&torus, &out);
        let wanted = ratio * torus.triangles().len() as f64;
        assert!((out.lattice.triangles().len() as f64 - wanted).abs() < 2.0);
        assert_eq!(out.reached.stopped_by, StopReason::Target);
    }
    let mut last = usize::MAX;
    for mm in [0.05, 0.3] {
        let out = levels(&torus, Target::MaxError(mm));
        assert_sound(&torus, &out);
        assert!(out.max_error_mm <= mm && out.reached.stopped_by != StopReason::Target);
        assert!(out.lattice.keys().len() < last);
        last = out.lattice.keys().len();
    }
    let out = levels(&torus, Target::Level(0));
    assert_eq!((out.lattice, out.max_error_mm), (torus, 0.0));
}

#[test]
fn random_fields_keep_every_speck_and_tunnel_and_say_what_stopped_them() {
    for seed in lattices::seeds(200) {
        let lattice = lattices::random(seed);
        let out = levels(&lattice, Target::Ratio(0.0));
        assert_subset(&lattice, &out);
        assert_sound(&lattice, &out);
        assert_ne!(out.reached.stopped_by, StopReason::Target);
    }
    let speck = lattices::cut(lattices::cube(5), |p| f64::from(u8::from(p == Vector3::repeat(2.0))));
    let out = levels(&speck, Target::Level(4));
    assert_sound(&speck, &out);
    assert_eq!((out.lattice.keys().len(), out.reached.stopped_by), (4, StopReason::Specks));
}

#[test]
fn locked_vertices_stay_and_all_of_them_stop_it() {
    let sphere = lattices::sphere(24);
    let exec = Exec::default();
    let params =
        RefineParams { method: Method::Loop, target: Target::Level(3).into(), ..RefineParams::default() };
    let some: Vec<u32> = (0..sphere.keys().len() as u32).step_by(17).collect();
    let out = refine(&sphere, &params, Locks { vertices: &some }, &exec).unwrap();
    assert!(some.iter().all(|&v| out.lattice.vertex_at(sphere.keys()[v as usize]).is_some()));
    let all: Vec<u32> = (0..sphere.keys().len() as u32).collect();
    let out = refine(&sphere, &params, Locks { vertices: &all }, &exec).unwrap();
    assert_eq!((out.lattice.keys().len(), out.reached.stopped_by), (sphere.keys().len(), StopReason::Locks));
    // A subdivided surface with a locked odd vertex isn't taken back, but collapsed round it.
    let fine = (0..3).fold(octahedron(), |mesh, _| subdivided(&mesh, 0.0));
    let lattice = on_cells(&fine.0, &fine.1);
    let odd = lattice.vertex_at(on_cells(&fine.0[70..71], &[]).keys()[0]).unwrap();
    let params = RefineParams { target: Target::Level(1).into(), ..params };
    let out = refine(&lattice, &params, Locks { vertices: &[odd] }, &exec).unwrap();
    assert!(out.lattice.vertex_at(lattice.keys()[odd as usize]).is_some());
    assert_sound(&lattice, &out);
}

#[test]
fn empty_far_sheared_and_mirrored_lattices_have_levels_too() {
    let empty = lattices::cut(lattices::cube(4), |_| 0.0);
    for target in [Target::Ratio(0.0), Target::Level(3), Target::MaxError(1.0), Target::Count(0)] {
        let out = levels(&empty, target);
        assert!(out.lattice.keys().is_empty() && out.max_error_mm == 0.0 && out.mean_error_mm == 0.0);
    }
    for out in awkward(Method::Loop, Target::Level(1)) {
        assert!(measure(&out.lattice).is_closed_manifold());
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let lattice = lattices::gyroid(56);
    for target in [Target::Level(2), Target::Ratio(0.1)] {
        let params = RefineParams { method: Method::Loop, target: target.into(), ..RefineParams::default() };
        assert_threads_change_nothing(&lattice, &params);
    }
}
