//! Where each cell climbs to.
//!
//! Cells are taken from the highest to the lowest. A cell without a higher neighbour is a peak. From any other cell a path
//! follows the gradient, between the cells' middles too, until all cells round it are known to climb to one peak. Following
//! the gradient and not the steepest neighbour matters: neighbours lie in a few directions only, and paths that keep to them
//! cross the borders between basins.

use ivd_core::{Error, Exec};
use rayon::prelude::*;

use super::cells::Cells;
use super::density::Heights;
use super::params::Kernel;

/// Basin of a cell that no kernel reaches, or that isn't known yet.
pub(super) const NO_BASIN: u32 = u32::MAX;
/// Longest step along the axis that it follows most (cells).
const STEP: f64 = 1.0;
/// Shorter mean shifts are lengthened, up to twice: beyond, a step across a ridge could overshoot by more than it corrects.
const LENGTHEN: f64 = 2.0;
/// Mean shifts (cells) below which a cell follows its highest neighbour: on a plateau a path would take ages.
const SHORT: f64 = 0.1;
/// Steps after which a path gives up and follows the highest neighbour.
const MOST_STEPS: usize = 12;
/// Cells that are worked on at once, knowing only those before them: a share of those before, and at least so many. They are
/// worked on in the order in which they lie in memory; by height, each of them would wait for memory many times.
const SHARE: usize = 8;
const LEAST_BATCH: usize = 64;
/// A bandwidth (cells) below which neighbours along the axis are modes of their own: two equal Gaussians closer together
/// than twice their standard deviation have one mode, those further apart two.
const NARROW: f64 = 0.5;

/// The basin of every cell, and the peak of every basin, the highest first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Basins {
    pub(super) of: Vec<u32>,
    /// The cell of each basin's peak.
    pub(super) peaks: Vec<u32>,
}

/// What one cell found.
enum Found {
    Peak,
    Basin(u32),
    /// Where that cell climbs to.
    With(u32),
}

/// An axis that cells move along.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub(super) index: usize,
    len: usize,
    pub(super) stride: usize,
    /// Squared bandwidth (cells²).
    variance: f64,
}

/// The axes that cells move along.
pub(super) fn axes(cells: &Cells) -> Vec<Axis> {
    let strides = cells.strides();
    // The value last: its cells lie side by side.
    [2, 1, 0, 3]
        .into_iter()
        .filter(|a| cells.dims[*a] > 1 && cells.sigma[*a] >= NARROW)
        .map(|index| Axis {
            index,
            len: cells.dims[index],
            stride: strides[index],
            variance: cells.sigma[index] * cells.sigma[index],
        })
        .collect()
}

pub(super) fn basins(cells: &Cells, heights: &Heights, exec: &Exec) -> Result<Basins, Error> {
    let axes = axes(cells);
    match axes.len() {
        1 => climb::<1>(cells, heights, &axes, exec),
        2 => climb::<2>(cells, heights, &axes, exec),
        3 => climb::<3>(cells, heights, &axes, exec),
        _ => climb::<4>(cells, heights, &axes, exec),
    }
}

fn climb<const D: usize>(
    cells: &Cells,
    heights: &Heights,
    axes: &[Axis],
    exec: &Exec,
) -> Result<Basins, Error> {
    let axes: [Axis; D] = std::array::from_fn(|i| axes[i]);
    let climber = Climber { heights, axes };
    let mut order = climber.order();
    let mut found = Basins { of: vec![NO_BASIN; cells.len()], peaks: Vec::new() };
    let mut done = 0;
    while done < order.len() {
        exec.check_cancelled()?;
        let size = (done / SHARE).max(LEAST_BATCH).min(order.len() - done);
        let batch = &mut order[done..done + size];
        batch.par_sort_unstable_by_key(|key| cell_of(*key));
        let mut each: Vec<(u64, Found)> = batch
            .par_iter()
            .with_min_len(64)
            .map(|key| (*key, climber.from(cell_of(*key), &found.of)))
            .collect();
        each.par_sort_unstable_by_key(|(key, _)| *key);
        for (key, each) in each {
            let basin = match each {
                Found::Peak => {
                    found.peaks.push(cell_of(key) as u32);
                    found.peaks.len() as u32 - 1
                }
                Found::Basin(basin) => basin,
                // The other cell is higher, so its turn was before.
                Found::With(other) => found.of[other as usize],
            };
            found.of[cell_of(key)] = basin;
        }
        done += size;
    }
    Ok(found)
}

fn cell_of(key: u64) -> usize {
    (key & 0xffff_ffff) as usize
}

struct Climber<'a, const D: usize> {
    heights: &'a Heights,
    axes: [Axis; D],
}

impl<const D: usize> Climber<'_, D> {
    /// The cells that a kernel reaches, the highest first, the first of equal ones first: keys that end in the cell.
    fn order(&self) -> Vec<u64> {
        let key = |(cell, height): (usize, &f32)| {
            let bits = height.to_bits();
            // Ascending integers for ascending numbers, then turned round.
            let rising = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
            u64::from(!rising) << 32 | cell as u64
        };
        let reached = self.heights.of.par_iter().enumerate().filter(|(cell, _)| self.heights.reached(*cell));
        let mut order: Vec<u64> = reached.map(key).collect();
        order.par_sort_unstable();
        order
    }

    /// Whether `a` comes before `b` in the order.
    #[inline]
    fn precedes(&self, a: usize, b: usize) -> bool {
        let [high, low] = [self.heights.of[a], self.heights.of[b]];
        high > low || (high == low && a < b)
    }

    fn coordinates(&self, cell: usize) -> [usize; D] {
        std::array::from_fn(|i| cell / self.axes[i].stride % self.axes[i].len)
    }

    fn from(&self, cell: usize, known: &[u32]) -> Found {
        let at = self.coordinates(cell);
        if self.no_axis_precedes(cell, &at) && self.best_neighbour(cell, &at) == cell {
            return Found::Peak;
        }
        self.path(cell, &at, known)
            .map_or_else(|| Found::With(self.best_neighbour(cell, &at) as u32), Found::Basin)
    }

    fn no_axis_precedes(&self, cell: usize, at: &[usize; D]) -> bool {
        (0..D).all(|i| {
            let Axis { len, stride, .. } = self.axes[i];
            (at[i] == 0 || !self.precedes(cell - stride, cell))
                && (at[i] + 1 == len || !self.precedes(cell + stride, cell))
        })
    }

    /// The first in the order of the cell and all its neighbours, those at its corners too.
    fn best_neighbour(&self, cell: usize, at: &[usize; D]) -> usize {
        let mut best = cell;
        for corner in 0..3_usize.pow(D as u32) {
            let mut code = corner;
            let mut there = Some(cell);
            for i in 0..D {
                let Axis { len, stride, .. } = self.axes[i];
                there = match code % 3 {
                    1 if at[i] > 0 => there.map(|c| c - stride),
                    2 if at[i] + 1 < len => there.map(|c| c + stride),
                    0 => there,
                    _ => None,
                };
                code /= 3;
            }
            best = there.filter(|c| self.precedes(*c, best)).unwrap_or(best);
        }
        best
    }

    /// The basin that the path from a cell's middle leads into.
    fn path(&self, cell: usize, at: &[usize; D], known: &[u32]) -> Option<u32> {
        let mut slope = self.slope_at_middle(cell, at);
        let mut place: [f64; D] = at.map(|v| v as f64);
        // Axes that cells don't move along keep their place.
        let base = cell - (0..D).map(|i| at[i] * self.axes[i].stride).sum::<usize>();
        for _ in 0..MOST_STEPS {
            let steepest = slope.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
            if steepest < SHORT {
                return None;
            }
            let factor = (STEP / steepest).min(LENGTHEN);
            for i in 0..D {
                let last = (self.axes[i].len - 1) as f64;
                place[i] = (place[i] + factor * slope[i]).clamp(0.0, last);
            }
            let (corner, within) = self.box_of(base, &place);
            if let Some(basin) = self.basin_round(corner, &within, known) {
                return Some(basin);
            }
            slope = self.slope_within(corner, &within);
        }
        None
    }

    /// What a slope times a squared bandwidth has to be multiplied with to be the mean shift: 1 for a logarithm's. For the
    /// shadow of a flat kernel, whose mean is `2 / (D + 2)` of the flat one's where the density is even, this is a guess.
    #[inline]
    fn shift_factor(&self, height: f64) -> f64 {
        match self.heights.kernel {
            Kernel::Gaussian => 1.0,
            Kernel::Flat => 1.0 / ((D + 2) as f64 * height.max(f64::MIN_POSITIVE)),
        }
    }

    /// The mean shift in the middle of a cell (cells).
    fn slope_at_middle(&self, cell: usize, at: &[usize; D]) -> [f64; D] {
        let factor = self.shift_factor(self.heights.slope_height(cell));
        std::array::from_fn(|i| {
            let Axis { len, stride, variance, .. } = self.axes[i];
            let below = if at[i] > 0 { cell - stride } else { cell };
            let above = if at[i] + 1 < len { cell + stride } else { cell };
            factor * variance * 0.5 * (self.heights.slope_height(above) - self.heights.slope_height(below))
        })
    }

    /// The lowest corner of the cells' middles round a place, and where in that box the place lies, 0…1.
    fn box_of(&self, base: usize, place: &[f64; D]) -> (usize, [f64; D]) {
        let mut corner = base;
        let mut low = [0; D];
        for i in 0..D {
            low[i] = (place[i] as usize).min(self.axes[i].len - 2);
            corner += low[i] * self.axes[i].stride;
        }
        (corner, std::array::from_fn(|i| place[i] - low[i] as f64))
    }

    fn corners(&self, corner: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..1_usize << D).map(move |code| {
            let off: usize = (0..D).map(|i| if code >> i & 1 == 1 { self.axes[i].stride } else { 0 }).sum();
            (code, corner + off)
        })
    }

    /// The basin of the cells round a place, where the nearest is known and the known ones agree. Those that aren't known
    /// are lower than the path's start, and the path leads away from them.
    #[inline]
    fn basin_round(&self, corner: usize, within: &[f64; D], known: &[u32]) -> Option<u32> {
        let nearest: usize = (0..D).map(|i| if within[i] > 0.5 { self.axes[i].stride } else { 0 }).sum();
        let basin = known[corner + nearest];
        if basin == NO_BASIN {
            return None;
        }
        for (code, cell) in self.corners(corner) {
            let far = (0..D).any(|i| within[i] == f64::from(code >> i & 1 == 0));
            if known[cell] != basin && known[cell] != NO_BASIN && !far {
                return None;
            }
        }
        Some(basin)
    }

    /// As [`Climber::slope_at_middle`], of the multilinear function through the middles round a place.
    #[inline]
    fn slope_within(&self, corner: usize, within: &[f64; D]) -> [f64; D] {
        let mut values = [0.0; 16];
        for (code, cell) in self.corners(corner) {
            values[code] = self.heights.slope_height(cell);
        }
        let mut slopes = [[0.0; 8]; D];
        for i in (0..D).rev() {
            let half = 1 << i;
            let t = within[i];
            for c in 0..half {
                slopes[i][c] = values[c + half] - values[c];
                values[c] += t * slopes[i][c];
            }
            for slopes in &mut slopes[i + 1..] {
                for c in 0..half {
                    slopes[c] += t * (slopes[c + half] - slopes[c]);
                }
            }
        }
        let factor = self.shift_factor(values[0]);
        std::array::from_fn(|i| factor * self.axes[i].variance * slopes[i][0])
    }
}
