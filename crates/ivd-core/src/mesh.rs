use nalgebra::Vector3;

/// Address of a vertex as our files carry it: the voxel, and the element (0…7) of
/// [`ElementKey`](crate::ElementKey).
pub type MeshAddress = ([i64; 3], u8);

/// A triangle mesh as a file of another program gives it: not yet closed, oriented or on any grid.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Positions (mm), RAS, finite, shape `[vertex_count, 3]`.
    pub positions: Vec<Vector3<f64>>,
    /// Vertex indices of each triangle, all in range; larger faces are cut into fans about their first corner.
    pub triangles: Vec<[u32; 3]>,
    /// Address of each vertex, where the file is one that we wrote and its format keeps them (PLY, VTP).
    pub addresses: Option<Vec<MeshAddress>>,
}
