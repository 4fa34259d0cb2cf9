use ivd_core::ElementKey;

/// A surface before it is a lattice.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Surface {
    pub(super) keys: Vec<ElementKey>,
    pub(super) places: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}
