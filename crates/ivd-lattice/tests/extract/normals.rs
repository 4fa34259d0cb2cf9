//! Normals by the volume's gradient against analytic ones.

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract, normals};
use nalgebra::Vector3;

use crate::extract::convergence::{BALL, Body, GYROID, RING, sampled};

/// A ball of radius `r` (mm) about the middle of a grid, sampled from its distance, and its lattice.
fn ball(grid: Grid, r: f64) -> (Volume, Lattice, Vector3<f64>) {
    let dims = grid.dims();
    let middle = grid.world(ivd_core::VoxelCoord(Vector3::from_fn(|a, _| (dims[a] as f64 - 1.0) / 2.0))).0;
    let world =
        |i: usize| grid.world(ivd_core::VoxelCoord(Vector3::from(grid.index(i).0.map(|c| c as f64)))).0;
    let voxels: Vec<f32> = (0..grid.len()).map(|i| (r - (world(i) - middle).norm()) as f32).collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
    let params = ExtractParams { iso: Iso::Value(0.0) };
    let lattice = extract(&volume, None, &params, &Exec::default()).unwrap().lattice;
    (volume, lattice, middle)
}

/// Largest angle (degrees) between a normal and the ball's own.
fn worst(volume: &Volume, lattice: &Lattice, middle: Vector3<f64>) -> f64 {
    let found = normals(volume, lattice, &Exec::default()).unwrap();
    (0..lattice.keys().len())
        .map(|i| {
            let n = Vector3::from(found[i].map(f64::from));
            assert!((n.norm() - 1.0).abs() < 1e-5);
            let truth = (lattice.world(i).0 - middle).normalize();
            n.cross(&truth).norm().atan2(n.dot(&truth)).to_degrees()
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_balls_normals_are_within_a_degree_on_any_grid() {
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let flipped = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
    let (c, s) = (0.8, 0.6);
    let turned = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
    for (spacing, direction) in [
        ([1.0; 3], identity),
        ([0.5, 1.0, 0.7], identity),
        ([1.0, 0.8, 0.9], flipped),
        ([0.6, 0.9, 1.0], turned),
    ] {
        for origin in [[0.0; 3], [1e6, -1e6, 1e6]] {
            let grid = Grid::new([64; 3], spacing, origin, direction).unwrap();
            let (volume, lattice, middle) = ball(grid, 15.0);
            let worst = worst(&volume, &lattice, middle);
            assert!(worst < 1.0, "{spacing:?} {direction:?} {origin:?}: {worst}°");
        }
    }
}

#[test]
fn both_sides_of_an_interval_point_outward_and_caps_along_their_axis() {
    let grid = Grid::with_spacing([8, 8, 8], [1.0; 3]).unwrap();
    let voxels: Vec<f32> = (0..512).map(|i| (i % 8) as f32).collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
    let iso = Iso::Interval { lower: Some(2.5), upper: Some(5.5) };
    let lattice = extract(&volume, None, &ExtractParams { iso }, &Exec::default()).unwrap().lattice;
    let found = normals(&volume, &lattice, &Exec::default()).unwrap();
    for (i, n) in found.iter().enumerate() {
        let at = lattice.voxel(i).0;
        if (1.0..6.0).contains(&at.y) && (1.0..6.0).contains(&at.z) {
            assert_eq!(n[0], if at.x < 4.0 { -1.0 } else { 1.0 }, "{at:?}");
        }
        if at.x == 4.0 && (2.0..5.0).contains(&at.y) {
            assert_eq!(n[2], if at.z < 4.0 { -1.0 } else { 1.0 }, "a cap at {at:?}");
        }
    }
}

#[test]
fn a_flat_volume_gives_the_triangles_normals() {
    let grid = Grid::with_spacing([3, 3, 3], [1.0; 3]).unwrap();
    let volume = Volume::new(grid, Voxels::from(vec![5_u8; 27])).unwrap();
    let params = ExtractParams { iso: Iso::Value(1.0) };
    let lattice = extract(&volume, None, &params, &Exec::default()).unwrap().lattice;
    for (i, n) in normals(&volume, &lattice, &Exec::default()).unwrap().iter().enumerate() {
        let out = lattice.voxel(i).0 - Vector3::repeat(1.0);
        assert!(out.dot(&Vector3::from(n.map(f64::from))) > 0.0);
    }
}

/// Largest and mean angle (degrees) between the normals of a body's lattice and the body's own, between the voxels of the volume.
fn angles(body: &Body, n: usize) -> [f64; 2] {
    let volume = sampled([n; 3], body.level);
    let params = ExtractParams { iso: Iso::Value(0.0) };
    let lattice = extract(&volume, None, &params, &Exec::default()).unwrap().lattice;
    let found = normals(&volume, &lattice, &Exec::default()).unwrap();
    let inside = |i: &usize| lattice.voxel(*i).0.iter().all(|&c| 0.0 < c && c < (n - 1) as f64);
    let angle = |i: usize| {
        let normal = Vector3::from(found[i].map(f64::from));
        let truth = -(body.gradient)(lattice.world(i).0);
        normal.cross(&truth).norm().atan2(normal.dot(&truth)).to_degrees()
    };
    let angles: Vec<f64> = (0..lattice.keys().len()).filter(inside).map(angle).collect();
    [angles.iter().copied().fold(0.0, f64::max), angles.iter().sum::<f64>() / angles.len() as f64]
}

fn assert_within_a_degree(n: usize) {
    for (name, body) in [("ball", BALL), ("torus", RING), ("gyroid", GYROID)] {
        let [largest, mean] = angles(&body, n);
        println!("{name} {n}³: normals {largest:.4}° at most, {mean:.4}° on average");
        assert!(largest < 1.0, "{name} {n}³: {largest}°");
    }
}

#[test]
fn normals_of_ball_torus_and_gyroid_are_within_a_degree() {
    assert_within_a_degree(64);
}

#[test]
#[ignore = "256³ voxels three times"]
fn normals_of_finer_bodies_are_within_a_degree() {
    assert_within_a_degree(128);
    assert_within_a_degree(256);
}
