//! The cells' places along the value.

use std::collections::BTreeSet;

use ivd_core::{Error, Exec, Mask, Scalar, Volume, parallel, with_voxels};

use super::bandwidth::real;
use crate::histogram;

/// Steps up to which every one gets a cell, occupied or not.
const FEW: i64 = 4096;
/// Empty cells before the first and behind the last: a mode's neighbours are cells too.
pub(super) const MARGIN: usize = 2;
/// Voxels that one task looks at.
const CHUNK: usize = 1 << 18;

/// A row of cells along the value. Stretches without data that no kernel bridges are shortened, so that an outlier or a
/// padding value far off costs a few cells and not thousands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RangeAxis {
    pub(super) low: f64,
    /// Width of a cell (real units).
    pub(super) width: f64,
    /// First step of each unbroken piece, and the cell that stands there; ascending.
    pieces: Vec<(i64, usize)>,
    /// Number of cells.
    pub(super) len: usize,
}

impl RangeAxis {
    /// An axis for the data inside the mask, with kernels that reach `reach` cells.
    pub(super) fn new(
        volume: &Volume,
        mask: Option<&Mask>,
        values: [f64; 2],
        width: f64,
        reach: usize,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let width = width.max(f64::MIN_POSITIVE);
        // The lowest value lies in the middle of its cell: many volumes have a peak there that is a single value.
        let low = (values[0] - width / 2.0).max(f64::MIN);
        let mut axis = Self { low, width, pieces: vec![(0, MARGIN)], len: 0 };
        let last = axis.step(values[1]);
        if last <= FEW {
            axis.len = last as usize + 1 + 2 * MARGIN;
            return Ok(axis);
        }
        let gap = 2 * reach as i64 + 1;
        let (mut end, mut cell) = (0, MARGIN);
        for step in axis.occupied(volume, mask, exec)? {
            let apart = step - end;
            cell += apart.min(gap) as usize;
            if apart > gap {
                axis.pieces.push((step, cell));
            }
            end = step;
        }
        axis.len = cell + 1 + MARGIN;
        Ok(axis)
    }

    /// Number of whole widths from the lowest value.
    #[inline]
    fn step(&self, value: f64) -> i64 {
        let apart = value - self.low;
        if apart.is_finite() {
            (apart / self.width) as i64
        } else {
            ((value / 2.0 - self.low / 2.0) / (self.width / 2.0)) as i64
        }
    }

    /// The cell of a value of the data.
    #[inline]
    pub(super) fn cell(&self, value: f64) -> usize {
        let step = self.step(value);
        if let [(first, cell)] = self.pieces[..] {
            return cell + (step - first) as usize;
        }
        let piece = self.pieces.partition_point(|(first, _)| *first <= step) - 1;
        let (first, cell) = self.pieces[piece];
        cell + (step - first) as usize
    }

    /// The value (real units) at a place; a cell's middle has a whole number.
    pub(super) fn value(&self, place: f64) -> f64 {
        let piece = self.pieces.partition_point(|(_, cell)| *cell as f64 <= place + 0.5).max(1) - 1;
        let (first, cell) = self.pieces[piece];
        let steps = (place - cell as f64) + 0.5 + first as f64;
        self.low + steps * self.width
    }

    /// The steps that hold data, ascending.
    fn occupied(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Result<Vec<i64>, Error> {
        if let Some(found) = histogram::of(volume.voxels(), mask, exec)? {
            let steps =
                found.values.iter().map(|v| self.step(volume.real(*v as f64).clamp(f64::MIN, f64::MAX)));
            return Ok(steps.collect::<BTreeSet<i64>>().into_iter().collect());
        }
        with_voxels!(volume.voxels(), slice => self.occupied_by(volume, slice, mask, exec))
    }

    fn occupied_by<T: Scalar>(
        &self,
        volume: &Volume,
        voxels: &[T],
        mask: Option<&Mask>,
        exec: &Exec,
    ) -> Result<Vec<i64>, Error> {
        let pieces = parallel::pieces(voxels.len(), CHUNK);
        let parts = parallel::try_gather(pieces, &Vec::new, &|steps: &mut Vec<i64>, i| {
            exec.check_cancelled()?;
            let inside = |j: &usize| mask.is_none_or(|m| m.inside()[*j] != 0);
            let data = parallel::piece(voxels.len(), CHUNK, i).filter(|j| voxels[*j].is_data() && inside(j));
            steps.extend(data.map(|j| self.step(real(volume, voxels[j]))));
            steps.sort_unstable();
            steps.dedup();
            Ok::<_, Error>(())
        })?;
        let mut steps = parts.concat();
        steps.sort_unstable();
        steps.dedup();
        Ok(steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::Grid;

    #[test]
    fn gaps_are_shortened_and_places_keep_their_values() {
        let values = vec![0.0_f64, 1.0, 1.2, 9e6, 9e6 + 5.0, 1e18];
        let grid = Grid::with_spacing([values.len(), 1, 1], [1.0; 3]).unwrap();
        let volume = Volume::new(grid, values.clone().into()).unwrap();
        let axis = RangeAxis::new(&volume, None, [0.0, 1e18], 0.5, 8, &Exec::default()).unwrap();
        // Steps 0, 2 (0.25 to be added), then a gap of 17, 10 steps within, again a gap.
        assert_eq!(axis.len, MARGIN + 3 + 16 + 11 + 16 + 1 + MARGIN);
        for v in &values {
            let middle = axis.value(axis.cell(*v) as f64);
            assert!((middle - v).abs() <= 0.25 + 1e-12 * v, "{middle} for {v}");
        }
        assert_eq!(axis.cell(1.0), axis.cell(1.2));
        let near = RangeAxis::new(&volume, None, [0.0, 10.0], 0.5, 8, &Exec::default()).unwrap();
        assert_eq!((near.len, near.cell(0.0), near.cell(10.0)), (21 + 2 * MARGIN, MARGIN, MARGIN + 20));
    }
}
