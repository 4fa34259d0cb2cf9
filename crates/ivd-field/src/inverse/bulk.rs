//! Newton's method for one voxel of a brick after another: what [`Solver::solve`] finds, by fewer steps from a better start, and leaving
//! to it whatever isn't plain.
//!
//! A start is what the voxels before lead to, in a straight line. Vectors are padded to four lanes, and the derivatives are made of the
//! differences that the value is made of.
//!
//! The argument for the `unsafe` blocks: what needs AVX2 is called only where that was found.

use std::ops::Range;

use ivd_core::{FieldBricks, Grid, NO_BRICK, VoxelIndex};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::residual::Worst;
use super::solve::{FOUND, FOUND_FAR, Solver};
use crate::sampler::brick_at;
use crate::simd::Four;
#[cfg(target_arch = "x86_64")]
use crate::simd::WideFour;

/// A vector; its last lane is 0.
type Padded = [f64; 4];

/// A residual at which a preimage counts as found, as a fraction of the vector: a sixteenth of what that loses as `f32`.
const KEPT: f64 = 3.725_290_298_461_914e-9;
/// Full steps from one start; the plain way takes over after that.
const STEPS: usize = 8;

/// A field that is inverted brick by brick.
pub(super) struct BrickSolver<'a> {
    forward: &'a FieldBricks,
    solver: &'a Solver<'a>,
    /// Vectors of the bricks that are solved and of the layers beside them, in voxels: others are made ready where they are asked for.
    ready: Vec<Padded>,
    /// The first slot of those, in vectors.
    first: usize,
    to_voxel: [[f64; 3]; 3],
    to_world: [[f64; 3]; 3],
    avx2: bool,
}

impl<'a> BrickSolver<'a> {
    /// - `solver`: the plain way.
    /// - `stored`: the stored bricks, ascending; `part`: those of them that are to be solved.
    /// - `native`: whether AVX2 may be used where it is there.
    pub(super) fn new(
        forward: &'a FieldBricks,
        grid: &Grid,
        solver: &'a Solver<'a>,
        stored: &[usize],
        part: Range<usize>,
        native: bool,
    ) -> Self {
        let avx2 = native && ivd_core::has_avx2();
        let rows = |m: nalgebra::Matrix3<f64>| [0, 1, 2].map(|a| [0, 1, 2].map(|b| m[(a, b)]));
        let to_voxel = rows(grid.inverse_linear_part());
        let [nx, ny, _] = forward.brick_dims();
        let [low, high] = [stored[part.start], stored[part.end - 1]].map(|brick| brick / (nx * ny));
        // Slots count up with the bricks.
        let slot = |layer: usize| stored.partition_point(|&brick| brick < layer * nx * ny);
        let (first, end) =
            (FieldBricks::VOXELS * slot(low.saturating_sub(1)), FieldBricks::VOXELS * slot(high + 2));
        let near = &forward.vectors()[first..end];
        let ready = near.par_iter().with_min_len(1 << 12).map(|v| times(&to_voxel, *v)).collect();
        let to_world = rows(grid.linear_part());
        Self { forward, solver, ready, first, to_voxel, to_world, avx2 }
    }

    /// A stored vector, in voxels.
    #[inline(always)]
    fn at(&self, slot: usize) -> Padded {
        match self.ready.get(slot.wrapping_sub(self.first)) {
            Some(ready) => *ready,
            None => times(&self.to_voxel, self.forward.vectors()[slot]),
        }
    }

    /// The inverse in a stored brick, into `out` (mm), which holds zeros.
    pub(super) fn brick(&self, brick: usize, out: &mut [[f32; 3]]) -> Worst {
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: AVX2 was found.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            return unsafe { self.brick_avx2(brick, out) };
        }
        // SAFETY: plain numbers need nothing.
        #[allow(unsafe_code, reason = "argued in the module's head")]
        unsafe {
            self.brick_any::<[f64; 4]>(brick, out)
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn brick_avx2(&self, brick: usize, out: &mut [[f32; 3]]) -> Worst {
        // SAFETY: there is AVX2.
        #[allow(unsafe_code, reason = "argued in the module's head")]
        unsafe {
            self.brick_any::<WideFour>(brick, out)
        }
    }

    /// # Safety
    ///
    /// The processor has what the lanes need.
    #[inline(always)]
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn brick_any<F: Four>(&self, brick: usize, out: &mut [[f32; 3]]) -> Worst {
        let mut worst = Worst::default();
        let mut places: [Padded; FieldBricks::VOXELS] = [[0.0; 4]; FieldBricks::VOXELS];
        let mut known = [false; FieldBricks::VOXELS];
        let dims = self.forward.dims();
        let first = brick_at(self.forward.brick_dims(), brick).map(|b| FieldBricks::SIDE * b);
        let slot0 = self.forward.table()[brick] as usize * FieldBricks::VOXELS;
        let moved = &self.forward.vectors()[slot0..slot0 + FieldBricks::VOXELS];
        for slot in 0..FieldBricks::VOXELS {
            let own = [slot & 7, slot >> 3 & 7, slot >> 6];
            let voxel = [first[0] + own[0], first[1] + own[1], first[2] + own[2]];
            if moved[slot] == [0.0; 3] || voxel[0] >= dims[0] || voxel[1] >= dims[1] || voxel[2] >= dims[2] {
                continue;
            }
            let y = [voxel[0] as f64, voxel[1] as f64, voxel[2] as f64, 0.0];
            let mut start = along(y, self.at(slot0 + slot), -1.0);
            line(&places, &known, slot, &mut start);
            // SAFETY: the caller's.
            let (found, x) = unsafe { self.newton::<F>(y, start) };
            (places[slot], known[slot]) = (if found { x } else { self.plain(y, start) }, true);
            // SAFETY: the caller's.
            let (mut vector, mut residual) = unsafe { self.stored::<F>(y, places[slot]) };
            // Far more than rounding: a step was trusted that shouldn't have been.
            if found && residual > 1e-5 {
                places[slot] = self.plain(y, start);
                // SAFETY: the caller's.
                (vector, residual) = unsafe { self.stored::<F>(y, places[slot]) };
            }
            out[slot] = vector;
            worst.take(residual, VoxelIndex(voxel));
        }
        worst
    }

    /// The vector that takes `y` to `x`, as it is stored (mm), and what residual that leaves (voxels).
    ///
    /// # Safety
    ///
    /// The processor has what the lanes need.
    #[inline(always)]
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn stored<F: Four>(&self, y: Padded, x: Padded) -> ([f32; 3], f64) {
        let [p, q, r, _] = times(&self.to_world, minus(x, y));
        let vector = [p as f32, q as f32, r as f32];
        let kept = along(y, times(&self.to_voxel, vector), 1.0);
        let (cell, place) = self.locate(kept);
        // SAFETY: the caller's.
        let (u, _) = unsafe { derived::<F>(&self.corners(cell), place) };
        (vector, norm(minus(along(kept, u.store(), 1.0), y)))
    }

    /// The plain way.
    #[inline(never)]
    fn plain(&self, y: Padded, start: Padded) -> Padded {
        let [a, b, c, _] = y;
        let [p, q, r, _] = start;
        let x = self.solver.solve(Vector3::new(a, b, c), Vector3::new(p, q, r));
        [x.x, x.y, x.z, 0.0]
    }

    /// Full steps from a start, and whether each of them helped until nothing was left.
    ///
    /// # Safety
    ///
    /// The processor has what the lanes need.
    #[inline(always)]
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn newton<F: Four>(&self, y: Padded, start: Padded) -> (bool, Padded) {
        let mut x = start;
        let mut before = f64::INFINITY;
        for _ in 0..=STEPS {
            let (cell, place) = self.locate(x);
            // SAFETY: the caller's.
            let (u, gradient) = unsafe { derived::<F>(&self.corners(cell), place) };
            let f = minus(along(x, u.store(), 1.0), y);
            // Squares of lengths: a root would be waited for.
            let left = dot(f, f);
            let far = x[0].abs().max(x[1].abs()).max(x[2].abs());
            let found = FOUND.max(FOUND_FAR * far);
            let vector = minus(x, y);
            let near = (found * found).max(KEPT * KEPT * dot(vector, vector));
            if left <= near {
                return (true, x);
            }
            // Not a number, too: nothing that is compared with it holds.
            let helped = left < 0.81 * before;
            if !helped {
                return (false, start);
            }
            before = left;
            let step = step([gradient[0].store(), gradient[1].store(), gradient[2].store()], f);
            x = minus(x, step);
            // Within a cell a step leaves its square of a residual, about.
            let squared = dot(step, step);
            if squared * squared <= near && self.locate(x).0 == cell {
                return (true, x);
            }
        }
        (false, start)
    }

    /// As [`Sampler::locate`](crate::sampler::Sampler::locate).
    #[inline(always)]
    fn locate(&self, x: Padded) -> ([i64; 3], [f64; 3]) {
        let dims = self.forward.dims();
        let (mut cell, mut place) = ([0; 3], [0.0; 3]);
        for a in 0..3 {
            let base = x[a].floor().clamp(-1.0, dims[a] as f64 - 1.0);
            cell[a] = base as i64;
            place[a] = (x[a] - base).clamp(0.0, 1.0);
        }
        (cell, place)
    }

    /// As [`Sampler::corners`](crate::sampler::Sampler::corners).
    #[inline(always)]
    fn corners(&self, cell: [i64; 3]) -> [Padded; 8] {
        let dims = self.forward.dims();
        let bricks = self.forward.brick_dims();
        let mut one = true;
        for a in 0..3 {
            one &= cell[a] >= 0 && cell[a] & 7 != 7 && cell[a] + 1 < dims[a] as i64;
        }
        let mut out = [[0.0; 4]; 8];
        if one {
            let [x, y, z] = [cell[0] as usize, cell[1] as usize, cell[2] as usize];
            let slot = self.forward.table()[x / 8 + bricks[0] * (y / 8 + bricks[1] * (z / 8))];
            if slot != NO_BRICK {
                let first = slot as usize * FieldBricks::VOXELS + x % 8 + 8 * (y % 8 + 8 * (z % 8));
                let own = first.wrapping_sub(self.first);
                out = match self.ready.get(own..own.wrapping_add(74)) {
                    Some(near) => {
                        [near[0], near[1], near[8], near[9], near[64], near[65], near[72], near[73]]
                    }
                    None => [0, 1, 8, 9, 64, 65, 72, 73].map(|step| self.at(first + step)),
                };
            }
            return out;
        }
        self.corners_apart(cell)
    }

    /// The same where they lie in several bricks, or beyond the grid: a third of all cells.
    #[inline(always)]
    fn corners_apart(&self, cell: [i64; 3]) -> [Padded; 8] {
        let (dims, bricks) = (self.forward.dims(), self.forward.brick_dims());
        // Of the lower and the upper corners of an axis: what the brick, and what the place in it, has of that axis.
        let (mut brick, mut place) = ([[0; 2]; 3], [[0; 2]; 3]);
        let strides = [1, bricks[0], bricks[0] * bricks[1]];
        for a in 0..3 {
            for up in 0..2 {
                let at = (cell[a] + up as i64).clamp(0, dims[a] as i64 - 1) as usize;
                (brick[a][up], place[a][up]) = (strides[a] * (at / 8), (at % 8) << (3 * a));
            }
        }
        let mut out = [[0.0; 4]; 8];
        for (i, out) in out.iter_mut().enumerate() {
            let [x, y, z] = [i & 1, i >> 1 & 1, i >> 2];
            let slot = self.forward.table()[brick[0][x] + brick[1][y] + brick[2][z]];
            if slot != NO_BRICK {
                let own = place[0][x] + place[1][y] + place[2][z];
                *out = self.at(slot as usize * FieldBricks::VOXELS + own);
            }
        }
        out
    }
}

/// Where the voxels of a brick before `slot` lead to: two make a line, one goes on as it is. Left alone where there is none.
#[inline(always)]
fn line(
    places: &[Padded; FieldBricks::VOXELS],
    known: &[bool; FieldBricks::VOXELS],
    slot: usize,
    start: &mut Padded,
) {
    for two in [false, true] {
        // Along y last: those along x would have to be waited for.
        for axis in [0, 2, 1] {
            let stride = 1 << (3 * axis);
            if (slot >> (3 * axis) & 7) < 1 + usize::from(two) || !known[slot - stride] {
                continue;
            }
            let last = places[slot - stride];
            if !two {
                *start = last;
                start[axis] += 1.0;
            } else if known[slot - 2 * stride] {
                *start = along(last, minus(last, places[slot - 2 * stride]), 1.0);
            }
        }
    }
}

/// The trilinear interpolant at a place in a cell, and its derivatives along the axes.
///
/// # Safety
///
/// The processor has what the lanes need.
#[inline(always)]
#[allow(unsafe_code, reason = "argued in the module's head")]
unsafe fn derived<F: Four>(corners: &[Padded; 8], [x, y, z]: [f64; 3]) -> (F, [F; 3]) {
    let [a, b, c, d, e, f, g, h] = corners;
    // SAFETY: the caller's.
    let c = unsafe {
        [F::load(a), F::load(b), F::load(c), F::load(d), F::load(e), F::load(f), F::load(g), F::load(h)]
    };
    let d = [c[1].minus(c[0]), c[3].minus(c[2]), c[5].minus(c[4]), c[7].minus(c[6])];
    let row = [c[0].along(d[0], x), c[2].along(d[1], x), c[4].along(d[2], x), c[6].along(d[3], x)];
    let e = [row[1].minus(row[0]), row[3].minus(row[2])];
    let plane = [row[0].along(e[0], y), row[2].along(e[1], y)];
    let dz = plane[1].minus(plane[0]);
    let dy = e[0].along(e[1].minus(e[0]), z);
    let low = d[0].along(d[1].minus(d[0]), y);
    let high = d[2].along(d[3].minus(d[2]), y);
    (plane[0].along(dz, z), [low.along(high.minus(low), z), dy, dz])
}

/// `(I + g)⁻¹ f`, at most two voxels long; `f` where the matrix is singular.
#[inline(always)]
fn step([mut a, mut b, mut c]: [Padded; 3], f: Padded) -> Padded {
    a[0] += 1.0;
    b[1] += 1.0;
    c[2] += 1.0;
    // Cramer's rule by two cross products: f·(b × c) = b·(c × f), f·(c × a) = −a·(c × f).
    let (p, q) = (cross(c, f), cross(a, b));
    let scale = 1.0 / dot(c, q);
    let out = [dot(b, p) * scale, -dot(a, p) * scale, dot(f, q) * scale, 0.0];
    let squared = dot(out, out);
    if squared <= 4.0 {
        return out;
    }
    let short = 2.0 / squared.sqrt();
    if short > 0.0 { [out[0] * short, out[1] * short, out[2] * short, 0.0] } else { f }
}

#[inline(always)]
fn times(m: &[[f64; 3]; 3], v: impl IntoTriple) -> Padded {
    let [x, y, z] = v.triple();
    let mut out = [0.0; 4];
    for (out, row) in out.iter_mut().zip(m) {
        *out = row[0] * x + row[1] * y + row[2] * z;
    }
    out
}

/// Three numbers.
trait IntoTriple {
    fn triple(self) -> [f64; 3];
}

impl IntoTriple for [f32; 3] {
    #[inline(always)]
    fn triple(self) -> [f64; 3] {
        [f64::from(self[0]), f64::from(self[1]), f64::from(self[2])]
    }
}

impl IntoTriple for Padded {
    #[inline(always)]
    fn triple(self) -> [f64; 3] {
        [self[0], self[1], self[2]]
    }
}

/// `a + t b`.
#[inline(always)]
fn along(a: Padded, b: Padded, t: f64) -> Padded {
    let mut out = [0.0; 4];
    for i in 0..4 {
        out[i] = a[i] + b[i] * t;
    }
    out
}

#[inline(always)]
fn minus(a: Padded, b: Padded) -> Padded {
    let mut out = [0.0; 4];
    for i in 0..4 {
        out[i] = a[i] - b[i];
    }
    out
}

#[inline(always)]
fn cross(a: Padded, b: Padded) -> Padded {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0.0]
}

#[inline(always)]
fn dot(a: Padded, b: Padded) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn norm(a: Padded) -> f64 {
    dot(a, a).sqrt()
}
