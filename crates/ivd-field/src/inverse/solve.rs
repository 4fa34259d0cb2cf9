use std::sync::OnceLock;

use ivd_core::{FieldBricks, Grid, VoxelIndex};
use nalgebra::{Matrix3, Vector3};

use crate::sampler::{Corners, Sampler, gradient, interpolate};

/// A residual at which a preimage counts as found (voxels): far below what `f32` vectors can keep.
pub(super) const FOUND: f64 = 1e-10;
/// The same for a preimage far away, as a fraction of its coordinates: a few roundings. 10⁶ voxels from here no residual
/// of 10⁻¹⁰ can be met, and every voxel would be searched for.
pub(super) const FOUND_FAR: f64 = 8.0 * f64::EPSILON;
/// Newton steps from one start. Smooth fields take 3 to 5; beyond 30 it hangs at a kink and the search takes over.
const STEPS: usize = 30;

/// Solves `φ(x) = y` for a trilinear field; all coordinates in voxels.
pub(crate) struct Solver<'a> {
    sampler: Sampler<'a>,
    /// Largest motion along each axis (voxels), once it is asked for.
    most: OnceLock<Vector3<f64>>,
}

impl<'a> Solver<'a> {
    pub(crate) fn new(forward: &'a FieldBricks, grid: &Grid) -> Self {
        Self { sampler: Sampler::ready(forward, grid), most: OnceLock::new() }
    }

    /// As [`Solver::new`], for who asks for few voxels.
    pub(super) fn seldom(forward: &'a FieldBricks, grid: &Grid) -> Self {
        Self { sampler: Sampler::new(forward, grid), most: OnceLock::new() }
    }

    pub(crate) fn sampler(&self) -> &Sampler<'a> {
        &self.sampler
    }

    /// A preimage of `y`: Newton from `start`, then from `y − u(y)`, then a search of the deformed cells; the best of
    /// them where none reaches [`FOUND`].
    pub(crate) fn solve(&self, y: Vector3<f64>, start: Vector3<f64>) -> Vector3<f64> {
        let (x, residual) = self.newton(y, start);
        if residual <= found(x) {
            return x;
        }
        let (x2, residual2) = self.newton(y, y - self.sampler.at(y));
        if residual2 <= found(x2) {
            return x2;
        }
        let best = if residual2 < residual { (x2, residual2) } else { (x, residual) };
        match self.search(y) {
            Some((found, r)) if r < best.1 => found,
            _ => best.0,
        }
    }

    /// Newton's method with step halving on the residual; a step that can't be solved for falls back to `−F`.
    fn newton(&self, y: Vector3<f64>, start: Vector3<f64>) -> (Vector3<f64>, f64) {
        let mut x = start;
        let (mut cell, mut place) = self.sampler.locate(x);
        let mut corners = self.sampler.corners(cell);
        let mut f = x + interpolate(&corners, place) - y;
        for _ in 0..STEPS {
            if f.norm() <= found(x) {
                break;
            }
            let step = newton_step(&gradient(&corners, place), f);
            let mut t = 1.0;
            loop {
                let next = x + step * t;
                let (next_cell, next_place) = self.sampler.locate(next);
                let next_corners = if next_cell == cell { corners } else { self.sampler.corners(next_cell) };
                let next_f = next + interpolate(&next_corners, next_place) - y;
                if next_f.norm() < (1.0 - 0.1 * t) * f.norm() {
                    (x, cell, place, corners, f) = (next, next_cell, next_place, next_corners, next_f);
                    break;
                }
                t *= 0.5;
                if t < 1.0 / 64.0 {
                    return (x, f.norm());
                }
            }
        }
        (x, f.norm())
    }

    /// Goes through the cells near enough to hold a preimage of `y`: those whose deformed box contains it. Beyond the grid
    /// the field is constant outwards, so that the outermost cells stand for all of space beyond them.
    fn search(&self, y: Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
        let most = self.most.get_or_init(|| self.sampler.max_per_axis());
        let last = self.sampler.dims().map(|n| n as i64 - 1);
        let cell = |c: f64, a: usize| (c.clamp(-1.0, last[a] as f64) as i64).clamp(-1, last[a]);
        let lo = Vector3::from_fn(|a, _| cell((y[a] - most[a]).floor() - 1.0, a));
        let hi = Vector3::from_fn(|a, _| cell((y[a] + most[a]).ceil() + 1.0, a));
        let mut best: Option<(Vector3<f64>, f64)> = None;
        for z in lo.z..=hi.z {
            for yy in lo.y..=hi.y {
                for x in lo.x..=hi.x {
                    let candidate = self.in_room(y, [x, yy, z], self.sampler.room([x, yy, z]));
                    if let Some((at, r)) = candidate
                        && best.is_none_or(|(_, b)| r < b)
                    {
                        best = candidate;
                        if r <= found(at) {
                            return best;
                        }
                    }
                }
            }
        }
        best
    }

    /// Calls `each` with every voxel of the grid in the box round a deformed cell.
    pub(crate) fn voxels_in(&self, cell: [i64; 3], mut each: impl FnMut(VoxelIndex)) {
        let (lo, hi) = deformed_box(&self.sampler.corners(cell), Vector3::from(cell).map(|c| c as f64));
        let dims = self.sampler.dims();
        let lo: [usize; 3] = std::array::from_fn(|a| (lo[a] - 1e-9).ceil().max(0.0) as usize);
        let end: [usize; 3] =
            std::array::from_fn(|a| ((hi[a] + 1e-9).floor() + 1.0).clamp(0.0, dims[a] as f64) as usize);
        for z in lo[2]..end[2] {
            for y in lo[1]..end[1] {
                for x in lo[0]..end[0] {
                    each(VoxelIndex([x, y, z]));
                }
            }
        }
    }

    /// Newton inside one cell, the iterate kept in it.
    pub(crate) fn in_cell(&self, y: Vector3<f64>, cell: [i64; 3]) -> Option<(Vector3<f64>, f64)> {
        self.in_room(y, cell, [[0.0, 1.0]; 3])
    }

    /// Newton with the iterate kept in a cell, or in what it stands for: from and to along each axis, counted from the cell's
    /// lowest corner. Along an axis without an end the field is constant, and the first step is exact.
    fn in_room(&self, y: Vector3<f64>, cell: [i64; 3], room: [[f64; 2]; 3]) -> Option<(Vector3<f64>, f64)> {
        let corners = self.sampler.corners(cell);
        let base = Vector3::from(cell).map(|c| c as f64);
        let (lo, hi) = deformed_box(&corners, base);
        let below = |a: usize| y[a] < lo[a] - 1e-9 && room[a][0].is_finite();
        let above = |a: usize| y[a] > hi[a] + 1e-9 && room[a][1].is_finite();
        if (0..3).any(|a| below(a) || above(a)) {
            return None;
        }
        let kept = |t: Vector3<f64>| Vector3::from_fn(|a, _| t[a].clamp(room[a][0], room[a][1]));
        // Interpolated at its own place in the cell, so that a place far out doesn't extrapolate rounding.
        let cut = |t: Vector3<f64>| t.map(|c| c.clamp(0.0, 1.0));
        let residual = |t: Vector3<f64>| base + t + interpolate(&corners, cut(t)) - y;
        let mut t = Vector3::repeat(0.5);
        let middle = residual(t);
        t = kept(Vector3::from_fn(|a, _| t[a] - if room[a] == [0.0, 1.0] { 0.0 } else { middle[a] }));
        for _ in 0..STEPS {
            let f = residual(t);
            if f.norm() <= found(base + t) {
                break;
            }
            t = kept(t + newton_step(&gradient(&corners, cut(t)), f));
        }
        Some((base + t, residual(t).norm()))
    }
}

/// The residual at which a preimage counts as found (voxels).
fn found(x: Vector3<f64>) -> f64 {
    FOUND.max(FOUND_FAR * x.amax())
}

/// The box round a deformed cell.
fn deformed_box(corners: &Corners, base: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let (mut lo, mut hi) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for (i, u) in corners.iter().enumerate() {
        let at = base + Vector3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) + u;
        (lo, hi) = (lo.inf(&at), hi.sup(&at));
    }
    (lo, hi)
}

/// `−(I + g)⁻¹ f`, at most two voxels long; `−f` where the matrix is singular.
fn newton_step(g: &Matrix3<f64>, f: Vector3<f64>) -> Vector3<f64> {
    let j = Matrix3::identity() + g;
    let step = j.try_inverse().map_or(-f, |inverse| -(inverse * f));
    let length = step.norm();
    if length.is_finite() { step * (2.0 / length).min(1.0) } else { -f }
}
