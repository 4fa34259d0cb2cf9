//! More than 2³² voxels in the arithmetic of indices, without the memory that they would take.

use ivd_core::{BrickIndex, ElementKey, Exec, FieldBricks, Grid, Lattice, NO_BRICK, VoxelIndex};
use ivd_field::certificate::certify;
use ivd_field::inverse::invert;
use ivd_tests::stability::meshes;
use nalgebra::Vector3;

/// 2³³ voxels in few rows.
const LONG: [usize; 3] = [1 << 20, 1 << 7, 1 << 6];

#[test]
fn linear_indices_and_bricks_go_beyond_two_to_the_32() {
    for dims in [LONG, [4096, 4096, 4096], [5000, 3000, 70_001], [1, 1 << 20, 1 << 21]] {
        let grid = Grid::with_spacing(dims, [0.5, 1.0, 2.0]).unwrap();
        let voxels: u128 = dims.iter().map(|&d| d as u128).product();
        assert!(voxels > 1 << 32);
        assert_eq!(grid.len() as u128, voxels);
        let last = dims.map(|n| n - 1);
        for at in [last, [0, last[1], last[2]], [last[0], 0, last[2]], [last[0] / 3, last[1] / 2, last[2]]] {
            let plain = at[0] as u128 + dims[0] as u128 * (at[1] as u128 + dims[1] as u128 * at[2] as u128);
            let linear = grid.linear(VoxelIndex(at));
            assert_eq!(linear as u128, plain);
            assert_eq!(grid.index(linear), VoxelIndex(at));
        }
        let bricks: u128 = dims.iter().map(|&d| d.div_ceil(8) as u128).product();
        assert_eq!(BrickIndex::dims_for(dims).iter().map(|&n| n as u128).product::<u128>(), bricks);
    }
    let most = isize::MAX as usize / 64;
    assert!(Grid::with_spacing([most, 1, 1], [1.0; 3]).is_ok());
    assert!(Grid::with_spacing([most, 2, 1], [1.0; 3]).is_err());
}

#[test]
fn addresses_of_vertices_are_unique_and_ascend_to_the_far_corner() {
    for dims in [LONG, [4096; 3], [520_000; 3]] {
        let far = dims.map(|n| n + 1);
        let padded = |p: [usize; 3]| {
            let [nx, ny] = [dims[0] as u128 + 2, dims[1] as u128 + 2];
            p[0] as u128 + nx * (p[1] as u128 + ny * p[2] as u128)
        };
        let mut last = None;
        for at in [[0, 0, 0], [far[0], 0, 0], [0, far[1], 0], [1, 0, far[2]], far] {
            for element in 0..8 {
                let key = ElementKey::new(dims, at, element);
                assert_eq!(u128::from(key.0), padded(at) * 8 + u128::from(element));
                assert_eq!((key.padded(dims), key.element()), (at, element));
                assert!(last < Some(key), "addresses ascend");
                last = Some(key);
            }
        }
    }
}

/// A lattice round a voxel at the far end of a grid of 2³³ voxels.
fn far() -> Lattice {
    let grid = Grid::with_spacing(LONG, [0.25, 1.0, 1.5]).unwrap();
    let near_the_end = LONG.map(|n| n as f64 - 5.0 + 0.3);
    meshes::islands(&grid, &[near_the_end], 2.2)
}

#[test]
fn an_octree_is_built_and_searched_beyond_two_to_the_32() {
    let (lattice, exec) = (far(), Exec::default());
    let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec).unwrap();
    let index = ivd_octree::prepare(&lattice, &octree).unwrap();
    let middle = LONG.map(|n| n - 5);
    assert!(!matches!(octree.locate(middle.map(|c| c + 1)).2, ivd_core::OctreeNode::Outside));
    assert!(matches!(octree.locate([3, 3, 3]).2, ivd_core::OctreeNode::Outside));
    let (positions, point) = (lattice.local_positions(), Vector3::new(2.6e5, 140.0, 88.0));
    let near = index.nearest(point, f64::INFINITY).unwrap();
    let plain = positions.iter().map(|p| (p - point).norm()).fold(f64::INFINITY, f64::min);
    // The nearest point is no further than the nearest corner, and within one edge of it.
    assert!(near.distance_mm <= plain && near.distance_mm >= plain - 4.0, "{} and {plain}", near.distance_mm);
}

#[test]
fn a_field_is_certified_and_inverted_beyond_two_to_the_32() {
    let grid = Grid::with_spacing(LONG, [0.25, 1.0, 1.5]).unwrap();
    let bricks = LONG.map(|n| n / 8);
    let total: usize = bricks.iter().product();
    let mut table = vec![NO_BRICK; total];
    // The brick before the last along every axis, a bump in its middle.
    let brick = bricks[0] - 2 + bricks[0] * (bricks[1] - 2 + bricks[1] * (bricks[2] - 2));
    table[brick] = 0;
    let bump = |i: usize| {
        let d = [i % 8, i / 8 % 8, i / 64].map(|c| (c as f32 - 3.5).abs() / 3.5);
        let w: f32 = d.iter().map(|c| 1.0 - c * c).product();
        [0.2 * w, -0.5 * w, 0.6 * w]
    };
    let forward = FieldBricks::new(LONG, table, (0..512).map(bump).collect::<Vec<_>>().into()).unwrap();
    let exec = Exec::default();
    let certificate = certify(&forward, &grid, 0.05, |_| true, &exec).unwrap();
    assert!(certificate.holds() && certificate.min_det < 1.0, "{}", certificate.min_det);
    let inverse = invert(&forward, &grid, &exec).unwrap();
    assert_eq!(inverse.field.stored(), 1);
    // Coordinates near 10⁶ leave 10⁻¹⁰ of a voxel; what is stored in `f32` leaves 10⁻⁷.
    assert!(inverse.residual_max_voxels < 1e-6, "{}", inverse.residual_max_voxels);
    let at = VoxelIndex(std::array::from_fn(|a| 8 * (bricks[a] - 2) + 3));
    assert_ne!(inverse.field.at(at), [0.0; 3]);
}
