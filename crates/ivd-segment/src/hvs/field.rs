//! The voxels of a volume as the nodes of a graph: each is joined to its neighbours along the axes.

use ivd_core::{Mask, Scalar, Volume};

/// A voxel type whose values can be told apart.
pub(super) trait Apart: Scalar {
    /// Whether equal keys mean equal differences.
    const EXACT: bool;
    /// A number that never falls where the difference of the values rises.
    fn key(self, other: Self) -> u32;
    /// The difference of the values, stored units.
    fn apart(self, other: Self) -> f64;
}

macro_rules! apart {
    ($($integer:ty),*; $($float:ty),*) => {
        $(impl Apart for $integer {
            const EXACT: bool = true;
            #[inline(always)]
            fn key(self, other: Self) -> u32 {
                u32::from(self.abs_diff(other))
            }
            #[inline(always)]
            fn apart(self, other: Self) -> f64 {
                f64::from(self.abs_diff(other))
            }
        })*
        $(impl Apart for $float {
            const EXACT: bool = false;
            #[inline(always)]
            fn key(self, other: Self) -> u32 {
                // The bits of numbers that aren't negative ascend with them.
                (self.apart(other) as f32).to_bits()
            }
            #[inline(always)]
            fn apart(self, other: Self) -> f64 {
                (self.to_f64() - other.to_f64()).abs().min(f64::MAX)
            }
        })*
    };
}

apart!(u8, i8, u16, i16, u32, i32; f32, f64);

/// Voxels, which of them count, and how they are joined. An edge is `3 · voxel + axis`: it joins the voxel to the next one
/// along the axis.
#[derive(Clone, Copy)]
pub(super) struct Field<'a, T> {
    pub(super) voxels: &'a [T],
    inside: Option<&'a [u8]>,
    pub(super) dims: [usize; 3],
    /// From a voxel to the next one along each axis.
    pub(super) steps: [usize; 3],
    /// From stored to real differences.
    pub(super) slope: f64,
}

impl<'a, T: Apart> Field<'a, T> {
    pub(super) fn new(volume: &Volume, voxels: &'a [T], mask: Option<&'a Mask>) -> Self {
        let dims = volume.grid().dims();
        let steps = [1, dims[0], dims[0] * dims[1]];
        Self { voxels, inside: mask.map(Mask::inside), dims, steps, slope: volume.slope().abs() }
    }

    #[inline(always)]
    pub(super) fn present(&self, voxel: usize) -> bool {
        self.voxels[voxel].is_data() && self.inside.is_none_or(|inside| inside[voxel] != 0)
    }

    /// The voxels that an edge joins.
    #[inline(always)]
    pub(super) fn ends(&self, edge: u32) -> [usize; 2] {
        let voxel = edge as usize / 3;
        [voxel, voxel + self.steps[edge as usize % 3]]
    }

    #[inline(always)]
    pub(super) fn key(&self, edge: u32) -> u32 {
        let [a, b] = self.ends(edge);
        self.voxels[a].key(self.voxels[b])
    }

    /// Stored units.
    #[inline(always)]
    pub(super) fn apart(&self, edge: u32) -> f64 {
        let [a, b] = self.ends(edge);
        self.voxels[a].apart(self.voxels[b])
    }

    /// Real units.
    #[inline(always)]
    pub(super) fn height(&self, edge: u32) -> f64 {
        (self.apart(edge) * self.slope).min(f64::MAX)
    }
}

/// A block of voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Block {
    pub(super) start: [usize; 3],
    /// Voxels along each axis.
    pub(super) size: [usize; 3],
}

/// The blocks of at most `edge` voxels along each axis that cover a grid, x fastest.
pub(super) fn blocks(dims: [usize; 3], edge: [usize; 3]) -> Vec<Block> {
    let starts = |axis: usize| (0..dims[axis]).step_by(edge[axis]);
    let mut found = Vec::new();
    for z in starts(2) {
        for y in starts(1) {
            for x in starts(0) {
                let start = [x, y, z];
                found.push(Block { start, size: [0, 1, 2].map(|a| edge[a].min(dims[a] - start[a])) });
            }
        }
    }
    found
}
