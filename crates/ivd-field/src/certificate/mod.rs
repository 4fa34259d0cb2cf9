//! The certificate that a displacement field doesn't fold: a proven lower bound of `det ∇φ` for every trilinear cell.
//!
//! In a cell of eight voxels `det ∇φ` is a polynomial of degree 2 in each of x, y, z. In Bernstein form its 27
//! coefficients bound it from both sides; a cell whose smallest coefficient is too small is cut into eight, at most
//! three times, and a cell that is still undecided counts as folded. The determinant is that of `A⁻¹ ∇φ A` with `A` the
//! grid's linear part, which is the determinant in millimetres whatever the spacing, shear or handedness.
//!
//! Positive everywhere, and no motion far away, make `φ` one-to-one. Beyond the grid the field continues as its border
//! voxels; the cells of that continuation are checked as well, so a part that touches the border is covered.

mod bernstein;
mod quick;

use std::collections::BTreeMap;

use ivd_core::{Exec, FieldBricks, Grid, NO_BRICK};
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::sampler::{Corners, Sampler, brick_at};
use bernstein::{CORNERS, Coefficients, determinant, subdivide};
pub use quick::Quick;
use quick::{Room, upper};

/// Determinant up to which a cell of a map is thin. At 0.05 a cell is squeezed to a twentieth of its size; less would pass as
/// fold-free but leaves the inverse with gradients that no interpolation follows.
pub const THIN: f64 = 0.05;
/// Times that an undecided cell is cut into eight.
const LEVELS: u8 = 3;
/// Rounding of the coefficients, relative to the largest: some hundred additions and products in `f64`.
const ROUNDING: f64 = 1e-13;
/// What a quick bound must be clear of a bound by. A bound gives away [`ROUNDING`] of 1 at least, where a quick one gives away a share
/// of its own size: of a cell that is squeezed to nothing, less.
const SLACK: f64 = 1e-12;

/// A histogram with equal bins; values beyond the ends are counted in the outermost bins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Histogram {
    /// Lower end of the first bin, in the unit of its values.
    #[schemars(extend("x-unit" = "real units"))]
    pub lower: f64,
    /// Upper end of the last bin.
    #[schemars(extend("x-unit" = "real units"))]
    pub upper: f64,
    /// Number of values in each bin.
    #[schemars(extend("x-unit" = "1"))]
    pub counts: Vec<u64>,
}

impl Histogram {
    /// `bins` empty bins from `lower` to `upper`.
    pub fn new(lower: f64, upper: f64, bins: usize) -> Self {
        Self { lower, upper, counts: vec![0; bins.max(1)] }
    }

    /// Counts a value.
    pub fn add(&mut self, value: f64) {
        let n = self.counts.len();
        let at = (value - self.lower) / (self.upper - self.lower) * n as f64;
        self.counts[(at.max(0.0) as usize).min(n - 1)] += 1;
    }

    fn merge(&mut self, other: &Self) {
        for (a, b) in self.counts.iter_mut().zip(&other.counts) {
            *a += b;
        }
    }
}

/// A cell and what is known of `det ∇φ` in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellBound {
    /// Lowest corner of the cell, a voxel (−1 where the cell lies in the continuation beyond the border).
    pub cell: [i64; 3],
    /// Proven lower bound of the determinant.
    pub lower: f64,
}

/// What the certificate found.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// Smallest proven lower bound of `det ∇φ`, at most 1 (the determinant where nothing moves). It is tight where it
    /// is below the threshold asked for, and may be a little low above it.
    pub min_det: f64,
    /// The cell of that bound; `None` where nothing moves.
    pub worst: Option<CellBound>,
    /// Cells in which the determinant isn't proven positive, in the order of bricks.
    pub folded: Vec<CellBound>,
    /// Cells whose bound is positive but below the threshold asked for.
    pub thin: Vec<CellBound>,
    /// Cells in which something moves.
    pub cells: u64,
    /// Determinants at the centres of those cells, 0 … 2.
    pub histogram: Histogram,
}

impl Certificate {
    /// Whether the field is proven fold-free.
    pub fn holds(&self) -> bool {
        self.folded.is_empty()
    }

    fn empty() -> Self {
        Self {
            min_det: 1.0,
            worst: None,
            folded: Vec::new(),
            thin: Vec::new(),
            cells: 0,
            histogram: Histogram::new(0.0, 2.0, 40),
        }
    }

    fn merge(mut self, mut other: Self) -> Self {
        if let Some(worst) = other.worst {
            self.take(worst);
        }
        self.folded.append(&mut other.folded);
        self.thin.append(&mut other.thin);
        self.cells += other.cells;
        self.histogram.merge(&other.histogram);
        self
    }

    fn take(&mut self, bound: CellBound) {
        if self.worst.is_none_or(|w| bound.lower < w.lower) {
            self.worst = Some(bound);
            self.min_det = bound.lower.min(1.0);
        }
    }
}

/// Bounds `det ∇φ` of a forward field (mm) in every cell that a moved voxel touches and for which `counts` is true.
///
/// - `threshold`: bounds are sharpened (by subdivision) in cells below it, and such cells are listed as thin; ≥ 0.
/// - `counts(cell)`: whether a cell matters; a part that moves alone asks only for its own.
///
/// # Errors
/// A field of other dims than the grid; cancellation.
pub fn certify(
    forward: &FieldBricks,
    grid: &Grid,
    threshold: f64,
    counts: impl Fn([i64; 3]) -> bool + Sync,
    exec: &Exec,
) -> Result<Certificate, Error> {
    exec.run(|| {
        let bricks = touched(forward);
        certify_bricks(forward, grid, threshold, &counts, &bricks, Detail::All, exec)
    })
}

/// What is asked of a certificate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// Everything.
    All,
    /// The smallest bound with its cell, and the cells below the threshold: the same as with everything. Cells that can't be
    /// either aren't looked at, so that their number and the histogram are of the others.
    Least,
}

impl Detail {
    /// [`Detail::Least`], but where nothing is to be skipped.
    pub fn least(exec: &Exec) -> Self {
        if exec.skip { Self::Least } else { Self::All }
    }
}

/// The bricks that own a cell touching a stored brick: the stored ones and their lower neighbours.
pub fn touched(forward: &FieldBricks) -> Vec<usize> {
    let bricks = forward.brick_dims();
    let mut owner = vec![false; forward.table().len()];
    for brick in (0..owner.len()).filter(|&b| forward.table()[b] != NO_BRICK) {
        let at = brick_at(bricks, brick);
        for corner in 0..8_usize {
            let [x, y, z]: [usize; 3] = std::array::from_fn(|a| at[a].saturating_sub(corner >> a & 1));
            owner[x + bricks[0] * (y + bricks[1] * z)] = true;
        }
    }
    (0..owner.len()).filter(|&b| owner[b]).collect()
}

/// The certificate of the cells that the given bricks own. Brick `b` owns the cells `8b … 8b + 7`, and the cell −1 where
/// it is the first.
///
/// # Errors
/// A field of other dims than the grid; cancellation.
pub fn certify_bricks(
    forward: &FieldBricks,
    grid: &Grid,
    threshold: f64,
    counts: &(impl Fn([i64; 3]) -> bool + Sync),
    bricks: &[usize],
    detail: Detail,
    exec: &Exec,
) -> Result<Certificate, Error> {
    forward.require(grid.dims(), "forward field", "grid")?;
    if detail == Detail::Least {
        let quick = Quick::new(forward, grid, exec.simd);
        let mut looks = Looks::default();
        looks.take(&quick, bricks, exec)?;
        return looks.certify(&quick, threshold, counts, exec);
    }
    let sampler = Sampler::new(forward, grid);
    let moves = |b: usize| forward.brick(b).is_some_and(|vectors| vectors.iter().any(|u| *u != [0.0; 3]));
    let moves: Vec<bool> = (0..forward.table().len()).into_par_iter().map(moves).collect();
    let moving = |brick: &&usize| upper(forward.brick_dims(), **brick).any(|near| moves[near]);
    let moving: Vec<usize> = bricks.iter().filter(moving).copied().collect();
    let one = |&brick: &usize| {
        exec.check_cancelled()?;
        let block = Block::of_brick(&sampler, forward, brick);
        Ok::<_, Error>(certify_block(&block, None, threshold, f64::INFINITY, counts))
    };
    let parts = moving.par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    Ok(parts.into_iter().fold(Certificate::empty(), Certificate::merge))
}

/// How bad each of some bricks looks: a cheap lower bound of the determinant in its cells. Kept while a field changes in some bricks, so
/// that a certificate with [`Detail::Least`] costs what has changed.
#[derive(Debug, Default)]
pub struct Looks {
    of: BTreeMap<usize, f32>,
}

impl Looks {
    /// Looks at bricks, for the first time or anew.
    ///
    /// # Errors
    /// Cancellation.
    pub fn take(&mut self, quick: &Quick<'_>, bricks: &[usize], exec: &Exec) -> Result<(), Error> {
        let look = |room: &mut Room, &brick: &usize| {
            exec.check_cancelled()?;
            Ok((brick, quick.least(brick, room)))
        };
        let looks = bricks.par_iter().map_init(Room::default, look).collect::<Result<Vec<_>, Error>>()?;
        self.of.extend(looks);
        Ok(())
    }

    /// Takes over what others say of their bricks.
    pub fn replace(&mut self, others: Self) {
        self.of.extend(others.of);
    }

    /// The certificate of the bricks that were looked at since they changed last.
    ///
    /// # Errors
    /// Cancellation.
    pub fn certify(
        &self,
        quick: &Quick<'_>,
        threshold: f64,
        counts: &(impl Fn([i64; 3]) -> bool + Sync),
        exec: &Exec,
    ) -> Result<Certificate, Error> {
        let (forward, sampler) = (quick.field, Sampler::new(quick.field, quick.grid));
        let one = |room: &mut Room, brick: usize, enough: f64| {
            exec.check_cancelled()?;
            let block = Block::of_brick(&sampler, forward, brick);
            let bounds = quick.bounds(brick, room);
            Ok::<_, Error>(certify_block(&block, Some(&bounds), threshold, enough, counts))
        };
        // The brick that looks worst says how far the others need to be looked at.
        let moving: Vec<(usize, f32)> =
            self.of.iter().map(|(b, l)| (*b, *l)).filter(|(_, look)| *look != f32::INFINITY).collect();
        let Some(&(first, _)) = moving.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return Ok(Certificate::empty());
        };
        let start = one(&mut Room::default(), first, f64::INFINITY)?;
        let enough = start.worst.map_or(f64::INFINITY, |worst| worst.lower);
        let parts = moving
            .par_iter()
            .filter(|(brick, look)| *brick != first && !clears(*look, enough.max(threshold)))
            .map_init(Room::default, |room, &(brick, _)| Ok((brick, one(room, brick, enough)?)))
            .collect::<Result<Vec<_>, Error>>()?;
        let (before, after) = parts.split_at(parts.partition_point(|(brick, _)| *brick < first));
        let (before, after) = (before.iter().map(|p| &p.1), after.iter().map(|p| &p.1));
        Ok(before.chain([&start]).chain(after).cloned().fold(Certificate::empty(), Certificate::merge))
    }
}

/// Whether a quick bound is above another for certain; one that isn't a number bounds nothing.
fn clears(quick: f32, other: f64) -> bool {
    f64::from(quick) - SLACK > other
}

/// The certificate of a brick's cells. With `quick`, bounds of them that are cheap, cells that can be neither below the threshold
/// nor below `enough` and what the brick has itself are passed over.
fn certify_block(
    block: &Block,
    quick: Option<&[f32]>,
    threshold: f64,
    enough: f64,
    counts: &impl Fn([i64; 3]) -> bool,
) -> Certificate {
    let mut result = Certificate::empty();
    let mut enough = enough;
    let look = |cell: [i64; 3], result: &mut Certificate| {
        let corners = block.corners(cell);
        if corners.iter().any(|u| *u != Vector3::zeros()) && counts(cell) {
            judge(result, cell, &corners, threshold);
        }
    };
    if let Some(quick) = quick {
        // The cell that looks worst first, by itself: it is judged again in its turn, so that of equals the first is named. It has its
        // turn because a quick bound is never clear of the bound of its own cell.
        if let Some((_, cell)) =
            block.cells().zip(quick).map(|(c, q)| (*q, c)).min_by(|a, b| a.0.total_cmp(&b.0))
        {
            let mut alone = Certificate::empty();
            look(cell, &mut alone);
            enough = alone.worst.map_or(enough, |worst| worst.lower.min(enough));
        }
    }
    for (i, cell) in block.cells().enumerate() {
        if quick.is_none_or(|quick| !clears(quick[i], enough.max(threshold))) {
            look(cell, &mut result);
            enough = result.worst.map_or(enough, |worst| worst.lower.min(enough));
        }
    }
    result
}

fn judge(result: &mut Certificate, cell: [i64; 3], corners: &Corners, threshold: f64) {
    let c = determinant(corners);
    let slack = ROUNDING * c.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    let bound = CellBound { cell, lower: lower_bound(&c, threshold + slack, LEVELS) - slack };
    result.cells += 1;
    result.histogram.add(centre_value(&c));
    result.take(bound);
    if bound.lower <= 0.0 {
        result.folded.push(bound);
    } else if bound.lower < threshold {
        result.thin.push(bound);
    }
}

/// A lower bound of the polynomial on the unit cube, sharpened while it is not above `threshold`.
fn lower_bound(c: &Coefficients, threshold: f64, levels: u8) -> f64 {
    let lower = c.iter().copied().fold(f64::INFINITY, f64::min);
    let at_corners = CORNERS.iter().map(|&i| c[i]).fold(f64::INFINITY, f64::min);
    // Above the threshold, reached at a corner and so exact, out of levels, or folded for certain: no need to cut.
    if lower > threshold || lower == at_corners || levels == 0 || at_corners <= 0.0 {
        return lower;
    }
    subdivide(c).iter().map(|part| lower_bound(part, threshold, levels - 1)).fold(f64::INFINITY, f64::min)
}

/// Value at the middle of the cell: weights ¼, ½, ¼ along each axis.
fn centre_value(c: &Coefficients) -> f64 {
    const W: [f64; 3] = [0.25, 0.5, 0.25];
    (0..27).map(|a| c[a] * (W[a % 3] * W[a / 3 % 3] * W[a / 9])).sum()
}

/// Displacements (voxels) of a brick's cells' corners, read once.
struct Block {
    lo: [i64; 3],
    size: [usize; 3],
    values: Vec<Vector3<f64>>,
}

impl Block {
    fn of_brick(sampler: &Sampler<'_>, forward: &FieldBricks, brick: usize) -> Self {
        let at = brick_at(forward.brick_dims(), brick);
        let lo = at.map(|b| if b == 0 { -1 } else { 8 * b as i64 });
        let hi = std::array::from_fn(|a| (8 * at[a] as i64 + 8).min(forward.dims()[a] as i64));
        Self::gather(sampler, lo, hi)
    }

    /// The cells, in memory order.
    fn cells(&self) -> impl Iterator<Item = [i64; 3]> + use<> {
        let (lo, hi): (_, [i64; 3]) =
            (self.lo, std::array::from_fn(|a| self.lo[a] + self.size[a] as i64 - 1));
        (lo[2]..hi[2])
            .flat_map(move |z| (lo[1]..hi[1]).flat_map(move |y| (lo[0]..hi[0]).map(move |x| [x, y, z])))
    }

    /// The voxels `lo ..= hi`.
    fn gather(sampler: &Sampler<'_>, lo: [i64; 3], hi: [i64; 3]) -> Self {
        let size: [usize; 3] = std::array::from_fn(|a| (hi[a] - lo[a] + 1) as usize);
        let mut values = Vec::with_capacity(size.iter().product());
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                values.extend((lo[0]..=hi[0]).map(|x| sampler.voxel([x, y, z])));
            }
        }
        Self { lo, size, values }
    }

    fn corners(&self, cell: [i64; 3]) -> Corners {
        let base: [usize; 3] = std::array::from_fn(|a| (cell[a] - self.lo[a]) as usize);
        std::array::from_fn(|i| {
            let at = [base[0] + (i & 1), base[1] + (i >> 1 & 1), base[2] + (i >> 2)];
            self.values[at[0] + self.size[0] * (at[1] + self.size[1] * at[2])]
        })
    }
}

#[cfg(test)]
mod tests;
