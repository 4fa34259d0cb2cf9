//! Several labels at once: each lattice closed and manifold, seams alike on both sides, nothing between parts that touch.

use std::collections::{BTreeMap, BTreeSet};

use ivd_core::{Exec, Grid, Labels, Lattice, Mask, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, Part, extract, extract_parts};
use nalgebra::Vector3;

use super::mesh::{area_and_volume, assert_closed_manifold, winding};
use super::{hash, noise};

fn labels(dims: [usize; 3], ids: Vec<u16>) -> Labels {
    Labels::new(Grid::with_spacing(dims, [1.0; 3]).unwrap(), ids.into(), Vec::new()).unwrap()
}

fn parts(labels: &Labels, ids: &[u16]) -> Vec<Part> {
    extract_parts(labels, ids, &Exec::default()).unwrap()
}

/// Places of a triangle's corners (voxels), as bits, from the least on.
fn places(lattice: &Lattice, t: [u32; 3]) -> [[u64; 3]; 3] {
    let mut corners = t.map(|v| <[f64; 3]>::from(lattice.voxel(v as usize).0).map(f64::to_bits));
    let least = (0..3).min_by_key(|&k| corners[k]).unwrap();
    corners.rotate_left(least);
    corners
}

/// Every triangle has a label inside; outside is the label whose lattice has it turned over, else nothing. Returns how many
/// triangles two parts share.
fn assert_seams_coincide(parts: &[Part], context: &str) -> usize {
    let mut sides: BTreeMap<[[u64; 3]; 3], u16> = BTreeMap::new();
    for part in parts {
        for &t in part.lattice.triangles() {
            let twice = sides.insert(places(&part.lattice, t), part.id);
            assert!(
                twice.is_none(),
                "{context}: {twice:?} and {} have one triangle the same way round",
                part.id
            );
        }
    }
    let turned = |[a, b, c]: [[u64; 3]; 3]| [a, c, b];
    sides.iter().filter(|(t, id)| sides.get(&turned(**t)).is_some_and(|other| other != *id)).count()
}

#[test]
fn random_labels_give_closed_manifolds_whose_seams_coincide() {
    for seed in 0..400 {
        let size = |axis: u64| 2 + (hash(seed * 3 + axis) % 7) as usize;
        let dims = [size(0), size(1), size(2)];
        let values = 2 + seed % 7;
        let ids: Vec<u16> = noise(seed, dims.iter().product(), values).into_iter().map(u16::from).collect();
        let labels = labels(dims, ids);
        let parts = parts(&labels, &[]);
        let context = format!("seed {seed}, {dims:?}, {values} labels");
        for part in &parts {
            assert_closed_manifold(&part.lattice, &context);
            assert_holds_its_voxels(&labels, part, &context);
        }
        assert_seams_coincide(&parts, &context);
        assert_no_room_is_left(&labels, &parts, &context);
    }
}

/// Along each grid edge with one end in the part there is one vertex, in its middle.
fn assert_holds_its_voxels(labels: &Labels, part: &Part, context: &str) {
    let dims = labels.grid().dims();
    let id = |at: [i64; 3]| {
        let inside = (0..3).all(|a| (0..dims[a] as i64).contains(&at[a]));
        inside.then(|| labels.ids()[labels.grid().linear(ivd_core::VoxelIndex(at.map(|c| c as usize)))])
    };
    let mut expected = BTreeSet::new();
    for z in -1..=dims[2] as i64 {
        for y in -1..=dims[1] as i64 {
            for x in -1..=dims[0] as i64 {
                for axis in 0..3 {
                    let mut to = [x, y, z];
                    to[axis] += 1;
                    let [a, b] = [[x, y, z], to].map(|at| id(at) == Some(part.id));
                    if a != b {
                        expected.insert(([x, y, z], axis as u8));
                    }
                }
            }
        }
    }
    let keys = part.lattice.keys().iter().filter(|key| key.element() < 3);
    let found: BTreeSet<_> = keys.map(|key| (key.voxel(dims), key.element())).collect();
    assert_eq!(found, expected, "{context}, label {}", part.id);
}

/// No room between voxels is left out: the parts together wind once around every place there.
fn assert_no_room_is_left(labels: &Labels, parts: &[Part], context: &str) {
    if labels.ids().contains(&0) {
        return;
    }
    let dims = labels.grid().dims();
    for i in 0..6 {
        let share = |axis: u64| (hash(i * 3 + axis) % 9973) as f64 / 9973.0;
        let at = Vector3::from_fn(|a, _| share(a as u64) * (dims[a] - 1) as f64);
        let sum: f64 = parts.iter().map(|part| winding(&part.lattice, at)).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{context}: {at:?} is in the parts {sum} times");
    }
}

#[test]
fn one_label_crosses_the_edges_that_its_mask_crosses_and_winds_around_its_voxels() {
    for seed in 0..20 {
        let dims = [6, 5, 7];
        let inside = noise(seed, 210, 2);
        let labels = labels(dims, inside.iter().map(|&v| u16::from(v)).collect());
        let grid = labels.grid().clone();
        let volume = Volume::new(grid.clone(), Voxels::from(inside.clone())).unwrap();
        let mask = Mask::new(grid.clone(), inside.clone().into()).unwrap();
        let params = ExtractParams { iso: Iso::Mask };
        let expected = extract(&volume, Some(&mask), &params, &Exec::default()).unwrap().lattice;
        let found = &parts(&labels, &[1])[0].lattice;
        let edges =
            |l: &Lattice| -> Vec<_> { l.keys().iter().filter(|k| k.element() < 3).copied().collect() };
        assert_eq!(edges(found), edges(&expected), "seed {seed}");
        for (i, inside) in inside.iter().enumerate() {
            let at = Vector3::from(grid.index(i).0.map(|c| c as f64));
            assert!((winding(found, at) - f64::from(*inside)).abs() < 1e-6, "seed {seed}, voxel {at:?}");
        }
    }
}

#[test]
fn columns_of_labels_side_by_side_share_their_walls() {
    // 2 × 2 columns of four labels: an edge along z on which all meet.
    for n in [1, 2, 7] {
        let ids: Vec<u16> = (0..4 * n).map(|i| (i % 4) as u16 + 1).collect();
        let parts = parts(&labels([2, 2, n], ids), &[]);
        assert_eq!(parts.len(), 4);
        let shared = assert_seams_coincide(&parts, "columns");
        assert!(shared >= 4 * 2 * n, "{shared} triangles on the walls of {n} layers");
        for part in &parts {
            assert_closed_manifold(&part.lattice, "columns");
            assert_eq!(part.lattice.keys().len() as i64 - part.lattice.triangles().len() as i64 / 2, 2);
        }
    }
}

#[test]
fn the_first_named_goes_through_where_two_cross() {
    let ids = vec![1, 2, 2, 1];
    let count = |order: &[u16]| -> Vec<u16> {
        let parts = parts(&labels([2, 2, 1], ids.clone()), order);
        let euler = |l: &Lattice| l.keys().len() as i64 - l.triangles().len() as i64 / 2;
        // Two spheres have 4, one has 2.
        parts.iter().filter(|p| euler(&p.lattice) == 4).map(|p| p.id).collect()
    };
    assert_eq!(count(&[1, 2]), [2]);
    assert_eq!(count(&[2, 1]), [1]);
}

#[test]
fn left_handed_and_turned_grids_keep_the_inside_within() {
    let ids: Vec<u16> = noise(5, 216, 4).into_iter().map(u16::from).collect();
    for direction in [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
        [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    ] {
        let grid = Grid::new([6; 3], [0.5, 1.0, 2.0], [1e6, -1e6, 3.0], direction).unwrap();
        let labels = Labels::new(grid, ids.clone().into(), Vec::new()).unwrap();
        for part in parts(&labels, &[]) {
            assert_closed_manifold(&part.lattice, "turned");
            assert!(area_and_volume(&part.lattice).1 > 0.0);
        }
    }
}

#[test]
fn the_same_for_any_number_of_threads() {
    let dims = [40, 33, 37];
    let ids: Vec<u16> = noise(9, dims.iter().product(), 5).into_iter().map(|v| u16::from(v) * 7).collect();
    let labels = labels(dims, ids);
    let first = extract_parts(&labels, &[], &Exec::default().with_threads(1)).unwrap();
    for threads in [2, 3, 8] {
        assert!(extract_parts(&labels, &[], &Exec::default().with_threads(threads)).unwrap() == first);
    }
}

#[test]
fn a_label_twice_or_no_data_is_refused() {
    let labels = labels([1, 1, 1], vec![1]);
    for (ids, text) in [(&[1, 2, 1][..], "1 is named twice"), (&[0][..], "no data")] {
        let error = extract_parts(&labels, ids, &Exec::default()).unwrap_err().to_string();
        assert!(error.contains(text), "{error}");
    }
    assert!(parts(&labels, &[4])[0].lattice.keys().is_empty(), "a label that no voxel has");
}
