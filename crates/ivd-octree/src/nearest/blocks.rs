//! The tree of boxes that a search walks: blocks of eight boxes side by side, so that one loop measures all eight.

/// What a box of a block holds, packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Lane(u32);

/// What a [`Lane`] names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    Nothing,
    Triangle(u32),
    Block(u32),
}

impl Lane {
    pub(super) const NOTHING: Self = Self(u32::MAX);
    /// Most triangles or blocks that lanes can name.
    pub(super) const LIMIT: u64 = (u32::MAX >> 1) as u64;

    pub(super) fn triangle(triangle: u32) -> Self {
        Self(triangle << 1 | 1)
    }

    pub(super) fn block(block: u32) -> Self {
        Self(block << 1)
    }

    #[inline]
    pub(super) fn get(self) -> Target {
        match self {
            Self::NOTHING => Target::Nothing,
            Self(packed) if packed & 1 == 1 => Target::Triangle(packed >> 1),
            Self(packed) => Target::Block(packed >> 1),
        }
    }
}

/// A box in the frame of the search (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) lo: [f32; 3],
    pub(super) hi: [f32; 3],
}

impl Bounds {
    /// The box of nothing: infinitely far from every point.
    pub(super) const NOTHING: Self = Self { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };

    pub(super) fn union(self, other: Self) -> Self {
        Self {
            lo: std::array::from_fn(|a| self.lo[a].min(other.lo[a])),
            hi: std::array::from_fn(|a| self.hi[a].max(other.hi[a])),
        }
    }
}

/// Up to eight boxes and what they hold.
#[derive(Debug, Clone)]
pub(super) struct Block {
    lo: [[f32; Self::LANES]; 3],
    hi: [[f32; Self::LANES]; 3],
    pub(super) lanes: [Lane; Self::LANES],
}

impl Block {
    pub(super) const LANES: usize = 8;

    /// A block of at most eight lanes.
    pub(super) fn new(items: &[(Bounds, Lane)]) -> Self {
        let mut block = Self {
            lo: [[f32::INFINITY; Self::LANES]; 3],
            hi: [[f32::NEG_INFINITY; Self::LANES]; 3],
            lanes: [Lane::NOTHING; Self::LANES],
        };
        for (i, (bounds, lane)) in items.iter().enumerate() {
            for a in 0..3 {
                block.lo[a][i] = bounds.lo[a];
                block.hi[a][i] = bounds.hi[a];
            }
            block.lanes[i] = *lane;
        }
        block
    }

    /// Square of the distance of a point from each box (mm²), a little less than exact: rounding the point and the
    /// arithmetic cost less than the factor takes off, the boxes' own slack takes up the rest.
    #[inline]
    pub(super) fn squared_distances(&self, point: [f32; 3]) -> [f32; Self::LANES] {
        let mut squared = [0.0; Self::LANES];
        for a in 0..3 {
            for i in 0..Self::LANES {
                let d = (self.lo[a][i] - point[a]).max(point[a] - self.hi[a][i]).max(0.0);
                squared[i] += d * d;
            }
        }
        squared.map(|s| s * (1.0 - 1e-5))
    }
}

/// The blocks, and where a search begins.
pub(super) struct Tree {
    pub(super) blocks: Vec<Block>,
    pub(super) root: Lane,
}
