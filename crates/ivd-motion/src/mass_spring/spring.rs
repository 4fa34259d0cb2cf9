//! A spring, and what it makes of its length.

/// A spring shorter than this fraction of its rest length has no direction and exerts nothing.
pub(super) const NO_DIRECTION: f64 = 1e-6;
/// Stiffness that comes on top beyond the strain limit, in stiffnesses below it.
pub(super) const LIMITED: f64 = 100.0;

/// A vector for every vertex.
pub(super) type Vectors = [[f64; 3]];

/// What a spring makes of its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Law {
    /// Whether it pushes when it is shorter than at rest.
    pub(super) push: bool,
    /// Strain beyond which it is stiffer.
    pub(super) limit: Option<f64>,
}

/// A spring between two vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spring {
    /// Vertices of the body.
    pub(super) ends: [u32; 2],
    /// Length at rest (mm).
    pub(super) length: f64,
    /// Stiffness (g/s²).
    pub(super) stiffness: f64,
}
