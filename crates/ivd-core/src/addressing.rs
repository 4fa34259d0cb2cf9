//! The thesis's internal index relation: from a voxel to its vertices, and from a vertex to its voxels.

use std::ops::Range;

use crate::{ElementKey, Lattice, World};

/// Where a vertex lies and what it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct VertexDescription {
    /// Number of the vertex.
    pub vertex: u32,
    /// Voxel that its element starts from; −1 and n lie in the border layer.
    pub voxel: [i64; 3],
    /// Name of its element, such as `edge x`; `cell, further` for a vertex within the cell whose key is that of an edge or face
    /// that has no vertex.
    pub element: &'static str,
    /// Offset from the voxel (voxels).
    pub place: [f32; 3],
    /// Position (mm), RAS.
    pub world: World,
    /// Voxels whose element it is: two for an edge, four for a face, eight for a cell, the lowest first.
    pub voxels: Vec<[i64; 3]>,
}

impl ElementKey {
    /// Name of the element: `edge x`, `face normal to y`, `cell`, `cell, second`.
    pub fn element_name(self) -> &'static str {
        const NAMES: [&str; 8] = [
            "edge x",
            "edge y",
            "edge z",
            "face normal to x",
            "face normal to y",
            "face normal to z",
            "cell",
            "cell, second",
        ];
        NAMES[usize::from(self.element())]
    }

    /// Voxels at the corners of the element, x fastest: two of an edge, four of a face, eight of a cell.
    ///
    /// - `dims`: voxels of the grid. Voxels may lie in the border layer, or one beyond it.
    pub fn voxels(self, dims: [usize; 3]) -> Vec<[i64; 3]> {
        let first = self.voxel(dims);
        let axis = usize::from(self.element() % 3);
        let reaches = match self.element() {
            0..=2 => std::array::from_fn(|a| a == axis),
            3..=5 => std::array::from_fn(|a| a != axis),
            _ => [true; 3],
        };
        (0..8_usize)
            .filter(|corner| (0..3).all(|a| corner >> a & 1 == 0 || reaches[a]))
            .map(|corner| std::array::from_fn(|a| first[a] + (corner >> a & 1) as i64))
            .collect()
    }
}

impl Lattice {
    /// Vertices whose elements start from a voxel, at most eight: two binary searches, as keys ascend.
    ///
    /// Empty where there are none, and for voxels outside the padded grid.
    pub fn vertices_of_voxel(&self, voxel: [i64; 3]) -> Range<u32> {
        let dims = self.grid().dims();
        let inside = (0..3).all(|a| voxel[a] >= -1 && voxel[a] <= dims[a] as i64);
        if !inside {
            return 0..0;
        }
        let key = ElementKey::new(dims, voxel.map(|v| (v + 1) as usize), 0);
        let start = self.keys().partition_point(|k| *k < key);
        let count = self.keys()[start..].partition_point(|k| k.0 < key.0 + 8);
        start as u32..(start + count) as u32
    }

    /// Vertices that have a voxel among those of their element, ascending.
    pub fn vertices_touching_voxel(&self, voxel: [i64; 3]) -> Vec<u32> {
        let dims = self.grid().dims();
        let from = |corner: usize| std::array::from_fn(|a| voxel[a].saturating_sub((corner >> a & 1) as i64));
        let near = (0..8).rev().flat_map(|corner| self.vertices_of_voxel(from(corner)));
        near.filter(|&v| self.keys()[v as usize].voxels(dims).contains(&voxel)).collect()
    }

    /// What a vertex is and where.
    ///
    /// # Panics
    /// If there is no vertex `vertex`.
    pub fn describe(&self, vertex: u32) -> VertexDescription {
        let (i, dims) = (vertex as usize, self.grid().dims());
        let key = self.keys()[i];
        // Where a cell has more vertices than elements of its own, others of its voxel stand for them.
        let axis = usize::from(key.element() % 3);
        let on_element = match key.element() {
            0..=2 => (0..3).all(|a| a == axis || self.places()[i][a] == 0.0),
            3..=5 => self.places()[i][axis] == 0.0,
            _ => true,
        };
        VertexDescription {
            vertex,
            voxel: key.voxel(dims),
            element: if on_element { key.element_name() } else { "cell, further" },
            place: self.places()[i],
            world: self.world(i),
            voxels: if on_element { key.voxels(dims) } else { ElementKey(key.0 | 7).voxels(dims) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_has_two_voxels_a_face_four_and_a_cell_eight() {
        let dims = [4, 5, 6];
        let voxels = |element| ElementKey::new(dims, [2, 3, 4], element).voxels(dims);
        assert_eq!(voxels(1), [[1, 2, 3], [1, 3, 3]]);
        assert_eq!(voxels(3), [[1, 2, 3], [1, 3, 3], [1, 2, 4], [1, 3, 4]]);
        assert_eq!(voxels(5), [[1, 2, 3], [2, 2, 3], [1, 3, 3], [2, 3, 3]]);
        assert_eq!(voxels(6), voxels(7));
        assert_eq!((voxels(6).len(), voxels(6)[7]), (8, [2, 3, 4]));
        assert_eq!(ElementKey::new(dims, [0; 3], 4).element_name(), "face normal to y");
    }
}
