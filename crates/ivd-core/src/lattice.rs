use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{Error, Grid, VoxelCoord, World};

/// Least distance of a stored crossing from the ends of its grid edge, as a fraction of the edge (2⁻¹⁰).
/// It keeps triangles from collapsing where the surface touches a voxel, at the price of ≤ 2⁻¹⁰ voxel of displacement.
pub const T_MIN: f32 = 1.0 / 1024.0;

/// Address of a lattice vertex: an element of the grid padded by one voxel on every side.
///
/// Elements 0, 1, 2 are the edges from the voxel along x, y, z; 3, 4, 5 the faces normal to x, y, z; 6 and 7 the cell, which
/// may have two vertices.
/// The padded voxel `p` is the voxel `p - 1`, so that a surface closed one layer outside the volume has addresses.
/// This is the thesis's internal index relation (IIR): it names the voxel a vertex belongs to and survives refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct ElementKey(pub u64);

impl ElementKey {
    /// Key of element `element` (0…7) at padded voxel `padded` (each 0 … n + 1) of a grid of `dims` voxels.
    #[inline]
    pub fn new(dims: [usize; 3], padded: [usize; 3], element: u8) -> Self {
        let [px, py] = [dims[0] as u64 + 2, dims[1] as u64 + 2];
        let voxel = padded[0] as u64 + px * (padded[1] as u64 + py * padded[2] as u64);
        Self(voxel * 8 + u64::from(element))
    }

    /// The element: 0…2 edge, 3…5 face, 6 and 7 cell.
    #[inline]
    pub fn element(self) -> u8 {
        (self.0 & 7) as u8
    }

    /// The padded voxel.
    #[inline]
    pub fn padded(self, dims: [usize; 3]) -> [usize; 3] {
        let [px, py] = [dims[0] as u64 + 2, dims[1] as u64 + 2];
        let voxel = self.0 >> 3;
        [(voxel % px) as usize, (voxel / px % py) as usize, (voxel / (px * py)) as usize]
    }

    /// The voxel that the element starts from; −1 and n lie in the border layer.
    #[inline]
    pub fn voxel(self, dims: [usize; 3]) -> [i64; 3] {
        self.padded(dims).map(|p| p as i64 - 1)
    }
}

/// How a lattice was cut, kept for reports.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum LatticeSource {
    /// The surface where the real value is `iso`; inside is above.
    Iso(f64),
    /// The surface of the real values between `lower` and `upper`; a missing end is open.
    Interval {
        /// Lower crossing.
        lower: Option<f64>,
        /// Upper crossing.
        upper: Option<f64>,
    },
    /// The border of a mask or of its level function.
    Mask,
    /// Not cut from a volume: another program's mesh, put on the grid.
    Foreign,
}

/// A model-fitting lattice: a closed triangle mesh whose every vertex lies on an element of a grid.
///
/// Positions are not stored: vertex `i` is at voxel coordinate `key.voxel + place`, so that an origin 10⁶ mm away
/// costs no precision. Refinement keeps a subset of the vertices with unchanged keys and places.
/// Triangles are counter-clockwise seen from outside (in world space, whatever the handedness of the grid).
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// The grid it was cut from.
    pub grid: Grid,
    /// How it was cut.
    pub source: LatticeSource,
    /// Address of each vertex, strictly ascending.
    pub keys: Vec<ElementKey>,
    /// Offset of each vertex from its key's voxel (voxels), 0 ≤ p < 1. In an extracted lattice, on an edge only its own axis
    /// is not 0 and lies in `[T_MIN, 1 - T_MIN]`; in a foreign one the element is no more than the nearest free one.
    pub places: Vec<[f32; 3]>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Refinement level: about a quarter of the vertices is kept per level; 0 as extracted.
    pub level: u8,
    /// Bound on the distance to the extracted lattice (mm); 0 at level 0.
    pub max_error_mm: f64,
    /// Coarser levels on the same vertices, each on a subset of those of the one before: a viewer switches between them.
    /// Empty for most.
    pub coarser: Vec<Coarser>,
}

/// A coarser level of a lattice, in the numbers of its vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Coarser {
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// As [`Lattice::level`].
    pub level: u8,
    /// As [`Lattice::max_error_mm`].
    pub max_error_mm: f64,
}

impl Lattice {
    /// Checks lengths, indices and the order of keys.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first thing that doesn't fit.
    pub fn check(&self) -> Result<(), Error> {
        let bad = |problem: String| Error::Inconsistent { what: "lattice", problem };
        if self.keys.len() != self.places.len() {
            return Err(bad(format!("{} keys, {} places", self.keys.len(), self.places.len())));
        }
        if let Some(i) = self.keys.windows(2).position(|w| w[0] >= w[1]) {
            return Err(bad(format!("keys of vertices {i} and {} are not ascending", i + 1)));
        }
        let padded: u64 = self.grid.dims().iter().map(|&d| d as u64 + 2).product();
        if self.keys.last().is_some_and(|k| k.0 >= padded * 8) {
            return Err(bad("a key lies outside the padded grid".into()));
        }
        if let Some(i) = self.places.iter().position(|p| !p.iter().all(|c| (0.0..=1.0).contains(c))) {
            return Err(bad(format!("place of vertex {i} leaves 0…1")));
        }
        let n = self.keys.len() as u32;
        if let Some(i) = self.triangles.iter().position(|t| t.iter().any(|&v| v >= n)) {
            return Err(bad(format!("triangle {i} names a vertex beyond {n}")));
        }
        for (k, coarser) in self.coarser.iter().enumerate() {
            if let Some(i) = coarser.triangles.iter().position(|t| t.iter().any(|&v| v >= n)) {
                return Err(bad(format!("triangle {i} of coarser level {k} names a vertex beyond {n}")));
            }
        }
        Ok(())
    }

    /// Number of levels, this one included.
    pub fn levels(&self) -> usize {
        self.coarser.len() + 1
    }

    /// A level as a lattice of its own, 0 this one; `None` beyond the last.
    pub fn at_level(&self, level: usize) -> Option<Self> {
        let Some(at) = level.checked_sub(1) else {
            return Some(Self { coarser: Vec::new(), ..self.clone() });
        };
        let coarser = self.coarser.get(at)?;
        let kept = self.vertices_at_level(level);
        let mut rank = vec![u32::MAX; self.keys.len()];
        for (new, &old) in kept.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        Some(Self {
            grid: self.grid.clone(),
            source: self.source.clone(),
            keys: kept.iter().map(|&v| self.keys[v as usize]).collect(),
            places: kept.iter().map(|&v| self.places[v as usize]).collect(),
            triangles: coarser.triangles.iter().map(|t| t.map(|v| rank[v as usize])).collect(),
            level: coarser.level,
            max_error_mm: coarser.max_error_mm,
            coarser: Vec::new(),
        })
    }

    /// Vertices of a level, ascending: those that its triangles name, and those that no triangle of the finest names.
    /// Empty beyond the last level.
    pub fn vertices_at_level(&self, level: usize) -> Vec<u32> {
        let mut named = vec![true; self.keys.len()];
        if let Some(at) = level.checked_sub(1) {
            let Some(coarser) = self.coarser.get(at) else { return Vec::new() };
            for &v in self.triangles.as_flattened() {
                named[v as usize] = false;
            }
            for &v in coarser.triangles.as_flattened() {
                named[v as usize] = true;
            }
        }
        (0..named.len() as u32).filter(|&v| named[v as usize]).collect()
    }

    /// Voxel coordinate of vertex `i`.
    #[inline]
    pub fn voxel(&self, i: usize) -> VoxelCoord {
        let v = self.keys[i].voxel(self.grid.dims());
        let p = self.places[i];
        VoxelCoord(Vector3::from_fn(|a, _| v[a] as f64 + f64::from(p[a])))
    }

    /// World position of vertex `i` (mm).
    pub fn world(&self, i: usize) -> World {
        self.grid.world(self.voxel(i))
    }

    /// World positions (mm) of all vertices, shape `[vertex_count, 3]`.
    pub fn positions(&self) -> Vec<Vector3<f64>> {
        use rayon::prelude::*;
        let (linear, origin) = (self.grid.linear_part(), Vector3::from(self.grid.origin()));
        (0..self.keys.len()).into_par_iter().map(|i| origin + linear * self.voxel(i).0).collect()
    }

    /// World positions (mm) relative to the grid's origin: exact differences even 10⁶ mm away from 0.
    pub fn local_positions(&self) -> Vec<Vector3<f64>> {
        use rayon::prelude::*;
        let linear = self.grid.linear_part();
        (0..self.keys.len()).into_par_iter().map(|i| linear * self.voxel(i).0).collect()
    }

    /// The vertex at an address, by binary search.
    pub fn vertex_at(&self, key: ElementKey) -> Option<u32> {
        self.keys.binary_search(&key).ok().map(|i| i as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_name_voxel_and_element_up_to_the_far_border() {
        let dims = [5, 6, 7];
        for padded in [[0, 0, 0], [6, 7, 8], [3, 0, 8]] {
            for element in 0..8 {
                let key = ElementKey::new(dims, padded, element);
                assert_eq!((key.padded(dims), key.element()), (padded, element));
            }
        }
        assert_eq!(ElementKey::new(dims, [0, 1, 2], 3).voxel(dims), [-1, 0, 1]);
    }
}
