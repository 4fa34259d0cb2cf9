//! The voxels in pieces of rows, with their values in the frame.

use ivd_core::{Mask, Scalar};

use super::mixture::Frame;

/// Longest piece of a row: its densities stay close to the processor.
pub(super) const PIECE: usize = 512;
/// Voxels of a chunk, about. Sums are joined by chunks, never by threads.
const CHUNK: usize = 1 << 15;

/// Voxels of a chunk: whole rows where they are short enough.
pub(super) fn chunk([nx, _, _]: [usize; 3]) -> usize {
    if nx <= CHUNK { nx * (CHUNK / nx) } else { CHUNK }
}

/// Some neighbouring voxels of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    /// Linear index of the first.
    pub(super) start: usize,
    pub(super) len: usize,
    /// Index of the first along each axis.
    pub(super) at: [usize; 3],
}

impl Piece {
    pub(super) fn range(&self) -> std::ops::Range<usize> {
        self.start..self.start + self.len
    }
}

/// The pieces of the voxels `start … end - 1`.
pub(super) fn pieces([nx, ny, _]: [usize; 3], start: usize, end: usize) -> impl Iterator<Item = Piece> {
    let mut next = start;
    std::iter::from_fn(move || {
        let start = next;
        let at = [start % nx, start / nx % ny, start / nx / ny];
        let len = (nx - at[0]).min(PIECE).min(end - start);
        next += len;
        (len > 0).then_some(Piece { start, len, at })
    })
}

/// Values of a piece in the frame, and where there are any.
#[derive(Debug)]
pub(super) struct Values {
    /// 0 where there is no datum.
    pub(super) t: [f64; PIECE],
    /// 1 for a datum, else 0.
    pub(super) valid: [f64; PIECE],
    pub(super) all_valid: bool,
}

impl Values {
    pub(super) fn new() -> Self {
        Self { t: [0.0; PIECE], valid: [1.0; PIECE], all_valid: true }
    }

    pub(super) fn fill<T: Scalar>(
        &mut self,
        voxels: &[T],
        mask: Option<&Mask>,
        piece: &Piece,
        frame: &Frame,
    ) {
        let (rate, centre) = (1.0 / frame.unit, frame.centre / frame.unit);
        let voxels = &voxels[piece.range()];
        for (t, v) in self.t.iter_mut().zip(voxels) {
            *t = v.to_f64() * rate - centre;
        }
        if mask.is_none() && T::TYPE.is_integer() {
            return;
        }
        self.all_valid = true;
        for (i, v) in voxels.iter().enumerate() {
            let valid = v.is_data() && mask.is_none_or(|m| m.inside()[piece.start + i] != 0);
            self.valid[i] = f64::from(u8::from(valid));
            if !valid {
                self.t[i] = 0.0;
                self.all_valid = false;
            }
        }
    }
}

impl Values {
    /// Every second voxel of a row whose voxels are `row[0] … row[1] - 1`: those at `2 i + parity`, `i` from `from` to `to - 1`.
    pub(super) fn fill_every_second<T: Scalar>(
        &mut self,
        voxels: &[T],
        mask: Option<&Mask>,
        row: [usize; 2],
        [from, to, parity]: [usize; 3],
        frame: &Frame,
    ) {
        self.all_valid = true;
        for i in 0..to - from {
            let at = row[0] + 2 * (from + i) + parity;
            let valid = at < row[1] && voxels[at].is_data() && mask.is_none_or(|m| m.inside()[at] != 0);
            self.all_valid &= valid;
            self.valid[i] = f64::from(u8::from(valid));
            self.t[i] = if valid { frame.value(voxels[at].to_f64()) } else { 0.0 };
        }
    }
}
