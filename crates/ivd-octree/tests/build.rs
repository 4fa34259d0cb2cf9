//! The octree covers space once, knows in from out, and loses no triangle.

#![allow(clippy::unwrap_used, reason = "test values are sound")]

use ivd_core::{Exec, Grid, Lattice, Octree, OctreeNode};
use ivd_octree::{Error, Params, build, inside};
use ivd_phantom::Shape;
use nalgebra::Vector3;

use crate::lattices::{empty, grids, of_mask, of_volume, phantom, random_mask};

fn samples() -> Vec<Lattice> {
    let mut all: Vec<Lattice> = grids([9, 8, 12]).iter().map(|g| of_mask(&random_mask(g, 1, 20))).collect();
    all.extend(grids([21; 3]).iter().map(|g| of_volume(&phantom(Shape::Torus, g), 127.0)));
    all
}

fn tree(lattice: &Lattice, leaf_size: u32) -> Octree {
    build(lattice, &Params { leaf_size }, &Exec::default()).unwrap()
}

#[test]
fn leaves_cover_the_root_once_in_morton_order() {
    for lattice in samples() {
        for leaf_size in [1, 2, 4, 8] {
            let octree = tree(&lattice, leaf_size);
            let mut covered = 0_u64;
            // Each level's nodes in Morton order: walk the queue and check each node's place against its number.
            let mut level = vec![(0_u32, [0_u32; 3])];
            for depth in 0..=octree.depth() {
                let size = 1_u64 << (octree.depth() - depth);
                let mut next = Vec::new();
                for (i, pair) in level.windows(2).enumerate() {
                    assert!(pair[0].0 + 1 == pair[1].0, "node {i} of level {depth}");
                }
                for &(index, at) in &level {
                    match octree.node(index) {
                        OctreeNode::Internal { first_child } => next.extend((0..8).map(|octant| {
                            let corner =
                                std::array::from_fn(|a| at[a] + ((octant >> a & 1) * size as u32 / 2));
                            (first_child + octant, corner)
                        })),
                        OctreeNode::Surface { .. } => {
                            assert_eq!(size, u64::from(leaf_size));
                            covered += size.pow(3);
                        }
                        OctreeNode::Inside | OctreeNode::Outside => covered += size.pow(3),
                    }
                }
                level = next;
            }
            assert!(level.is_empty());
            assert_eq!(covered, 1 << (3 * octree.depth()));
        }
    }
}

#[test]
fn homogeneous_leaves_agree_with_every_voxel_in_them() {
    for lattice in samples() {
        let mask = inside(&lattice, &Exec::default()).unwrap();
        let dims = lattice.grid().dims();
        let octree = tree(&lattice, 2);
        let mut whole = [0, 0];
        for z in 0..dims[2] + 2 {
            for y in 0..dims[1] + 2 {
                for x in 0..dims[0] + 2 {
                    let at = [x, y, z];
                    let in_grid = (0..3).all(|a| (1..=dims[a]).contains(&at[a]));
                    let truth =
                        in_grid && mask.inside()[(x - 1) + dims[0] * ((y - 1) + dims[1] * (z - 1))] == 1;
                    match octree.locate(at).2 {
                        OctreeNode::Outside => assert!(!truth, "{at:?}"),
                        OctreeNode::Inside => assert!(truth, "{at:?}"),
                        _ => continue,
                    }
                    whole[usize::from(truth)] += 1;
                }
            }
        }
        assert!(whole[0] > 0);
    }
}

#[test]
fn every_triangle_is_listed_in_every_leaf_that_it_touches() {
    for lattice in samples() {
        for leaf_size in [1, 4] {
            let octree = tree(&lattice, leaf_size);
            for (index, triangle) in lattice.triangles().iter().enumerate() {
                let corners = triangle.map(|v| lattice.voxel(v as usize).0);
                for i in 0..=12 {
                    for j in 0..=12 - i {
                        let (u, v) = (f64::from(i) / 12.0, f64::from(j) / 12.0);
                        let point = corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
                        touches(&octree, point, index as u32);
                    }
                }
            }
        }
    }
}

/// A point of a triangle belongs to the leaf on each side of it.
fn touches(octree: &Octree, point: Vector3<f64>, triangle: u32) {
    for side in 0..8_u32 {
        let at = std::array::from_fn(|a| {
            let nudge = if side >> a & 1 == 1 { 1e-12 } else { -1e-12 };
            (point[a] + 1.5 + nudge).floor() as usize
        });
        let OctreeNode::Surface { slot } = octree.locate(at).2 else { panic!("no surface at {point}") };
        assert!(octree.leaf(slot).contains(&triangle), "triangle {triangle} at {point}");
    }
}

#[test]
fn an_empty_lattice_is_one_leaf_outside() {
    let lattice = empty();
    let octree = tree(&lattice, 4);
    assert_eq!((octree.nodes().len(), octree.node(0), octree.depth()), (1, OctreeNode::Outside, 3));
}

#[test]
fn a_leaf_larger_than_the_volume_is_the_root() {
    let lattice = &samples()[0];
    let octree = tree(lattice, 64);
    assert_eq!(
        (octree.nodes().len(), octree.node(0), octree.depth()),
        (1, OctreeNode::Surface { slot: 0 }, 6)
    );
    assert_eq!(octree.leaf_triangles().len(), lattice.triangles().len());
}

#[test]
fn threads_do_not_change_the_tree() {
    let lattice = &samples()[5];
    let with = |threads| build(lattice, &Params::default(), &Exec::default().with_threads(threads)).unwrap();
    assert_eq!(with(1), with(4));
}

#[test]
fn bad_leaf_sizes_long_axes_and_cancelling_are_told() {
    let lattice = &samples()[0];
    for leaf_size in [0, 3, 128] {
        assert!(matches!(
            build(lattice, &Params { leaf_size }, &Exec::default()),
            Err(Error::Core(ivd_core::Error::Param(_)))
        ));
    }
    let grid = Grid::with_spacing([1 << 21, 1, 1], [1.0; 3]).unwrap();
    let long = Lattice::new(grid, Vec::new().into(), Vec::new().into(), Vec::new().into()).unwrap();
    assert!(matches!(build(&long, &Params::default(), &Exec::default()), Err(Error::TooLarge { .. })));
    let exec = Exec::default();
    exec.cancel.cancel();
    assert!(matches!(
        build(lattice, &Params::default(), &exec),
        Err(Error::Core(ivd_core::Error::Cancelled))
    ));
}
