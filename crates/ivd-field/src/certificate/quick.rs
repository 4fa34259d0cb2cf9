//! A cheap lower bound of the determinant in each cell of a brick, single precision, eight cells at a time where the processor can.
//!
//! Along an edge of a cell the map's derivative is the difference of two corners, and the four edges of a direction span an
//! interval for each component. Every Bernstein coefficient of the determinant is a mean of determinants whose columns are
//! such edges, so with `C` the intervals' middles and `R` their radii
//!
//! ```text
//! coefficient ≥ det C − (perm(|C| + R) − perm(|C|))
//! ```
//!
//! where `perm` is the permanent: what all six products can lose.
//!
//! The argument for the `unsafe` blocks: what needs AVX2 is called only where that was found.

use ivd_core::{FieldBricks, Grid, NO_BRICK};
use rayon::prelude::*;

use crate::sampler::brick_at;
use crate::simd::Eight;
#[cfg(target_arch = "x86_64")]
use crate::simd::WideEight;

/// Rounding of a coordinate (relative to the largest), and of the bound (relative to the permanent): several times what the few
/// operations on `f32` can lose.
const COORDINATE: f32 = 2e-6;
const BOUND: f32 = 1e-5;
/// Voxels along a block at most: those of a brick, one above it, and one below the first.
const MOST: usize = FieldBricks::SIDE + 2;
/// Cells at a time.
const LANES: usize = 8;
/// The corners of a cell's edges by direction; corner `i` has x in bit 0, y in bit 1, z in bit 2.
const EDGES: [[[usize; 2]; 4]; 3] =
    [[[0, 1], [2, 3], [4, 5], [6, 7]], [[0, 2], [1, 3], [4, 6], [5, 7]], [[0, 4], [1, 5], [2, 6], [3, 7]]];

/// Finds bounds brick by brick.
pub struct Quick<'a> {
    pub(super) field: &'a FieldBricks,
    pub(super) grid: &'a Grid,
    /// From world vectors to voxels.
    to_voxel: [[f32; 3]; 3],
    /// Largest sum of a row's sizes.
    row: f32,
    /// Whether something moves, by stored brick.
    moves: Vec<bool>,
    avx2: bool,
}

/// Room for a brick's work.
#[derive(Default)]
pub(super) struct Room {
    /// Displacements by component (voxels).
    by_axis: [Vec<f32>; 3],
    /// Bounds by the lowest corner.
    bounds: Vec<f32>,
    size: [usize; 3],
}

impl<'a> Quick<'a> {
    /// `native`: whether AVX2 may be used where it is there.
    pub fn new(field: &'a FieldBricks, grid: &'a Grid, native: bool) -> Self {
        let m = grid.inverse_linear_part();
        let avx2 = native && ivd_core::has_avx2();
        let sum = |a: usize| (0..3).map(|b| m[(a, b)].abs()).sum::<f64>();
        let row = (0..3).map(sum).fold(0.0, f64::max) as f32;
        let to_voxel = [0, 1, 2].map(|a| [0, 1, 2].map(|b| m[(a, b)] as f32));
        // Signs apart, all bits are 0 of what doesn't move; without an early end the compiler looks at several at a time.
        let any = |row: &[f32]| row.iter().fold(0, |any, c| any | c.to_bits() << 1) != 0;
        let moves = |brick: &[[f32; 3]]| brick.as_flattened().chunks(3 * 64).any(any);
        let moves = field.vectors().par_chunks(FieldBricks::VOXELS).with_min_len(16).map(moves).collect();
        Self { field, grid, to_voxel, row, moves, avx2 }
    }

    /// The least bound of the cells of a brick; infinite where nothing moves there.
    pub(super) fn least(&self, brick: usize, room: &mut Room) -> f32 {
        if !self.fill(brick, room) {
            return f32::INFINITY;
        }
        let mut least = f32::INFINITY;
        for row in room.rows() {
            for bound in row {
                least = if bound.is_nan() || *bound < least { *bound } else { least };
                if least.is_nan() {
                    return least;
                }
            }
        }
        least
    }

    /// Lower bounds of a brick's cells, x fastest, a cell less along every axis than voxels. Not a number where single precision
    /// doesn't hold it.
    pub(super) fn bounds(&self, brick: usize, room: &mut Room) -> Vec<f32> {
        if self.fill(brick, room) {
            room.rows().flatten().copied().collect()
        } else {
            vec![1.0; room.size.iter().map(|n| n - 1).product()]
        }
    }

    /// Fills the room with a brick's bounds; false where nothing moves.
    fn fill(&self, brick: usize, room: &mut Room) -> bool {
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: AVX2 was found.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            return unsafe { self.fill_avx2(brick, room) };
        }
        // SAFETY: plain numbers need nothing.
        #[allow(unsafe_code, reason = "argued in the module's head")]
        unsafe {
            self.fill_any::<[f32; 8]>(brick, room)
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_avx2(&self, brick: usize, room: &mut Room) -> bool {
        // SAFETY: there is AVX2.
        #[allow(unsafe_code, reason = "argued in the module's head")]
        unsafe {
            self.fill_any::<WideEight>(brick, room)
        }
    }

    /// # Safety
    ///
    /// The processor has what the lanes need.
    #[inline(always)]
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn fill_any<E: Eight>(&self, brick: usize, room: &mut Room) -> bool {
        let most = self.gather(brick, room);
        if most == 0.0 {
            return false;
        }
        let [nx, ny, nz] = room.size;
        // One more than the place of the last cell's lowest corner.
        let count = nx * ny * nz - (1 + nx + nx * ny);
        // Whole lanes.
        let lanes = count.div_ceil(LANES) * LANES;
        for axis in &mut room.by_axis {
            axis.resize(nx * ny * nz + LANES, 0.0);
        }
        room.bounds.resize(lanes, 0.0);
        let slack = COORDINATE * most * self.row;
        // SAFETY: the caller's.
        unsafe { determinants::<E>(&room.by_axis, [1, nx, nx * ny], slack, &mut room.bounds) };
        true
    }

    /// Reads the voxels of a brick's cells; gives the largest component (mm).
    #[inline(always)]
    fn gather(&self, brick: usize, room: &mut Room) -> f32 {
        let (dims, bricks) = (self.field.dims(), self.field.brick_dims());
        let at = brick_at(bricks, brick);
        let mut places = [[(0_usize, 0_usize); MOST]; 3];
        for a in 0..3 {
            let lo = if at[a] == 0 { -1 } else { (FieldBricks::SIDE * at[a]) as i64 };
            let hi = ((at[a] + 1) * FieldBricks::SIDE).min(dims[a]) as i64;
            room.size[a] = (hi - lo + 1) as usize;
            for (i, place) in places[a][..room.size[a]].iter_mut().enumerate() {
                let voxel = (lo + i as i64).clamp(0, dims[a] as i64 - 1) as usize;
                *place = (voxel / FieldBricks::SIDE, voxel % FieldBricks::SIDE);
            }
        }
        let [nx, ny, nz] = room.size;
        let (table, vectors) = (self.field.table(), self.field.vectors());
        let moves = |brick: usize| table[brick] != NO_BRICK && self.moves[table[brick] as usize];
        if !upper(bricks, brick).any(moves) {
            return 0.0;
        }
        let mut most = 0.0_f32;
        let [p, q, r] = self.to_voxel;
        for axis in &mut room.by_axis {
            axis.clear();
            axis.resize(nx * ny * nz, 0.0);
        }
        let [us, vs, ws] = &mut room.by_axis;
        let mut i = 0;
        for &(bz, z) in &places[2][..nz] {
            for &(by, y) in &places[1][..ny] {
                let row = bricks[0] * (by + bricks[1] * bz);
                for &(bx, x) in &places[0][..nx] {
                    let slot = table[bx + row];
                    if slot != NO_BRICK {
                        let [u, v, w] = vectors[slot as usize * FieldBricks::VOXELS + x + 8 * (y + 8 * z)];
                        most = larger(most, larger(u.abs(), larger(v.abs(), w.abs())));
                        us[i] = p[0] * u + p[1] * v + p[2] * w;
                        vs[i] = q[0] * u + q[1] * v + q[2] * w;
                        ws[i] = r[0] * u + r[1] * v + r[2] * w;
                    }
                    i += 1;
                }
            }
        }
        most
    }
}

impl Room {
    /// The bounds of the cells, row by row.
    fn rows(&self) -> impl Iterator<Item = &[f32]> {
        let [nx, ny, nz] = self.size;
        (0..nz - 1)
            .flat_map(move |z| (0..ny - 1).map(move |y| nx * (y + ny * z)))
            .map(move |row| &self.bounds[row..row + nx - 1])
    }
}

/// The bound at every voxel as a cell's lowest corner.
///
/// # Safety
///
/// The processor has what the lanes need.
#[inline(always)]
#[allow(unsafe_code, reason = "argued in the module's head")]
unsafe fn determinants<E: Eight>(
    by_axis: &[Vec<f32>; 3],
    [x, y, z]: [usize; 3],
    slack: f32,
    out: &mut [f32],
) {
    let offsets = [0, x, y, x + y, z, x + z, y + z, x + y + z];
    for (i, bounds) in out.chunks_exact_mut(LANES).enumerate() {
        // SAFETY: the caller's.
        let zero = unsafe { E::load(&[0.0; LANES]) };
        let (half, one, slack) = (zero.all(0.5), zero.all(1.0), zero.all(slack));
        // Middles, sizes of middles, and those with radii, by component and direction.
        let mut c = [[zero; 3]; 3];
        let mut p = [[zero; 3]; 3];
        let mut w = [[zero; 3]; 3];
        for b in 0..3 {
            let mut corner = [zero; 8];
            for k in 0..8 {
                let from = &by_axis[b][LANES * i + offsets[k]..];
                // SAFETY: the caller's.
                corner[k] = unsafe { E::load(from.first_chunk().expect("padded by a chunk")) };
            }
            for a in 0..3 {
                let [d0, d1] = [edge(&corner, a, 0), edge(&corner, a, 1)];
                let [d2, d3] = [edge(&corner, a, 2), edge(&corner, a, 3)];
                let low = d0.least(d1).least(d2.least(d3));
                let high = d0.most(d1).most(d2.most(d3));
                let middle = half.times(low.plus(high));
                c[b][a] = if a == b { one.plus(middle) } else { middle };
                p[b][a] = c[b][a].size();
                w[b][a] = p[b][a].plus(half.times(high.minus(low)).plus(slack));
            }
        }
        let minors = [minor(&c, 1, 2), minor(&c, 0, 2), minor(&c, 0, 1)];
        let det = c[0][0].times(minors[0]).minus(c[0][1].times(minors[1])).plus(c[0][2].times(minors[2]));
        let wide = permanent(&w);
        let bound = det.minus(wide.minus(permanent(&p))).minus(zero.all(BOUND).times(wide));
        bounds.copy_from_slice(&bound.store());
    }
}

/// Edge `k` of those along an axis.
#[inline(always)]
fn edge<E: Eight>(corner: &[E; 8], axis: usize, k: usize) -> E {
    let [low, high] = EDGES[axis][k];
    corner[high].minus(corner[low])
}

/// That of the second and third row, and two columns.
#[inline(always)]
fn minor<E: Eight>(m: &[[E; 3]; 3], i: usize, j: usize) -> E {
    m[1][i].times(m[2][j]).minus(m[1][j].times(m[2][i]))
}

#[inline(always)]
fn permanent<E: Eight>(m: &[[E; 3]; 3]) -> E {
    let first = m[0][0].times(m[1][1].times(m[2][2]).plus(m[1][2].times(m[2][1])));
    let second = m[0][1].times(m[1][0].times(m[2][2]).plus(m[1][2].times(m[2][0])));
    let third = m[0][2].times(m[1][0].times(m[2][1]).plus(m[1][1].times(m[2][0])));
    first.plus(second).plus(third)
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// A brick and its upper neighbours: those that hold corners of its cells.
pub(super) fn upper(bricks: [usize; 3], brick: usize) -> impl Iterator<Item = usize> {
    let at = brick_at(bricks, brick);
    (0..8_usize).map(move |corner| {
        let near: [usize; 3] = std::array::from_fn(|a| (at[a] + (corner >> a & 1)).min(bricks[a] - 1));
        near[0] + bricks[0] * (near[1] + bricks[1] * near[2])
    })
}
