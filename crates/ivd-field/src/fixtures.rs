//! Grids, fields and lattices that several tests share.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::collections::BTreeMap;

use ivd_core::{
    Displacement, ElementKey, Exec, FieldBricks, Grid, Lattice, LatticeSource, Mask, VoxelCoord, VoxelIndex,
};
use nalgebra::Vector3;

use crate::inverse::from_bricks;
use crate::sampler::{brick_at, brick_voxels};

/// A grid with unequal spacing, a rotated and sheared direction, left-handed, far from the origin.
pub fn sheared_grid(dims: [usize; 3]) -> Grid {
    let x = Vector3::new(0.96, 0.28, 0.0);
    let y = Vector3::new(-0.28, 0.96, 0.0);
    let z = Vector3::new(0.1, 0.2, -1.0).normalize();
    Grid::new(dims, [0.5, 0.7, 2.0], [1e4, -300.0, 42.0], [x.into(), y.into(), z.into()]).unwrap()
}

/// The field `u` (mm) of a world position relative to the grid's origin (mm), sampled at every voxel.
pub fn field(grid: &Grid, u: impl Fn(Vector3<f64>) -> Vector3<f64>) -> FieldBricks {
    let bricks = grid.dims().map(|n| n.div_ceil(8));
    let all: Vec<usize> = (0..bricks.iter().product()).collect();
    let vectors = all.iter().map(|&b| {
        let mut out = vec![[0.0_f32; 3]; FieldBricks::VOXELS].into_boxed_slice();
        for (slot, voxel) in brick_voxels(grid.dims(), brick_at(bricks, b)) {
            out[slot] = u(grid.linear_part() * VoxelCoord::from(voxel).0).map(|c| c as f32).into();
        }
        out
    });
    from_bricks(grid.dims(), &all, vectors).unwrap()
}

/// A displacement with its inverse, uncertified.
pub fn displacement(grid: &Grid, forward: FieldBricks) -> Displacement {
    let inverse = crate::inverse::invert(&forward, grid, &Exec::default()).unwrap();
    Displacement::new(grid.clone(), forward, inverse.field)
        .unwrap()
        .with_inverse_residual_max(inverse.residual_max_voxels)
}

/// A smooth bump: `push` at `centre` (relative to the origin), 0 with its slope from `radius` on (mm).
pub fn bump(centre: Vector3<f64>, radius: f64, push: Vector3<f64>) -> impl Fn(Vector3<f64>) -> Vector3<f64> {
    move |p| {
        let t = (p - centre).norm() / radius;
        if t < 1.0 { push * (1.0 - t * t).powi(3) } else { Vector3::zeros() }
    }
}

/// Position of the middle of a grid relative to its origin (mm).
pub fn middle(grid: &Grid) -> Vector3<f64> {
    grid.linear_part() * Vector3::from(grid.dims()).map(|n| (n as f64 - 1.0) / 2.0)
}

/// All voxels of a grid.
pub fn voxels(grid: &Grid) -> impl Iterator<Item = VoxelIndex> + '_ {
    (0..grid.len()).map(|i| grid.index(i))
}

/// A vertex's place in its cell, scattered so that no voxel has two nearest points.
fn place(key: ElementKey) -> [f32; 3] {
    let hash = key.0.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    [8, 28, 48].map(|shift| 0.4 + 0.2 * (hash >> shift & 0xffff) as f32 / 65_536.0)
}

/// A closed lattice round the voxels where `level` (of the position relative to the origin, in mm) is positive, and the
/// mask of those voxels: a vertex in every cell that the surface crosses, a quad for every crossed edge.
pub fn lattice(grid: &Grid, level: impl Fn(Vector3<f64>) -> f64) -> (Lattice, Mask) {
    let dims = grid.dims();
    let inside: Vec<u8> =
        voxels(grid).map(|v| u8::from(level(grid.linear_part() * VoxelCoord::from(v).0) > 0.0)).collect();
    let at = |p: [i64; 3]| {
        (0..3).all(|a| (0..dims[a] as i64).contains(&p[a]))
            && inside[grid.linear(VoxelIndex(p.map(|c| c as usize)))] == 1
    };
    let mut crossed: BTreeMap<ElementKey, u32> = BTreeMap::new();
    let mut quads: Vec<([ElementKey; 4], bool)> = Vec::new();
    let key = |cell: [i64; 3]| ElementKey::new(dims, cell.map(|c| (c + 1) as usize), 6);
    let n = dims.map(|d| d as i64);
    for z in -1..n[2] {
        for y in -1..n[1] {
            for x in -1..n[0] {
                for axis in 0..3 {
                    let p = [x, y, z];
                    let mut q = p;
                    q[axis] += 1;
                    if at(p) == at(q) {
                        continue;
                    }
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let around = [[-1, -1], [0, -1], [0, 0], [-1, 0]].map(|[du, dv]| {
                        let mut c = p;
                        c[u] += du;
                        c[v] += dv;
                        key(c)
                    });
                    crossed.extend(around.map(|k| (k, 0)));
                    quads.push((around, at(p)));
                }
            }
        }
    }
    crossed.values_mut().zip(0..).for_each(|(slot, i)| *slot = i);
    let flip = grid.linear_part().determinant() < 0.0;
    let triangles = quads
        .iter()
        .flat_map(|(q, outward)| {
            let [a, b, c, d] = q.map(|k| crossed[&k]);
            if *outward == flip { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] }
        })
        .collect();
    let places = crossed.keys().map(|k| place(*k)).collect();
    let lattice = Lattice::new(grid.clone(), crossed.into_keys().collect(), places, triangles)
        .unwrap()
        .with_source(LatticeSource::Mask);
    (lattice, Mask::new(grid.clone(), inside.into()).unwrap())
}
