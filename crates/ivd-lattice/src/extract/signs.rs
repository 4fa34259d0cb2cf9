//! One bit a voxel: inside or outside, in rows padded by the border layer.

use ivd_core::{BRICK, BrickIndex, Exec};
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

/// Signs of all voxels. Bit `p` of a row is the padded voxel `p`, so that bits 0 and `n + 1` are 0.
#[derive(Debug)]
pub(super) struct Signs {
    dims: [usize; 3],
    /// Words a row, the last one always 0.
    words: usize,
    rows: Vec<u32>,
    outside: Vec<u32>,
}

impl Signs {
    /// Words that a row of `n` voxels takes: its `n + 2` bits and one word of zeros.
    fn words(n: usize) -> usize {
        (n + 2).div_ceil(32) + 1
    }

    /// Bytes that the signs of a grid take.
    pub(super) fn bytes(dims: [usize; 3]) -> u64 {
        (Self::words(dims[0]) * 4) as u64 * (dims[1] * dims[2]) as u64
    }

    /// Reads the signs of `samples`; where `bricks` are given, only those of mixed bricks are looked at.
    pub(super) fn read(
        samples: &impl Samples,
        dims: [usize; 3],
        bricks: Option<&[BrickState]>,
        exec: &Exec,
    ) -> Result<Self, ivd_core::Error> {
        let words = Self::words(dims[0]);
        let mut rows = vec![0_u32; words * dims[1] * dims[2]];
        let strips = BrickIndex::dims_for(dims);
        rows.par_chunks_mut(words * dims[1]).enumerate().try_for_each(|(z, layer)| {
            exec.check_cancelled()?;
            let mut bytes = vec![0_u8; words * 4];
            for (y, row) in layer.chunks_mut(words).enumerate() {
                let first = dims[0] * (y + dims[1] * z);
                match bricks {
                    None => samples.signs(first, dims[0], &mut bytes),
                    Some(bricks) => {
                        let strip = strips[0] * (y / BRICK + strips[1] * (z / BRICK));
                        read_strip(samples, first, dims[0], &bricks[strip..strip + strips[0]], &mut bytes);
                    }
                }
                pad(&bytes, row);
            }
            Ok::<(), ivd_core::Error>(())
        })?;
        Ok(Self { dims, words, rows, outside: vec![0; words] })
    }

    /// Words of the row at padded `y` and `z`.
    #[inline]
    pub(super) fn row(&self, y: usize, z: usize) -> &[u32] {
        if (1..=self.dims[1]).contains(&y) && (1..=self.dims[2]).contains(&z) {
            &self.rows[self.words * ((y - 1) + self.dims[1] * (z - 1))..][..self.words]
        } else {
            &self.outside
        }
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
                    let row = self.row(y + 1, z + 1);
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

/// Signs of a row of `n` voxels from `first` on, that runs through `bricks`.
fn read_strip(samples: &impl Samples, first: usize, n: usize, bricks: &[BrickState], bytes: &mut [u8]) {
    let mut start = 0;
    for run in bricks.chunk_by(|a, b| a == b) {
        let end = start + run.len();
        match run[0] {
            BrickState::Outside => bytes[start..end].fill(0),
            BrickState::Inside => bytes[start..end].fill(0xFF),
            BrickState::Mixed => {
                let count = (end * BRICK).min(n) - start * BRICK;
                samples.signs(first + start * BRICK, count, &mut bytes[start..end]);
            }
        }
        start = end;
    }
    if !n.is_multiple_of(BRICK) {
        bytes[start - 1] &= (1 << (n % BRICK)) - 1;
    }
}

/// Voxel bits to padded bits: one place up.
fn pad(bytes: &[u8], row: &mut [u32]) {
    let mut carry = 0;
    for (word, bytes) in row.iter_mut().zip(bytes.as_chunks::<4>().0) {
        let bits = u32::from_le_bytes(*bytes);
        *word = bits << 1 | carry;
        carry = bits >> 31;
    }
}
