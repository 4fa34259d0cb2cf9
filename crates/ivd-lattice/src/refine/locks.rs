use ivd_core::{Lattice, ParamError, World};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Vertices that a refinement keeps, whatever its method: places that are moved, measured or fastened later.
///
/// They belong to one lattice and not to [`RefineParams`](super::RefineParams), which may be used for many.
/// [`vertices_within`] finds them by their place.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Locks<'a> {
    /// Vertices that stay, in any order; repeats do no harm.
    pub vertices: &'a [u32],
}

impl Locks<'_> {
    /// No vertex is locked.
    pub const NONE: Self = Self { vertices: &[] };

    /// Checks that every lock names a vertex.
    ///
    /// # Errors
    /// [`ParamError`] names the first that doesn't.
    pub fn check(&self, lattice: &Lattice) -> Result<(), ParamError> {
        let n = lattice.keys().len();
        match self.vertices.iter().find(|&&v| v as usize >= n) {
            None => Ok(()),
            Some(v) => Err(ParamError::new(
                "locks",
                format!("vertex {v} of a lattice of {n}"),
                "name vertices of the lattice to be refined",
            )),
        }
    }

    /// Whether each of `n` vertices is locked.
    pub(super) fn flags(&self, n: usize) -> Vec<bool> {
        let mut locked = vec![false; n];
        for &v in self.vertices {
            locked[v as usize] = true;
        }
        locked
    }
}

/// Vertices of a lattice within a distance of a place, ascending.
///
/// - `centre`: world position (mm); `radius_mm`: largest distance (mm), taken along straight lines.
pub fn vertices_within(lattice: &Lattice, centre: World, radius_mm: f64) -> Vec<u32> {
    // Relative to the origin, so that a grid far away loses nothing.
    let centre = centre.0 - Vector3::from(lattice.grid().origin());
    let linear = lattice.grid().linear_part();
    (0..lattice.keys().len())
        .into_par_iter()
        .filter(|&i| (linear * lattice.voxel(i).0 - centre).norm() <= radius_mm)
        .map(|i| i as u32)
        .collect()
}
