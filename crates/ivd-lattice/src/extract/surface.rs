use ivd_core::ElementKey;

/// A surface before it is a lattice.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surface {
    /// Where its vertices are, ascending.
    pub keys: Vec<ElementKey>,
    /// Their offsets from their voxels.
    pub places: Vec<[f32; 3]>,
    /// Its triangles, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}
