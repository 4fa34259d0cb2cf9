//! A field read between its voxels, and the bricks that it is made of.

use ivd_core::{FieldBricks, Grid, NO_BRICK, VoxelIndex};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Reads a sparse field in *voxel units*, trilinear, with its cells.
///
/// Space is cut into cells `c` with corners at the voxels `c` and `c + 1`, `c ≥ −1` on every axis; corners outside the
/// grid take the nearest border voxel's vector, so the cells −1 and n − 1 carry the constant continuation of the field
/// (and a grid of one slice has cells at all).
pub struct Sampler<'a> {
    field: &'a FieldBricks,
    dims: [usize; 3],
    bricks: [usize; 3],
    to_voxel: Matrix3<f64>,
    /// All stored vectors in voxels, where they are read often.
    ready: Vec<Vector3<f64>>,
}

/// The displacements (voxels) at the eight corners of a cell; corner `i` has x in bit 0, y in bit 1, z in bit 2.
pub type Corners = [Vector3<f64>; 8];

impl<'a> Sampler<'a> {
    /// Of a field on its grid.
    pub fn new(field: &'a FieldBricks, grid: &Grid) -> Self {
        Self {
            field,
            dims: field.dims(),
            bricks: field.brick_dims(),
            to_voxel: grid.inverse_linear_part(),
            ready: Vec::new(),
        }
    }

    /// As [`Sampler::new`], with all stored vectors turned to voxels now: for who reads most of them several times.
    pub fn ready(field: &'a FieldBricks, grid: &Grid) -> Self {
        let mut sampler = Self::new(field, grid);
        let to_voxels = |v: &[f32; 3]| sampler.in_voxels(Vector3::from(*v));
        sampler.ready = field.vectors().par_iter().with_min_len(1 << 12).map(to_voxels).collect();
        sampler
    }

    #[inline]
    fn in_voxels(&self, v: Vector3<f32>) -> Vector3<f64> {
        if v == Vector3::zeros() { Vector3::zeros() } else { self.to_voxel * v.map(f64::from) }
    }

    /// Voxels of the grid.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Displacement at a voxel (voxels); beyond the grid that of the nearest border voxel.
    #[inline]
    pub fn voxel(&self, at: [i64; 3]) -> Vector3<f64> {
        self.raw(std::array::from_fn(|a| at[a].clamp(0, self.dims[a] as i64 - 1) as usize))
    }

    #[inline]
    fn raw(&self, [x, y, z]: [usize; 3]) -> Vector3<f64> {
        let slot = self.field.table()[x / 8 + self.bricks[0] * (y / 8 + self.bricks[1] * (z / 8))];
        if slot == NO_BRICK {
            return Vector3::zeros();
        }
        let at = slot as usize * FieldBricks::VOXELS + x % 8 + 8 * (y % 8 + 8 * (z % 8));
        match self.ready.get(at) {
            Some(v) => *v,
            None => self.in_voxels(self.field.vectors()[at].into()),
        }
    }

    /// A cell's corners, where all vectors are ready and these lie in one brick.
    #[inline]
    fn in_one_brick(&self, cell: [i64; 3]) -> Option<Corners> {
        let fits = |a: usize| cell[a] >= 0 && cell[a] & 7 != 7 && cell[a] + 1 < self.dims[a] as i64;
        if self.ready.is_empty() || !(fits(0) && fits(1) && fits(2)) {
            return None;
        }
        let [x, y, z] = cell.map(|c| c as usize);
        let slot = self.field.table()[x / 8 + self.bricks[0] * (y / 8 + self.bricks[1] * (z / 8))];
        if slot == NO_BRICK {
            return Some([Vector3::zeros(); 8]);
        }
        let first = slot as usize * FieldBricks::VOXELS + x % 8 + 8 * (y % 8 + 8 * (z % 8));
        let near = &self.ready[first..first + 74];
        Some([0, 1, 8, 9, 64, 65, 72, 73].map(|i| near[i]))
    }

    /// What a cell stands for, from and to along each axis, counted from its lowest corner: 0 to 1, and without an end where
    /// it is an outermost one and the field beyond it is the same.
    pub fn room(&self, cell: [i64; 3]) -> [[f64; 2]; 3] {
        std::array::from_fn(|a| {
            let first = if cell[a] < 0 { f64::NEG_INFINITY } else { 0.0 };
            let last = if cell[a] + 1 >= self.dims[a] as i64 { f64::INFINITY } else { 1.0 };
            [first, last]
        })
    }

    /// Displacements at the corners of a cell.
    #[inline]
    pub fn corners(&self, cell: [i64; 3]) -> Corners {
        if let Some(corners) = self.in_one_brick(cell) {
            return corners;
        }
        std::array::from_fn(|i| {
            self.voxel([cell[0] + (i & 1) as i64, cell[1] + (i >> 1 & 1) as i64, cell[2] + (i >> 2) as i64])
        })
    }

    /// The cell that holds a voxel coordinate, and the place in it, 0…1 (beyond the grid the outermost cell, where the
    /// field is constant outwards, so the place is clamped).
    #[inline]
    pub fn locate(&self, x: Vector3<f64>) -> ([i64; 3], Vector3<f64>) {
        let mut cell = [0; 3];
        let mut place = Vector3::zeros();
        for a in 0..3 {
            let base = x[a].floor().clamp(-1.0, self.dims[a] as f64 - 1.0);
            cell[a] = base as i64;
            place[a] = (x[a] - base).clamp(0.0, 1.0);
        }
        (cell, place)
    }

    /// Displacement at a voxel coordinate (voxels).
    #[inline]
    pub fn at(&self, x: Vector3<f64>) -> Vector3<f64> {
        let (cell, place) = self.locate(x);
        interpolate(&self.corners(cell), place)
    }

    /// Largest |component| of the field along each voxel axis (voxels).
    pub fn max_per_axis(&self) -> Vector3<f64> {
        let mut most = Vector3::<f64>::zeros();
        for v in self.field.vectors() {
            if *v != [0.0; 3] {
                most = most.sup(&(self.to_voxel * Vector3::from(*v).map(f64::from)).abs());
            }
        }
        most
    }
}

/// Trilinear interpolation in a cell at `t`, each component 0…1.
#[inline]
pub fn interpolate(c: &Corners, t: Vector3<f64>) -> Vector3<f64> {
    let x: [Vector3<f64>; 4] = std::array::from_fn(|i| c[2 * i] * (1.0 - t.x) + c[2 * i + 1] * t.x);
    let y = [x[0] * (1.0 - t.y) + x[1] * t.y, x[2] * (1.0 - t.y) + x[3] * t.y];
    y[0] * (1.0 - t.z) + y[1] * t.z
}

/// Derivatives of the trilinear interpolant: column `a` is ∂u/∂xₐ.
#[inline]
pub fn gradient(c: &Corners, t: Vector3<f64>) -> Matrix3<f64> {
    let lerp = |p: Vector3<f64>, q: Vector3<f64>, s: f64| p * (1.0 - s) + q * s;
    let dx = lerp(lerp(c[1] - c[0], c[3] - c[2], t.y), lerp(c[5] - c[4], c[7] - c[6], t.y), t.z);
    let dy = lerp(lerp(c[2] - c[0], c[3] - c[1], t.x), lerp(c[6] - c[4], c[7] - c[5], t.x), t.z);
    let dz = lerp(lerp(c[4] - c[0], c[5] - c[1], t.x), lerp(c[6] - c[2], c[7] - c[3], t.x), t.y);
    Matrix3::from_columns(&[dx, dy, dz])
}

/// Coordinate of a brick by its linear index.
pub fn brick_at(bricks: [usize; 3], brick: usize) -> [usize; 3] {
    [brick % bricks[0], brick / bricks[0] % bricks[1], brick / (bricks[0] * bricks[1])]
}

/// The voxels of a brick that lie in the grid, with their index in the brick, in memory order.
pub fn brick_voxels(dims: [usize; 3], brick: [usize; 3]) -> impl Iterator<Item = (usize, VoxelIndex)> {
    let end: [usize; 3] = std::array::from_fn(|a| (dims[a] - 8 * brick[a]).min(8));
    (0..end[2]).flat_map(move |z| {
        (0..end[1]).flat_map(move |y| {
            (0..end[0]).map(move |x| {
                (x + 8 * (y + 8 * z), VoxelIndex([8 * brick[0] + x, 8 * brick[1] + y, 8 * brick[2] + z]))
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_turned_to_voxels_before_are_those_turned_when_read() {
        let grid = crate::fixtures::sheared_grid([17, 9, 12]);
        let field = crate::fixtures::field(&grid, |p| {
            Vector3::new(p.y.sin(), p.x * 0.1, if p.z > 6.0 { 0.0 } else { p.z })
        });
        let (plain, ready) = (Sampler::new(&field, &grid), Sampler::ready(&field, &grid));
        for z in -1..12 {
            for y in -1..9 {
                for x in -1..17 {
                    assert_eq!(plain.corners([x, y, z]), ready.corners([x, y, z]), "{x} {y} {z}");
                }
            }
        }
    }

    #[test]
    fn gradient_is_the_derivative_of_the_interpolant() {
        let c: Corners = std::array::from_fn(|i| {
            Vector3::new((i * i) as f64 * 0.1, (i as f64).sin(), ((i * 7) % 5) as f64)
        });
        let t = Vector3::new(0.3, 0.6, 0.2);
        for a in 0..3 {
            let mut h = Vector3::zeros();
            h[a] = 1e-6;
            let numeric = (interpolate(&c, t + h) - interpolate(&c, t - h)) / 2e-6;
            assert!((numeric - gradient(&c, t).column(a)).norm() < 1e-8);
        }
    }
}
