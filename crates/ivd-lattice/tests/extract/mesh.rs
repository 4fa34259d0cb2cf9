//! What a mesh must satisfy, checked without the crate's own figures.

use std::collections::{BTreeMap, BTreeSet};

use ivd_core::Lattice;
use nalgebra::Vector3;

/// Fails where the lattice isn't a closed, oriented 2-manifold whose triangles have three different places.
pub(crate) fn assert_closed_manifold(lattice: &Lattice, context: &str) {
    let mut next: BTreeMap<u32, BTreeMap<u32, u32>> = BTreeMap::new();
    let mut edges = BTreeSet::new();
    for &[a, b, c] in lattice.triangles() {
        for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert!(
                lattice.voxel(p as usize).0 != lattice.voxel(q as usize).0,
                "{context}: coincident corners"
            );
            assert!(edges.insert((p, q)), "{context}: edge {p}-{q} twice in one direction");
            next.entry(p).or_default().insert(q, r);
        }
    }
    for &(p, q) in &edges {
        assert!(edges.contains(&(q, p)), "{context}: edge {p}-{q} has one triangle");
    }
    assert_eq!(next.len(), lattice.keys().len(), "{context}: a vertex without a triangle");
    for (vertex, ring) in &next {
        let start = *ring.keys().next().unwrap();
        let (mut at, mut steps) = (ring[&start], 1);
        while at != start {
            at = ring[&at];
            steps += 1;
        }
        assert_eq!(steps, ring.len(), "{context}: vertex {vertex} joins several sheets");
    }
}

/// Vertices − edges + triangles of a closed mesh.
pub(crate) fn euler(lattice: &Lattice) -> i64 {
    lattice.keys().len() as i64 - lattice.triangles().len() as i64 / 2
}

/// Area [mm²] and enclosed volume [mm³], positive where triangles are counter-clockwise from outside.
pub(crate) fn area_and_volume(lattice: &Lattice) -> (f64, f64) {
    let at = lattice.local_positions();
    lattice.triangles().iter().fold((0.0, 0.0), |(area, volume), t| {
        let [a, b, c] = t.map(|v| at[v as usize]);
        (area + (b - a).cross(&(c - a)).norm() / 2.0, volume + a.dot(&b.cross(&c)) / 6.0)
    })
}

/// How often the surface winds around a voxel coordinate (Van Oosterom and Strackee 1983).
pub(crate) fn winding(lattice: &Lattice, voxel: Vector3<f64>) -> f64 {
    let angle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| lattice.voxel(v as usize).0 - voxel);
        let [la, lb, lc] = [a.norm(), b.norm(), c.norm()];
        let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        2.0 * a.dot(&b.cross(&c)).atan2(below)
    };
    lattice.triangles().iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}
