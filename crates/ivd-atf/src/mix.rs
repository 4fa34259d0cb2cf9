//! Which materials show at a value, by the label of the voxel.

use ivd_core::NO_DATA;

use crate::edges::{WeightedGaussian, Window, are_separate, windows};
use crate::roles::{AIR, Role};
use crate::statistics::ClassStatistics;

/// Hounsfield values above [`AIR`] over which opacity rises from nothing to its whole.
const AIR_FADES: f64 = 100.0;

/// Which classes a value belongs to, and how much: one answer for each row of the table. Classes are numbered in the order of their means.
///
/// The row of a label shows what its values say, without the other classes that values can't tell from the label's own. Where values tell all
/// classes apart, all rows are the same.
pub(crate) struct Mix<'a> {
    pub(crate) classes: &'a [ClassStatistics],
    pub(crate) roles: &'a [Role],
    pub(crate) windows: Vec<Window>,
    /// Whether a class shows in a class's row, at `row * classes + class`; empty where all rows are the same.
    apart: Vec<bool>,
    clear_air: bool,
}

impl<'a> Mix<'a> {
    /// `clear_air`: whether Hounsfield values up to −900 are clear, and those up to −800 in part.
    pub(crate) fn new(
        classes: &'a [ClassStatistics],
        roles: &'a [Role],
        gaussians: &[WeightedGaussian],
        softness: f64,
        clear_air: bool,
    ) -> Self {
        let is_apart = |a: usize, b: usize| {
            a == b
                || gaussians[a].is_transition
                || gaussians[b].is_transition
                || are_separate(&gaussians[a], &gaussians[b])
        };
        let n = gaussians.len();
        let mut apart: Vec<bool> = (0..n * n).map(|i| is_apart(i / n, i % n)).collect();
        if apart.iter().all(|&is| is) {
            apart.clear();
        }
        Self { classes, roles, windows: windows(gaussians, softness), apart, clear_air }
    }

    /// Number of different rows: the union's, and one for each class where they aren't all the same.
    pub(crate) fn rows(&self) -> usize {
        if self.apart.is_empty() { 1 } else { 1 + self.classes.len() }
    }

    /// Whether values tell all materials apart.
    pub(crate) fn tells_materials_apart(&self) -> bool {
        let n = self.classes.len();
        let is_material = |class: &usize| self.roles[*class] == Role::Material;
        self.apart.is_empty()
            || (0..n).filter(is_material).all(|a| (0..n).filter(is_material).all(|b| self.apart[a * n + b]))
    }

    /// The row of a class.
    pub(crate) fn row(&self, class: usize) -> usize {
        if self.apart.is_empty() || self.classes[class].id == NO_DATA { 0 } else { 1 + class }
    }

    /// Classes that have a weight at a value, with their weights: to be asked once for all rows.
    pub(crate) fn at(&self, value: f64) -> Vec<(usize, f64)> {
        let weights = self.windows.iter().enumerate().map(|(class, window)| (class, window.weight(value)));
        weights.filter(|(class, weight)| *weight > 0.0 && self.roles[*class] != Role::Transition).collect()
    }

    /// The materials among `at`, what [`Self::at`] gave for a value, with their share of a row there. Shares add up to at most 1; what is
    /// missing is clear.
    pub(crate) fn shares(&self, row: usize, value: f64, at: &[(usize, f64)], out: &mut Vec<(usize, f64)>) {
        out.clear();
        let n = self.classes.len();
        let shows = |class: usize| row == 0 || self.apart[(row - 1) * n + class];
        let all: f64 = at.iter().filter(|(class, _)| shows(*class)).map(|(_, weight)| weight).sum();
        let share = self.above_air(value) / all.max(1.0);
        for &(class, weight) in at {
            if shows(class) && self.roles[class] == Role::Material && share > 0.0 {
                out.push((class, weight * share));
            }
        }
    }

    /// What air leaves of the opacity at a value.
    pub(crate) fn above_air(&self, value: f64) -> f64 {
        if !self.clear_air {
            return 1.0;
        }
        let t = ((value - AIR) / AIR_FADES).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}
