//! How far what is inside may go, and when it is seen that it goes further.

use nalgebra::Vector3;

use super::matrix::Triple;

/// Nodes are ruled out that go beyond the bound by this many times what the last iteration has changed of how far they go, ...
const CHANGES: f64 = 4.0;
/// ... and by this many times the residual of their equations, ...
const RESIDUALS: f64 = 20.0;
/// ... from this residual on.
const ROUGH: f64 = 1e-3;

/// How far what is inside may go (mm).
pub(super) struct Bound {
    pub(super) most: f64,
    /// Nodes that go as far as a voxel of the part does.
    pub(super) nodes: Vec<u32>,
}

impl Bound {
    /// Whether nodes with such a residual go further, and would if they were found better, as far as can be told.
    ///
    /// - `last`: how far those of the iteration before went.
    pub(super) fn rules_out(&self, nodes: &[Triple], residual: f64, last: &mut f64) -> bool {
        let reach = self.reach(nodes);
        let changed = (reach - std::mem::replace(last, reach)).abs();
        residual <= ROUGH && reach > self.most + (CHANGES * changed).max(RESIDUALS * residual * self.most)
    }

    /// How far those go (mm), a voxel's digits apart.
    pub(super) fn reach(&self, nodes: &[Triple]) -> f64 {
        let far = |node: &u32| Vector3::from(nodes[*node as usize]).norm_squared();
        self.nodes.iter().map(far).fold(0.0, f64::max).sqrt() * (1.0 - 1e-6)
    }
}
