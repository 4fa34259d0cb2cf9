//! The nearest lattice point through the octree is that of a loop over all triangles.

#![allow(clippy::unwrap_used, reason = "test values are sound")]

use ivd_core::{Error as CoreError, Exec, Lattice, noise};
use ivd_octree::{Error, Nearest, NearestIndex, Params, build, prepare};
use ivd_phantom::Shape;
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::lattices::{grids, of_mask, of_volume, phantom, random_mask};

fn index(lattice: &Lattice) -> NearestIndex {
    prepare(lattice, &build(lattice, &Params::default(), &Exec::default()).unwrap()).unwrap()
}

/// The plain twin: distance to a triangle as the least of that to its plane, where the foot lies in it, and its edges.
fn plain(lattice: &Lattice, positions: &[Vector3<f64>], point: Vector3<f64>) -> f64 {
    let to_edge = |a: Vector3<f64>, b: Vector3<f64>| {
        let t = ((point - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
        (point - a - (b - a) * t).norm()
    };
    let to_triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let (u, v) = (b - a, c - a);
        let gram = Matrix2::new(u.dot(&u), u.dot(&v), u.dot(&v), v.dot(&v));
        let foot = gram.try_inverse().map(|g| g * Vector2::new(u.dot(&(point - a)), v.dot(&(point - a))));
        let edges = to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a));
        match foot {
            Some(f) if f.x >= 0.0 && f.y >= 0.0 && f.x + f.y <= 1.0 => {
                edges.min((point - a - u * f.x - v * f.y).norm())
            }
            _ => edges,
        }
    };
    lattice.triangles().iter().map(to_triangle).fold(f64::INFINITY, f64::min)
}

/// Points in and around the volume.
fn points(lattice: &Lattice, count: u64) -> impl Iterator<Item = Vector3<f64>> {
    let linear = lattice.grid().linear_part();
    let dims = Vector3::from(lattice.grid().dims().map(|n| n as f64));
    (0..count).map(move |i| {
        let unit = Vector3::from_fn(|a, _| noise::unit(a as u64, i));
        linear * (unit * 1.6 - Vector3::repeat(0.3)).component_mul(&dims)
    })
}

fn samples() -> Vec<Lattice> {
    let mut all: Vec<Lattice> = grids([9, 8, 12]).iter().map(|g| of_mask(&random_mask(g, 1, 20))).collect();
    all.extend(grids([21; 3]).iter().map(|g| of_volume(&phantom(Shape::Torus, g), 127.0)));
    all
}

#[test]
fn distances_equal_a_loop_over_all_triangles_on_every_grid() {
    for lattice in samples() {
        let index = index(&lattice);
        let positions = lattice.local_positions();
        for point in points(&lattice, 300) {
            let found = index.nearest(point, f64::INFINITY).unwrap();
            let due = plain(&lattice, &positions, point);
            assert!((found.distance_mm - due).abs() <= 1e-9 * (1.0 + due), "{} and {due}", found.distance_mm);
            let corners = lattice.triangles()[found.triangle as usize].map(|v| positions[v as usize]);
            let weighted: Vector3<f64> = (0..3).map(|i| corners[i] * found.barycentric[i]).sum();
            assert!((weighted - found.point).norm() < 1e-12 * (1.0 + weighted.norm()));
            assert!(((found.point - point).norm() - found.distance_mm).abs() < 1e-12 * (1.0 + due));
            assert!((found.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn bounds_change_nothing_but_the_time() {
    for lattice in samples() {
        let index = index(&lattice);
        let same = |a: Option<Nearest>, b: Nearest| assert_eq!(a, Some(b));
        let mut last: Option<(Vector3<f64>, Nearest)> = None;
        for point in points(&lattice, 300) {
            let found = index.nearest(point, f64::INFINITY).unwrap();
            same(index.nearest(point, found.distance_mm), found);
            same(index.nearest(point, found.distance_mm * 1.5 + 1.0), found);
            assert_eq!(index.nearest(point, found.distance_mm * 0.999 - 1e-9), None);
            if let Some((before, nearest)) = last {
                let bound = nearest.distance_mm + (point - before).norm();
                same(index.nearest(point, bound * (1.0 + 1e-12)), found);
            }
            last = Some((point, found));
        }
    }
}

#[test]
fn ties_go_to_the_lowest_triangle_whatever_the_leaf_size() {
    let grid = &grids([9, 8, 12])[0];
    let lattice = of_mask(&random_mask(grid, 3, 15));
    let indices: Vec<NearestIndex> = [1, 4, 64]
        .map(|leaf_size| {
            let octree = build(&lattice, &Params { leaf_size }, &Exec::default()).unwrap();
            prepare(&lattice, &octree).unwrap()
        })
        .into();
    // At a vertex all triangles of its fan are as near.
    for (vertex, &position) in lattice.local_positions().iter().enumerate() {
        let lowest = lattice.triangles().iter().position(|t| t.contains(&(vertex as u32))).unwrap() as u32;
        for index in &indices {
            let found = index.nearest(position, f64::INFINITY).unwrap();
            assert_eq!((found.distance_mm, found.triangle), (0.0, lowest));
        }
    }
    // Voxel centres of a mask's lattice are as far from many triangles.
    for i in 0..grid.len() {
        let centre = grid.linear_part() * ivd_core::VoxelCoord::from(grid.index(i)).0;
        let found = indices[0].nearest(centre, f64::INFINITY);
        assert!(indices.iter().all(|index| index.nearest(centre, f64::INFINITY) == found));
    }
}

#[test]
fn far_points_empty_lattices_and_bad_numbers_have_an_answer() {
    let lattice = &samples()[4];
    let index = index(lattice);
    let far = Vector3::new(1e7, -2e7, 3e6);
    let due = plain(lattice, &lattice.local_positions(), far);
    assert!((index.nearest(far, f64::INFINITY).unwrap().distance_mm - due).abs() < 1e-6);
    assert_eq!(index.nearest(Vector3::new(f64::NAN, 0.0, 0.0), f64::INFINITY), None);
    assert_eq!(index.nearest(Vector3::zeros(), f64::NAN), None);
    let empty = lattice.subset(&[], vec![]).unwrap();
    let octree = build(&empty, &Params::default(), &Exec::default()).unwrap();
    assert_eq!(prepare(&empty, &octree).unwrap().nearest(far, f64::INFINITY), None);
}

#[test]
fn an_octree_of_another_lattice_is_refused() {
    let all = samples();
    let octree = build(&all[0], &Params::default(), &Exec::default()).unwrap();
    assert!(matches!(prepare(&all[1], &octree), Err(Error::Core(CoreError::Mismatch { .. }))));
    let fewer = all[0].clone().with_triangles(all[0].triangles()[1..].to_vec().into()).unwrap();
    assert!(matches!(prepare(&fewer, &octree), Err(Error::Core(CoreError::Mismatch { .. }))));
}
