use crate::{Buffer, Error, Grid};

/// Deepest octree: 21 levels fill a 63-bit Morton code.
pub const OCTREE_MAX_DEPTH: u8 = 21;

/// What a leaf of the octree holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeafKind {
    /// All of its voxels lie outside the lattice.
    Outside,
    /// All of its voxels lie inside the lattice.
    Inside,
    /// The lattice passes through it; the leaf lists its triangles.
    Surface,
}

/// A node as it is decoded from [`Octree::nodes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OctreeNode {
    /// Eight children at `first_child ..+ 8`, in Morton order (x is bit 0, y bit 1, z bit 2).
    Internal {
        /// Index of the first child in [`Octree::nodes`].
        first_child: u32,
    },
    /// All voxels outside.
    Outside,
    /// All voxels inside.
    Inside,
    /// A surface leaf with its slot in [`Octree::leaf_start`].
    Surface {
        /// Slot of the leaf.
        slot: u32,
    },
}

/// A linear octree over the grid of a lattice, nodes in breadth-first Morton order, `u32` a node.
///
/// The root is a cube of 2^`depth` voxels a side, in the grid padded by one voxel on every side (root corner at padded
/// voxel 0, i.e. voxel −1); node boxes are half-open ranges of padded voxels. A node is packed as `kind | payload << 2`
/// with kind 0 internal, 1 outside, 2 inside, 3 surface. Surface leaves list the triangles that meet their box, the
/// box taken half a voxel wider than the voxel centres on every side.
#[derive(Debug, Clone, PartialEq)]
pub struct Octree {
    parts: OctreeParts,
}

/// What an octree is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct OctreeParts {
    /// The grid of the lattice.
    pub grid: Grid,
    /// Levels below the root: the root's edge is 2^depth padded voxels.
    pub depth: u8,
    /// Nodes, breadth first, packed.
    pub nodes: Buffer<u32>,
    /// Start of each surface leaf's run in `leaf_triangles`, and the end of the last; length = surface leaves + 1.
    pub leaf_start: Buffer<u32>,
    /// Triangle indices of the lattice, run by run.
    pub leaf_triangles: Buffer<u32>,
    /// Triangles of the lattice it was built over: a check that the two belong together.
    pub triangle_count: u32,
    /// Vertices of the lattice it was built over.
    pub vertex_count: u32,
}

impl Octree {
    /// An octree of these parts, which can be walked without a bound check failing.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first index that doesn't fit.
    pub fn new(parts: OctreeParts) -> Result<Self, Error> {
        parts
            .problem()
            .map_or(Ok(Self { parts }), |problem| Err(Error::Inconsistent { what: "octree", problem }))
    }

    /// What it is made of.
    pub fn into_parts(self) -> OctreeParts {
        self.parts
    }

    /// See [`OctreeParts::grid`].
    pub fn grid(&self) -> &Grid {
        &self.parts.grid
    }

    /// See [`OctreeParts::depth`].
    #[inline]
    pub fn depth(&self) -> u8 {
        self.parts.depth
    }

    /// See [`OctreeParts::nodes`].
    #[inline]
    pub fn nodes(&self) -> &[u32] {
        &self.parts.nodes
    }

    /// See [`OctreeParts::leaf_start`].
    #[inline]
    pub fn leaf_start(&self) -> &[u32] {
        &self.parts.leaf_start
    }

    /// See [`OctreeParts::leaf_triangles`].
    #[inline]
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.parts.leaf_triangles
    }

    /// See [`OctreeParts::triangle_count`].
    pub fn triangle_count(&self) -> u32 {
        self.parts.triangle_count
    }

    /// See [`OctreeParts::vertex_count`].
    pub fn vertex_count(&self) -> u32 {
        self.parts.vertex_count
    }

    /// Packs a node.
    pub fn pack(node: OctreeNode) -> u32 {
        match node {
            OctreeNode::Internal { first_child } => first_child << 2,
            OctreeNode::Outside => 1,
            OctreeNode::Inside => 2,
            OctreeNode::Surface { slot } => 3 | slot << 2,
        }
    }

    /// Decodes the node at an index.
    #[inline]
    pub fn node(&self, index: u32) -> OctreeNode {
        unpacked(self.nodes()[index as usize])
    }

    /// Triangles of a surface leaf.
    #[inline]
    pub fn leaf(&self, slot: u32) -> &[u32] {
        let (s, start) = (slot as usize, self.leaf_start());
        &self.leaf_triangles()[start[s] as usize..start[s + 1] as usize]
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        self.nodes().iter().filter(|&&n| n & 3 != 0).count()
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> u64 {
        4 * (self.nodes().len() + self.leaf_start().len() + self.leaf_triangles().len()) as u64
    }

    /// The leaf that holds a padded voxel, as `(node index, level, node)`; level 0 is the root.
    ///
    /// # Panics
    /// If the padded voxel lies outside the root cube.
    pub fn locate(&self, padded: [usize; 3]) -> (u32, u8, OctreeNode) {
        assert!(padded.iter().all(|&p| p < 1 << self.depth()), "padded voxel {padded:?} outside the root");
        let (mut index, mut level) = (0, 0);
        loop {
            match self.node(index) {
                OctreeNode::Internal { first_child } => {
                    let bit = self.depth() - level - 1;
                    let octant = (0..3).map(|a| (padded[a] >> bit & 1) << a).sum::<usize>();
                    index = first_child + octant as u32;
                    level += 1;
                }
                leaf => return (index, level, leaf),
            }
        }
    }
}

impl OctreeParts {
    /// The first index that doesn't fit, if any.
    fn problem(&self) -> Option<String> {
        let (nodes, leaf_start, leaf_triangles) =
            (&self.nodes[..], &self.leaf_start[..], &self.leaf_triangles[..]);
        if self.depth > OCTREE_MAX_DEPTH || nodes.is_empty() {
            return Some(format!("depth {}, {} nodes", self.depth, nodes.len()));
        }
        let slots = leaf_start.len().saturating_sub(1);
        // Breadth-first order: each internal node's children are the next eight, so a walk always ends and every node
        // has one parent. `level_end` is the first node of the next level.
        let (mut next, mut level, mut level_end) = (1_usize, 0_u8, 1_usize);
        for (i, &word) in nodes.iter().enumerate() {
            if i == level_end {
                (level, level_end) = (level + 1, next);
            }
            match unpacked(word) {
                OctreeNode::Internal { first_child } => {
                    if first_child as usize != next || next + 8 > nodes.len() {
                        return Some(format!("node {i} has its children at {first_child}, not {next}"));
                    }
                    if level == self.depth {
                        return Some(format!("node {i} has children below depth {level}"));
                    }
                    next += 8;
                }
                OctreeNode::Surface { slot } if slot as usize >= slots => {
                    return Some(format!("node {i} names surface leaf {slot} of {slots}"));
                }
                _ => {}
            }
        }
        if next != nodes.len() {
            return Some(format!("{} nodes, {next} of them in the tree", nodes.len()));
        }
        if leaf_start.first().is_some_and(|&first| first != 0)
            || leaf_start.windows(2).any(|w| w[0] > w[1])
            || leaf_start.last().copied().unwrap_or(0) as usize != leaf_triangles.len()
        {
            return Some("leaf runs don't cover the triangle list".into());
        }
        if leaf_triangles.iter().any(|&t| t >= self.triangle_count) {
            return Some("a leaf names a triangle beyond the lattice".into());
        }
        None
    }
}

/// Decodes a node.
#[inline]
fn unpacked(word: u32) -> OctreeNode {
    match word & 3 {
        0 => OctreeNode::Internal { first_child: word >> 2 },
        1 => OctreeNode::Outside,
        2 => OctreeNode::Inside,
        _ => OctreeNode::Surface { slot: word >> 2 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(depth: u8, nodes: &[OctreeNode]) -> Result<Octree, Error> {
        made(depth, nodes, vec![0, 1])
    }

    fn made(depth: u8, nodes: &[OctreeNode], leaf_start: Vec<u32>) -> Result<Octree, Error> {
        Octree::new(OctreeParts {
            grid: Grid::with_spacing([3, 3, 3], [1.0; 3]).unwrap(),
            depth,
            nodes: nodes.iter().map(|&n| Octree::pack(n)).collect(),
            leaf_start: leaf_start.into(),
            leaf_triangles: vec![0].into(),
            triangle_count: 1,
            vertex_count: 3,
        })
    }

    #[test]
    fn trees_that_a_walk_could_leave_or_get_lost_in_are_refused() {
        let leaves = |n: usize| vec![OctreeNode::Outside; n];
        let internal = |first_child| OctreeNode::Internal { first_child };
        let with = |head: &[OctreeNode], n| [head, &leaves(n)].concat();
        let two_levels = with(&[internal(1), internal(9)], 15);
        assert!(tree(2, &two_levels).is_ok());
        assert!(tree(1, &two_levels).is_err(), "deeper than it says: a walk would run out of bits");
        assert!(tree(2, &with(&[internal(1), internal(1)], 15)).is_err(), "two parents");
        assert!(tree(2, &with(&[internal(2)], 9)).is_err(), "a node between parent and children");
        assert!(tree(2, &with(&[internal(1)], 9)).is_err(), "a node without a parent");
        assert!(tree(2, &with(&[internal(1)], 7)).is_err(), "a missing child");
        assert!(tree(2, &[OctreeNode::Surface { slot: 1 }]).is_err(), "no such leaf");
        let leaf = [OctreeNode::Surface { slot: 0 }];
        assert!(tree(2, &leaf).is_ok());
        assert!(made(2, &leaf, vec![1, 1]).is_err(), "a triangle before the first leaf");
    }
}
