use std::collections::BTreeMap;

use ivd_core::BRICK;
use rayon::prelude::*;

use crate::classify::Classifier;
use crate::samples::{Samples, Stored};

/// Which of a brick's 8³ cells must be sampled: a word for each layer, bit `x + 8 y`. A cache line holds a brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(align(64))]
pub(crate) struct Cells([u64; BRICK]);

/// A brick whose every cell must be sampled.
pub(crate) static ALL: Cells = Cells([u64::MAX; BRICK]);
/// A brick that may be passed over.
const NONE: Cells = Cells([0; BRICK]);

/// Voxels along the edge of a brick with those that its last cells end at.
const EDGE: usize = BRICK + 1;

impl Cells {
    /// Whether a cell of the volume, which must lie in this brick, must be sampled.
    #[inline(always)]
    pub(crate) fn must_look(&self, cell: [usize; 3]) -> bool {
        self.0[cell[2] % BRICK] >> (cell[0] % BRICK + BRICK * (cell[1] % BRICK)) & 1 == 1
    }
}

/// Finds the cells that must be sampled in every brick: those whose eight voxels don't lie in one clear interval of the transfer function for
/// the rows of their brick. Noise that leaves hardly a brick clear leaves most cells clear.
///
/// - `empty`: bricks that are passed over as a whole.
/// - `rows`: for each brick, the rows that its labels choose.
/// - `spans`: for each brick with data, the least and greatest fast value.
pub(crate) fn cells<T: Stored>(
    samples: &Samples<'_, T>,
    classifier: &Classifier,
    empty: &[bool],
    rows: &[u64],
    spans: &[[f32; 2]],
) -> Vec<Cells> {
    let mut intervals: BTreeMap<u64, Intervals> = BTreeMap::new();
    for (&rows, _) in rows.iter().zip(empty).filter(|(_, empty)| !**empty) {
        intervals.entry(rows).or_insert_with(|| Intervals::new(classifier.clear_intervals(rows)));
    }
    let bricks = samples.shape.dims.map(|n| n.div_ceil(BRICK));
    (0..empty.len())
        .into_par_iter()
        .map(|b| {
            if empty[b] {
                return NONE;
            }
            let intervals = &intervals[&rows[b]];
            if !intervals.any_clear(spans[b].map(|value| classifier.index(value))) {
                return ALL;
            }
            let at = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
            of_brick(samples, classifier, &intervals.of_index, at.map(|c| c * BRICK))
        })
        .collect()
}

/// The clear intervals of the value axis for a set of rows.
struct Intervals {
    /// Interval of each index of the value axis; 0 for none.
    of_index: Vec<u8>,
    /// How many indices before each lie in an interval.
    clear_before: Vec<u32>,
}

impl Intervals {
    fn new(of_index: Vec<u8>) -> Self {
        let mut count = 0;
        let clear_before = std::iter::once(0)
            .chain(of_index.iter().map(|&interval| {
                count += u32::from(interval != 0);
                count
            }))
            .collect();
        Self { of_index, clear_before }
    }

    /// Whether some index from the first to the last lies in an interval.
    fn any_clear(&self, [first, last]: [usize; 2]) -> bool {
        self.clear_before[last + 1] > self.clear_before[first]
    }
}

/// Cells of the brick that begins at voxel `first`. A voxel beyond the grid counts as the one at its side.
fn of_brick<T: Stored>(
    samples: &Samples<'_, T>,
    classifier: &Classifier,
    intervals: &[u8],
    first: [usize; 3],
) -> Cells {
    let dims = samples.shape.dims;
    let mut of_voxel = [[[0_u8; EDGE]; EDGE]; EDGE];
    for (z, layer) in of_voxel.iter_mut().enumerate() {
        for (y, row) in layer.iter_mut().enumerate() {
            let (vy, vz) = ((first[1] + y).min(dims[1] - 1), (first[2] + z).min(dims[2] - 1));
            let line = &samples.voxels()[dims[0] * (vy + dims[1] * vz)..][..dims[0]];
            for (x, interval) in row.iter_mut().enumerate() {
                let value = line[(first[0] + x).min(dims[0] - 1)];
                // Missing data is clear, but so is nothing that it touches for sure: look.
                *interval = if value.is_data() { intervals[classifier.index(value.single())] } else { 0 };
            }
        }
    }
    let mut words = [0_u64; BRICK];
    for (z, word) in words.iter_mut().enumerate() {
        for y in 0..BRICK {
            let rows = [&of_voxel[z][y], &of_voxel[z][y + 1], &of_voxel[z + 1][y], &of_voxel[z + 1][y + 1]];
            for x in 0..BRICK {
                let interval = rows[0][x];
                let one = rows.iter().all(|row| row[x] == interval && row[x + 1] == interval);
                *word |= u64::from(interval == 0 || !one) << (x + BRICK * y);
            }
        }
    }
    Cells(words)
}
