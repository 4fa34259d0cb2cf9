//! The merges of a tree, while they are found.

use ivd_core::{Buffer, Error, Exec, Iteration, Linkage, Merged, SpillVec};

/// Heights of merges in order; those that fall are lifted to the highest so far.
#[derive(Default)]
pub(super) struct Heights {
    /// Number of merges.
    pub(super) len: usize,
    steps: Vec<f64>,
    ends: Vec<u32>,
    /// Merges lower than one before them.
    inversions: u64,
}

impl Heights {
    #[inline]
    pub(super) fn push(&mut self, height: f64) {
        self.len += 1;
        let highest = self.steps.last().copied().unwrap_or(-1.0);
        self.inversions += u64::from(height < highest);
        if height > highest {
            self.steps.push(height);
            self.ends.push(self.len as u32);
        } else if let Some(end) = self.ends.last_mut() {
            *end = self.len as u32;
        }
    }

    /// Tells whoever listens how many merges there are, and how high the last one.
    pub(super) fn tell(&self, exec: &Exec) {
        let value = self.steps.last().copied().unwrap_or(0.0);
        exec.observer().iteration(Iteration { method: "hvs", index: self.len as u64, value });
    }

    /// With the pairs that they are the heights of.
    pub(super) fn with(self, linkage: Linkage, pairs: SpillVec<[u32; 2]>, bridges: u32) -> Parts {
        debug_assert_eq!(self.len, pairs.len(), "a tree has one merge fewer than leaves");
        let (heights, ends) = (self.steps.into(), self.ends.into());
        Parts { linkage, merges: pairs.into_buffer(), heights, ends, bridges, inversions: self.inversions }
    }
}

/// Merges in order.
pub(super) struct Merges {
    pairs: SpillVec<[u32; 2]>,
    heights: Heights,
    pub(super) bridges: u32,
}

impl Merges {
    /// Room for the merges of so many leaves.
    pub(super) fn of(leaves: usize, exec: &Exec) -> Result<Self, Error> {
        let pairs = exec.bulk("the merges", leaves.saturating_sub(1))?;
        Ok(Self { pairs, heights: Heights::default(), bridges: 0 })
    }

    #[inline]
    pub(super) fn push(&mut self, pair: [u32; 2], height: f64) {
        self.pairs[self.heights.len] = pair;
        self.heights.push(height);
    }

    pub(super) fn full(&self) -> bool {
        self.heights.len == self.pairs.len()
    }

    /// See [`Heights::tell`].
    pub(super) fn tell(&self, exec: &Exec) {
        self.heights.tell(exec);
    }

    pub(super) fn into_parts(self, linkage: Linkage) -> Parts {
        self.heights.with(linkage, self.pairs, self.bridges)
    }
}

/// What becomes part of a tree, and what is told of it.
pub(super) struct Parts {
    pub(super) linkage: Linkage,
    pub(super) merges: Buffer<[u32; 2]>,
    pub(super) heights: Buffer<f64>,
    pub(super) ends: Buffer<u32>,
    pub(super) bridges: u32,
    /// Merges lower than one before them.
    pub(super) inversions: u64,
}

impl Parts {
    pub(super) fn merged(&self) -> Merged<'_> {
        Merged { linkage: self.linkage, merges: &self.merges, heights: &self.heights, ends: &self.ends }
    }
}
