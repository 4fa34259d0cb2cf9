//! Parts so small that a level asks for less than the least of them: a tetrahedron.
//!
//! A noisy scan has a hundred thousand of them, each a voxel that the noise raised above the isovalue. They keep more vertices than their
//! share, and were the others to make up for it, nothing would be left of the body. So the others go as far as their own share of vertices
//! and no further; the level isn't reached then, and the specks are told as the reason.

use ivd_core::Lattice;

use super::params::{RefineParams, Target};
use crate::figures::component_roots;

/// Vertices of the least closed surface.
const LEAST: f64 = 4.0;

/// Which vertices are of small parts, and how far the others go.
pub(super) struct SmallParts {
    /// Of every vertex, in the lattice's numbers.
    within: Vec<bool>,
    /// Vertices that may still be removed from the other parts.
    left: usize,
}

impl SmallParts {
    /// Those that matter to a level; `None` where it has none, where the others alone reach it, or where tunnels may close: then parts may vanish.
    pub(super) fn of(lattice: &Lattice, params: &RefineParams) -> Option<Self> {
        match params.target.get() {
            Target::Level(level) if !params.allow_topology => Self::at(lattice, level),
            _ => None,
        }
    }

    /// As [`SmallParts::of`], of a level.
    pub(super) fn at(lattice: &Lattice, level: u8) -> Option<Self> {
        let share = 0.25_f64.powi(i32::from(level));
        let roots = component_roots(lattice);
        let mut sizes = vec![0_u32; roots.len()];
        roots.iter().for_each(|&root| sizes[root as usize] += 1);
        let is_small = |root: u32| f64::from(sizes[root as usize]) * share < LEAST;
        let within: Vec<bool> = roots.iter().map(|&root| is_small(root)).collect();
        let others = within.iter().filter(|small| !**small).count();
        // A single speck, or nothing else, is refined as far as it goes.
        if others == 0 || others == roots.len() {
            return None;
        }
        Some(Self { within, left: others - (others as f64 * share).round() as usize })
    }

    /// Whether a vertex may be removed.
    pub(super) fn allow(&self, v: u32) -> bool {
        self.left > 0 || self.within[v as usize]
    }

    /// Counts vertices that were removed.
    pub(super) fn count(&mut self, removed: impl Iterator<Item = u32>) {
        self.left -= removed.filter(|&v| !self.within[v as usize]).count();
    }

    /// Leaves the dearest out of a queue where it would go too far in the other parts.
    ///
    /// - `vertex`: number of an entry's vertex.
    pub(super) fn shorten(&self, entries: &mut Vec<u64>, vertex: impl Fn(u64) -> u32) {
        let is_small = |entry: &u64| self.within[vertex(*entry) as usize];
        let mut others: Vec<u64> = entries.iter().copied().filter(|entry| !is_small(entry)).collect();
        if others.len() <= self.left {
            return;
        }
        entries.retain(is_small);
        if self.left > 0 {
            others.select_nth_unstable(self.left - 1);
            entries.extend_from_slice(&others[..self.left]);
        }
    }
}
