//! The merges of a tree, while they are found.

use ivd_core::{Error, Exec, Iteration, SpillVec};

/// Merges in order; heights that fall are lifted to the highest so far.
pub(super) struct Merges {
    pairs: SpillVec<[u32; 2]>,
    len: usize,
    heights: Vec<f64>,
    ends: Vec<u32>,
    /// Merges lower than one before them.
    pub(super) inversions: u64,
    pub(super) bridges: u32,
}

/// What becomes part of a tree.
pub(super) struct Parts {
    pub(super) merges: ivd_core::Buffer<[u32; 2]>,
    pub(super) heights: ivd_core::Buffer<f64>,
    pub(super) ends: ivd_core::Buffer<u32>,
}

impl Merges {
    /// Room for the merges of so many leaves.
    pub(super) fn of(leaves: usize, exec: &Exec) -> Result<Self, Error> {
        let pairs = exec.bulk("the merges", leaves.saturating_sub(1))?;
        Ok(Self { pairs, len: 0, heights: Vec::new(), ends: Vec::new(), inversions: 0, bridges: 0 })
    }

    #[inline]
    pub(super) fn push(&mut self, pair: [u32; 2], height: f64) {
        self.pairs[self.len] = pair;
        self.len += 1;
        let highest = self.heights.last().copied().unwrap_or(-1.0);
        self.inversions += u64::from(height < highest);
        if height > highest {
            self.heights.push(height);
            self.ends.push(self.len as u32);
        } else if let Some(end) = self.ends.last_mut() {
            *end = self.len as u32;
        }
    }

    pub(super) fn full(&self) -> bool {
        self.len == self.pairs.len()
    }

    /// Tells whoever listens how many merges there are, and how high the last one.
    pub(super) fn tell(&self, exec: &Exec) {
        let value = self.heights.last().copied().unwrap_or(0.0);
        exec.observer().iteration(Iteration { method: "hvs", index: self.len as u64, value });
    }

    pub(super) fn into_parts(self) -> Parts {
        debug_assert_eq!(self.len, self.pairs.len(), "a tree has one merge fewer than leaves");
        Parts { merges: self.pairs.into_buffer(), heights: self.heights.into(), ends: self.ends.into() }
    }
}
