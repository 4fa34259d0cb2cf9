//! Where the vertices of a layer stand in the lattice: for each row, which elements hold one and how many lie before.

use super::signs::Signs;

/// Voxels in a group.
const GROUP: usize = 16;

/// One bit in each quarter of a word.
const QUARTERS: u64 = 0x0001_0001_0001_0001;

/// Sixteen voxels of a row: the vertices on their elements.
#[derive(Debug, Clone, Copy, Default)]
struct Group {
    /// Sixteen bits each for x edges, y edges, z edges and cells.
    bits: u64,
    /// Index of the group's first vertex.
    first: u32,
    /// Cells with a second vertex.
    seconds: u16,
}

/// Vertices on the elements of one voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Voxel {
    /// Index of the voxel's first vertex.
    pub(super) first: u32,
    /// A bit at 0, 16, 32, 48 for the edges along x, y, z and the cell.
    bits: u64,
    /// Whether the cell has a second vertex, as a number.
    second: u32,
}

impl Voxel {
    /// Index of the vertex on the y edge, if there is one.
    #[inline(always)]
    pub(super) fn y(self) -> u32 {
        self.first + (self.bits & 1) as u32
    }

    /// Index of the vertex on the z edge, if there is one.
    #[inline(always)]
    pub(super) fn z(self) -> u32 {
        self.y() + (self.bits >> 16 & 1) as u32
    }

    /// Index of the vertex in the cell, if there is one; a second follows it.
    #[inline(always)]
    pub(super) fn cell(self) -> u32 {
        self.z() + (self.bits >> 32 & 1) as u32
    }

    /// Index of the vertex after this voxel's.
    #[inline(always)]
    fn end(self) -> u32 {
        self.cell() + (self.bits >> 48 & 1) as u32 + self.second
    }
}

/// The vertices of one layer of padded voxels.
#[derive(Debug, Default)]
pub(super) struct Directory {
    groups_per_row: usize,
    groups: Vec<Group>,
}

impl Directory {
    /// Fills in the layer at padded `z` of a grid of `dims` voxels, whose first vertex has index `first`.
    ///
    /// `centres`: padded `[x, y]` of the cells with a vertex of their own, in ascending order of row and place; twice those
    /// with two.
    pub(super) fn fill(
        &mut self,
        signs: &Signs,
        dims: [usize; 3],
        z: usize,
        first: u32,
        centres: &[[u32; 2]],
    ) {
        let words = (dims[0] + 2).div_ceil(32);
        self.groups_per_row = 2 * words + 1;
        self.groups.resize(self.groups_per_row * (dims[1] + 2), Group::default());
        let mut centres = centres.iter().peekable();
        let mut next = first;
        for (y, groups) in self.groups.chunks_mut(self.groups_per_row).enumerate().take(dims[1] + 1) {
            let [row, up_y, up_z] = [signs.row(y, z), signs.row(y + 1, z), signs.row(y, z + 1)];
            for (k, pair) in groups.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                let here = row[k];
                let x = here ^ (here >> 1 | row[k + 1] << 31);
                let [y, z] = [here ^ up_y[k], here ^ up_z[k]];
                for (half, group) in pair.iter_mut().enumerate() {
                    let part = |bits: u32| u64::from(bits >> (16 * half) & 0xFFFF);
                    let bits = part(x) | part(y) << 16 | part(z) << 32;
                    *group = Group { bits, first: next, seconds: 0 };
                    if bits != 0 {
                        next += bits.count_ones();
                    }
                }
            }
            let mut added = 0;
            let mut from = 0;
            while let Some(&[x, _]) = centres.next_if(|c| c[1] as usize == y) {
                let at = x as usize / GROUP;
                let place = x as usize % GROUP;
                groups[at].seconds |= ((groups[at].bits >> (48 + place) & 1) as u16) << place;
                groups[at].bits |= 1 << (48 + place);
                groups[from..=at].iter_mut().for_each(|g| g.first += added);
                (from, added) = (at + 1, added + 1);
            }
            groups[from..].iter_mut().for_each(|g| g.first += added);
            next += added;
        }
    }

    /// Groups of the row at padded `y`.
    #[inline]
    pub(super) fn row(&self, y: usize) -> Row<'_> {
        Row(&self.groups[y * self.groups_per_row..][..self.groups_per_row])
    }
}

/// The vertices of one row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<'a>(&'a [Group]);

impl Row<'_> {
    /// Vertices on the elements of padded voxel `p`.
    #[inline(always)]
    pub(super) fn voxel(self, p: usize) -> Voxel {
        let (group, place) = (self.0[p / GROUP], p % GROUP);
        let before = group.bits & (((1 << place) - 1) * QUARTERS);
        let seconds = u32::from(group.seconds);
        let before = before.count_ones() + (seconds & ((1 << place) - 1)).count_ones();
        Voxel {
            first: group.first + before,
            bits: group.bits >> place & QUARTERS,
            second: seconds >> place & 1,
        }
    }

    /// Vertices on the elements of padded voxels `p` and `p + 1`.
    #[inline(always)]
    pub(super) fn pair(self, p: usize) -> [Voxel; 2] {
        let voxel = self.voxel(p);
        let next = p + 1;
        let (group, place) = (self.0[next / GROUP], next % GROUP);
        let second = u32::from(group.seconds >> place & 1);
        [voxel, Voxel { first: voxel.end(), bits: group.bits >> place & QUARTERS, second }]
    }
}
