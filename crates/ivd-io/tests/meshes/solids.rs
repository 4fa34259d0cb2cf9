//! Lattices and meshes to write, read and put on grids.

use ivd_core::Mesh;
use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use nalgebra::Vector3;

pub(crate) fn hash(i: u64) -> u64 {
    ivd_core::noise::bits(0, i)
}

/// The surface where a function of the voxel is 0.5.
pub(crate) fn cut(grid: &Grid, value: impl Fn(Vector3<f64>) -> f64) -> Lattice {
    let voxels: Vec<f32> =
        (0..grid.len()).map(|i| value(Vector3::from(grid.index(i).0.map(|c| c as f64))) as f32).collect();
    let volume = Volume::new(grid.clone(), Voxels::from(voxels)).unwrap();
    extract(&volume, None, &ExtractParams { iso: Iso::Value(0.5) }, &Exec::default()).unwrap().lattice
}

/// Random reals: specks, tunnels and cells with vertices in their middle.
pub(crate) fn random(grid: &Grid, seed: u64) -> Lattice {
    let n = grid.dims().map(|n| n as u64);
    cut(grid, |p| {
        let at = p.x as u64 + n[0] * (p.y as u64 + n[1] * p.z as u64);
        (hash(seed << 20 | at) % 10_000) as f64 / 10_000.0
    })
}

/// A ball in a hollow in a ball: three parts, one in the other.
pub(crate) fn nested() -> Lattice {
    let grid = Grid::new(
        [24; 3],
        [1.0, 0.8, 1.2],
        [5.0, -9.0, 2.0],
        [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    );
    cut(&grid.unwrap(), |p| {
        let r = (p - Vector3::repeat(11.6)).norm();
        if r > 6.0 { 0.5 + (r - 7.5).min(10.0 - r) } else { 0.5 + 3.4 - r }
    })
}

/// The triangles of a lattice at its positions, without addresses.
pub(crate) fn mesh(lattice: &Lattice) -> Mesh {
    Mesh { positions: lattice.positions(), triangles: lattice.triangles().to_vec(), addresses: None }
}

/// A mesh of the given positions.
pub(crate) fn of(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Mesh {
    Mesh {
        positions: positions.iter().map(|p| Vector3::from(*p)).collect(),
        triangles: triangles.to_vec(),
        addresses: None,
    }
}

/// Corners of a box from `low` to `high`, and its twelve triangles on vertices from `first`.
pub(crate) fn cuboid(low: [f64; 3], high: [f64; 3], first: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corners = (0..8_usize)
        .map(|c| std::array::from_fn(|a| if c >> a & 1 == 1 { high[a] } else { low[a] }))
        .collect();
    let quads: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    (corners, triangles.map(|t| t.map(|v| v + first)).collect())
}

/// A triangle with its least vertex first.
pub(crate) fn turned([a, b, c]: [u32; 3]) -> [u32; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}
