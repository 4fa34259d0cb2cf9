//! Rows of voxels as words of signs: which cells between four rows the surface passes through, which voxels of a row start
//! a crossed edge.

use std::ops::Range;

use super::signs::Signs;

/// A row of cells: the four rows of voxels at its corners, in the order of corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellRow<'a> {
    rows: [&'a [u32]; 4],
    /// Words outside of which all voxels of the four rows are outside.
    start: usize,
    end: usize,
}

impl<'a> CellRow<'a> {
    /// The row of cells whose first corners have padded `y` and `z`.
    #[inline]
    pub(super) fn new(signs: &'a Signs, y: usize, z: usize) -> Self {
        let (low, high) = (signs.pair(y, z), signs.pair(y, z + 1));
        let end = low.span[1].max(high.span[1]);
        // The cell at the last bit of a word has its other corners in the next one.
        let start = low.span[0].min(high.span[0]).min(end).saturating_sub(1);
        let rows = [low.rows[0], low.rows[1], high.rows[0], high.rows[1]];
        Self { rows, start: start as usize, end: end as usize }
    }

    /// Calls `visit` with place and signs of the corners of each cell that has corners of both signs, in order.
    #[inline(always)]
    pub(super) fn each_active(&self, mut visit: impl FnMut(usize, u8)) {
        for k in self.words() {
            let bits = |r: usize| u64::from(self.rows[r][k]) | u64::from(self.rows[r][k + 1]) << 32;
            let bits = [bits(0), bits(1), bits(2), bits(3)];
            let any = bits[0] | bits[1] | bits[2] | bits[3];
            let all = bits[0] & bits[1] & bits[2] & bits[3];
            let mut active = ((any | any >> 1) & !(all & all >> 1)) as u32;
            while active != 0 {
                let b = active.trailing_zeros();
                active &= active - 1;
                let pair = |r: usize| (bits[r] >> b) as u8 & 3;
                visit(32 * k + b as usize, pair(0) | pair(1) << 2 | pair(2) << 4 | pair(3) << 6);
            }
        }
    }

    /// Words that hold the first corners of all cells with both signs.
    #[inline]
    pub(super) fn words(&self) -> Range<usize> {
        self.start..self.end
    }

    /// Whether there is no such cell.
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.words().is_empty()
    }

    /// For each axis a bit for each voxel of word `k` of the first row that starts a crossed edge.
    #[inline(always)]
    pub(super) fn crossed(&self, k: usize) -> [u32; 3] {
        let [row, up_y, up_z, _] = self.rows;
        let here = row[k];
        [here ^ (here >> 1 | row[k + 1] << 31), here ^ up_y[k], here ^ up_z[k]]
    }
}
