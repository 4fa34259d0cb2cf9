//! One bit a voxel: inside or outside, in rows padded by the border layer.

use std::ops::Range;

use ivd_core::{BRICK, BrickIndex, Exec, parallel};
use rayon::prelude::*;

use super::bounds::{Bounds, Ordered};
use super::samples::Samples;

/// What is known of a brick's voxels before looking at them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BrickState {
    Outside,
    Inside,
    Mixed,
}

/// The state of each brick, from the range of its stored values.
pub(super) fn brick_states<T: Ordered>(index: &BrickIndex, bounds: &Bounds<T>) -> Vec<BrickState> {
    let (first, last) = (bounds.first.to_f64(), bounds.last.to_f64());
    let state = |brick| {
        let range = index.range(brick);
        let (min, max) = (f64::from(range.min), f64::from(range.max));
        if max < first || min > last {
            BrickState::Outside
        } else if min >= first && max <= last && !range.missing {
            BrickState::Inside
        } else {
            BrickState::Mixed
        }
    };
    (0..index.len()).map(state).collect()
}

/// Signs of all voxels. Bit `p` of a row is the padded voxel `p`, so that bits 0 and `n + 1` are 0; so are the rows of the border
/// layer.
#[derive(Debug, Default)]
pub(super) struct Signs {
    dims: [usize; 3],
    /// Words a row, the last one always 0.
    words: usize,
    rows: Vec<u32>,
    /// Of each row the first word with a voxel inside and the one after the last.
    spans: Vec<[u32; 2]>,
}

/// Two rows side by side along y.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair<'a> {
    pub(super) rows: [&'a [u32]; 2],
    /// Words outside of which neither has a voxel inside.
    pub(super) span: [u32; 2],
}

/// The span of a row without a voxel inside.
const NOTHING: [u32; 2] = [u32::MAX, 0];

impl Signs {
    /// Words that a row of `n` voxels takes: its `n + 2` bits and one word of zeros.
    fn words(n: usize) -> usize {
        (n + 2).div_ceil(32) + 1
    }

    /// Bytes that the signs of a grid take.
    pub(super) fn bytes(dims: [usize; 3]) -> u64 {
        let row = Self::words(dims[0]) * 4 + size_of::<[u32; 2]>();
        row as u64 * (dims[1] + 2) as u64 * (dims[2] + 2) as u64
    }

    /// Reads the signs of `samples` into the memory of `self`; where `bricks` are given, only those of mixed bricks are looked
    /// at.
    pub(super) fn read(
        self,
        samples: &impl Samples,
        dims: [usize; 3],
        bricks: Option<&[BrickState]>,
        exec: &Exec,
    ) -> Result<Self, ivd_core::Error> {
        let words = Self::words(dims[0]);
        let [nx, ny, nz] = dims;
        let Self { rows, mut spans, .. } = self;
        let mut rows = zeros(rows, words * (ny + 2) * (nz + 2));
        spans.clear();
        spans.resize((ny + 2) * (nz + 2), NOTHING);
        let strips = BrickIndex::dims_for(dims);
        let layers = rows.chunks_mut(words * (ny + 2)).zip(spans.chunks_mut(ny + 2));
        let layers: Vec<_> = layers.skip(1).take(nz).enumerate().collect();
        parallel::try_for_each_of(layers, &|(z, (rows, spans))| {
            exec.check_cancelled()?;
            let mut bytes = vec![0_u8; words * 4];
            for by in 0..strips[1] {
                let runs = match bricks {
                    Some(bricks) => runs(&bricks[strips[0] * (by + strips[1] * (z / BRICK))..][..strips[0]]),
                    None => vec![(0..strips[0], BrickState::Mixed)],
                };
                if runs.iter().all(|(_, state)| *state == BrickState::Outside) {
                    continue;
                }
                for y in by * BRICK..(by * BRICK + BRICK).min(ny) {
                    read_strip(samples, nx * (y + ny * z), nx, &runs, &mut bytes);
                    spans[y + 1] = pad(&bytes, &mut rows[words * (y + 1)..][..words]);
                }
            }
            Ok::<(), ivd_core::Error>(())
        })?;
        Ok(Self { dims, words, rows, spans })
    }

    /// Words a row, and all rows.
    pub(super) fn as_words(&self) -> (usize, &[u32]) {
        (self.words, &self.rows)
    }

    /// The rows at padded `y` and `y + 1`, both of padded `z`.
    #[inline]
    pub(super) fn pair(&self, y: usize, z: usize) -> Pair<'_> {
        let first = y + (self.dims[1] + 2) * z;
        let (a, b) = self.rows[self.words * first..][..2 * self.words].split_at(self.words);
        let (s, t) = (self.spans[first], self.spans[first + 1]);
        Pair { rows: [a, b], span: [s[0].min(t[0]), s[1].max(t[1])] }
    }

    /// Number of bricks that hold voxels of both signs.
    pub(super) fn mixed_bricks(&self) -> u64 {
        let bricks = BrickIndex::dims_for(self.dims);
        let end = |b: usize, n: usize| (b * BRICK + BRICK + 1).min(n);
        let mixed = |b: usize| {
            let [bx, by, bz] = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
            let (mut any, mut all) = (0, u64::MAX);
            for z in bz * BRICK..end(bz, self.dims[2]) {
                for y in by * BRICK..end(by, self.dims[1]) {
                    let row = self.pair(y + 1, z + 1).rows[0];
                    let at = bx * BRICK + 1;
                    let next = row.get(at / 32 + 1).copied().unwrap_or(0);
                    let bits = (u64::from(row[at / 32]) | u64::from(next) << 32) >> (at % 32);
                    any |= bits;
                    all &= bits;
                }
            }
            let mask = (1_u64 << (end(bx, self.dims[0]) - bx * BRICK)) - 1;
            any & mask != 0 && all & mask != mask
        };
        (0..bricks.iter().product()).into_par_iter().filter(|&b| mixed(b)).count() as u64
    }
}

/// As many zeros, in the memory of `spare` where that is enough: else pages that nobody writes to are never fetched.
fn zeros(mut spare: Vec<u32>, len: usize) -> Vec<u32> {
    if spare.capacity() < len {
        drop(spare);
        return vec![0; len];
    }
    spare.clear();
    spare.resize(len, 0);
    spare
}

/// Runs of bricks of one state.
fn runs(bricks: &[BrickState]) -> Vec<(Range<usize>, BrickState)> {
    let mut start = 0;
    let run = |run: &[BrickState]| {
        let bricks = start..start + run.len();
        start = bricks.end;
        (bricks, run[0])
    };
    bricks.chunk_by(|a, b| a == b).map(run).collect()
}

/// Signs of a row of `n` voxels from `first` on, that goes through `runs` of bricks.
fn read_strip(
    samples: &impl Samples,
    first: usize,
    n: usize,
    runs: &[(Range<usize>, BrickState)],
    bytes: &mut [u8],
) {
    for (run, state) in runs {
        let bytes = &mut bytes[run.clone()];
        match state {
            BrickState::Outside => bytes.fill(0),
            BrickState::Inside => bytes.fill(0xFF),
            BrickState::Mixed => {
                let start = run.start * BRICK;
                samples.signs(first + start, (run.end * BRICK).min(n) - start, bytes);
            }
        }
    }
    if !n.is_multiple_of(BRICK) {
        bytes[n / BRICK] &= (1 << (n % BRICK)) - 1;
    }
}

/// Voxel bits to padded bits: one place up. Returns the span of words that aren't 0.
fn pad(bytes: &[u8], row: &mut [u32]) -> [u32; 2] {
    let mut carry = 0;
    let mut span = NOTHING;
    for (k, (word, bytes)) in (0..).zip(row.iter_mut().zip(bytes.as_chunks::<4>().0)) {
        let bits = u32::from_le_bytes(*bytes);
        *word = bits << 1 | carry;
        carry = bits >> 31;
        if *word != 0 {
            span = [span[0].min(k), k + 1];
        }
    }
    span
}
