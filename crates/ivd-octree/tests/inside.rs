//! Inside and outside of every voxel, where rays hit vertices and edges at every turn.

#![allow(clippy::unwrap_used, reason = "test values are sound")]

use ivd_core::{Classified, ErrorClass, Exec, Grid, Lattice, Mask, Volume, VoxelIndex, Voxels, noise};
use ivd_octree::{Error, inside};
use ivd_phantom::Shape;

use crate::lattices::{empty, grids, of_mask, of_volume, phantom, random_mask};

fn count_differences(lattice: &Lattice, truth: &[u8]) -> usize {
    let found = inside(lattice, &Exec::default()).expect("extracted lattices are closed");
    found.inside().iter().zip(truth).filter(|(a, b)| a != b).count()
}

#[test]
fn a_mask_comes_back_from_its_lattice_voxel_for_voxel() {
    for (i, grid) in grids([9, 8, 7]).into_iter().enumerate() {
        for percent in [3, 30, 50, 70, 97, 100] {
            let mask = random_mask(&grid, i as u64, percent);
            assert_eq!(count_differences(&of_mask(&mask), mask.inside()), 0, "{percent} %");
        }
    }
}

#[test]
fn phantoms_come_back_from_their_isosurface() {
    for grid in grids([33; 3]) {
        for shape in Shape::ALL {
            let volume = phantom(shape, &grid);
            for iso in [100.0, 127.5, 128.0] {
                let at_or_above = |i| u8::from(volume.value(grid.index(i)) >= iso);
                let truth: Vec<u8> = (0..grid.len()).map(at_or_above).collect();
                assert_eq!(count_differences(&of_volume(&volume, iso), &truth), 0, "{shape} at {iso}");
            }
        }
    }
}

#[test]
fn specks_and_shells_of_one_voxel_are_kept_apart() {
    let grid = Grid::with_spacing([7, 7, 7], [1.0; 3]).unwrap();
    // A speck inside a hollow cube inside nothing, and one touching the volume's corner.
    let inside_at = |i: usize| {
        let v = grid.index(i).0;
        let ring = v.iter().map(|&c| c.abs_diff(3)).max().unwrap();
        u8::from(ring == 0 || ring == 2 || v == [0, 0, 0])
    };
    let truth: Vec<u8> = (0..grid.len()).map(inside_at).collect();
    let mask = Mask::new(grid.clone(), truth.clone().into()).unwrap();
    assert_eq!(count_differences(&of_mask(&mask), &truth), 0);
}

#[test]
fn an_empty_lattice_has_nothing_inside() {
    let lattice = empty();
    assert_eq!(inside(&lattice, &Exec::default()).unwrap().count(), 0);
}

#[test]
fn an_open_lattice_is_refused_with_its_row() {
    let grid = Grid::with_spacing([5, 5, 5], [1.0; 3]).unwrap();
    let mut voxels = vec![0; 125];
    voxels[grid.linear(VoxelIndex([2, 3, 1]))] = 1;
    let lattice = of_mask(&Mask::new(grid, voxels.into()).unwrap());
    let whole = lattice.triangles();
    let mut refused = 0;
    for removed in 0..whole.len() {
        let mut triangles = whole.to_vec();
        triangles.remove(removed);
        let lattice = lattice.clone().with_triangles(triangles.into()).unwrap();
        // A ray that hits the hole tells; an octahedron's corners are hit through one triangle each.
        if let Err(error) = inside(&lattice, &Exec::default()) {
            assert!(matches!(error, Error::Open { row: [3, 1], surplus: 1 | -1 }), "{error}");
            assert_eq!(error.error_class(), ErrorClass::Input);
            refused += 1;
        }
    }
    assert_eq!(refused, 2, "the ray enters through one triangle and leaves through one");
}

#[test]
fn threads_do_not_change_the_result() {
    let grid = &grids([33; 3])[2];
    let lattice = of_volume(&phantom(Shape::Gyroid, grid), 127.0);
    let one = inside(&lattice, &Exec::default().with_threads(1)).unwrap();
    assert_eq!(inside(&lattice, &Exec::default().with_threads(4)).unwrap(), one);
}

#[test]
fn integer_fields_with_ties_come_back() {
    for case in 0..300_u64 {
        let values: Vec<u8> = (0..60).map(|i| noise::below(case, i, 4) as u8).collect();
        let iso = [1.0, 1.5, 2.0][noise::below(case, 60, 3) as usize];
        let grid = Grid::with_spacing([5, 4, 3], [1.0, 2.0, 0.5]).unwrap();
        let truth: Vec<u8> = values.iter().map(|&v| u8::from(f64::from(v) >= iso)).collect();
        let volume = Volume::new(grid, Voxels::from(values)).unwrap();
        assert_eq!(count_differences(&of_volume(&volume, iso), &truth), 0, "case {case} at {iso}");
    }
}
