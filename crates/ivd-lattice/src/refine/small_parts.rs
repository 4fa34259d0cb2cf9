//! Parts so small that a level asks for less than the least of them: a tetrahedron.
//!
//! A noisy scan has a hundred thousand of them, each a voxel that the noise raised above the isovalue. They keep more vertices than their
//! share, and were the others to make up for it, nothing would be left of the body. So the others go as far as their own share of vertices
//! and no further; the level isn't reached then, and the specks are told as the reason.

use ivd_core::Lattice;

use super::params::{Method, RefineParams, Target};
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

/// Share of what a level keeps that the other parts make up for: few specks don't keep a level from being reached.
const MADE_UP: f64 = 0.01;

impl SmallParts {
    /// Those that matter to a target; `None` where it isn't a level, where there are none, or so few that the other parts make up for them, and
    /// where tunnels may close: then parts may vanish.
    pub(super) fn of(lattice: &Lattice, params: &RefineParams) -> Option<Self> {
        let Target::Level(level) = params.target.get() else { return None };
        if params.allow_topology && params.method == Method::Collapse {
            return None;
        }
        let share = 0.25_f64.powi(i32::from(level));
        let roots = component_roots(lattice);
        let mut sizes = vec![0_u32; roots.len()];
        for &root in &roots {
            sizes[root as usize] += 1;
        }
        // A vertex that no triangle names is none.
        let is_small = |size: u32| size > 1 && f64::from(size) * share < LEAST;
        let small = sizes.iter().filter(|&&size| is_small(size));
        let beyond: f64 = small.map(|&size| f64::from(size).min(LEAST) - f64::from(size) * share).sum();
        if beyond <= MADE_UP * share * roots.len() as f64 {
            return None;
        }
        let within: Vec<bool> = roots.iter().map(|&root| is_small(sizes[root as usize])).collect();
        let others = within.iter().filter(|small| !**small).count();
        // Nothing but specks is refined as far as it goes.
        if others == 0 {
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
