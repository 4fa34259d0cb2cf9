//! From voxels to vertices and back.

use std::collections::BTreeMap;

use ivd_core::{Exec, Lattice};
use ivd_lattice::refine::{RefineParams, Target, collapse};

use crate::meshes::{grids, solids};

/// Every padded voxel, and some outside.
fn voxels(lattice: &Lattice) -> impl Iterator<Item = [i64; 3]> {
    let [nx, ny, nz] = lattice.grid().dims().map(|n| n as i64);
    (-3..nz + 3).flat_map(move |z| (-3..ny + 3).flat_map(move |y| (-3..nx + 3).map(move |x| [x, y, z])))
}

fn assert_both_ways(lattice: &Lattice) {
    let mut met = Vec::new();
    let mut round: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    for v in 0..lattice.keys().len() as u32 {
        let told = lattice.describe(v);
        assert!(lattice.vertices_of_voxel(told.voxel).contains(&v));
        assert_eq!(told.voxels[0], told.voxel);
        assert_eq!(told.voxels.len(), if told.element.starts_with("edge") { 2 } else { 8 });
        // The vertex lies in the box of its voxels.
        let at = lattice.voxel(v as usize).0;
        for axis in 0..3 {
            let ends = told.voxels.iter().map(|p| p[axis]);
            let (low, high) = (ends.clone().min().unwrap() as f64, ends.max().unwrap() as f64);
            assert!(low <= at[axis] && at[axis] <= high, "vertex {v} of {}", told.element);
            assert_eq!(told.voxel[axis] as f64 + f64::from(told.place[axis]), at[axis]);
        }
        assert_eq!(told.world, lattice.world(v as usize));
        for voxel in told.voxels {
            round.entry(voxel).or_default().push(v);
        }
    }
    for voxel in voxels(lattice) {
        let found = lattice.vertices_of_voxel(voxel);
        assert!(found.len() <= 8);
        assert!(found.clone().all(|v| lattice.describe(v).voxel == voxel));
        met.extend(found);
        assert_eq!(
            lattice.vertices_touching_voxel(voxel),
            round.remove(&voxel).unwrap_or_default(),
            "{voxel:?}"
        );
    }
    assert!(round.is_empty());
    met.sort_unstable();
    assert!(met.into_iter().eq(0..lattice.keys().len() as u32), "every vertex is of one voxel");
}

#[test]
fn every_vertex_is_found_by_its_voxel_and_the_other_way_round() {
    for (i, grid) in grids().iter().enumerate() {
        let lattice = solids::random(grid, 11 + i as u64);
        assert_both_ways(&lattice);
        let params = RefineParams { target: Target::Ratio(0.3).into(), ..RefineParams::default() };
        let refined = collapse(&lattice, &params, &Exec::default()).unwrap().lattice;
        assert!(refined.keys().len() < lattice.keys().len());
        assert_both_ways(&refined);
        // What is left is what it was.
        for v in 0..refined.keys().len() as u32 {
            let old = lattice.vertex_at(refined.keys()[v as usize]).unwrap();
            let (now, then) = (refined.describe(v), lattice.describe(old));
            assert_eq!((now.voxels, now.place, now.world), (then.voxels, then.place, then.world));
        }
    }
}

#[test]
fn voxels_far_outside_have_no_vertices() {
    let lattice = solids::random(&grids()[0], 1);
    for far in [i64::MIN, -2, 1 << 40, i64::MAX] {
        for axis in 0..3 {
            let mut voxel = [1; 3];
            voxel[axis] = far;
            assert!(lattice.vertices_of_voxel(voxel).is_empty());
            assert!(lattice.vertices_touching_voxel(voxel).is_empty());
        }
    }
}
