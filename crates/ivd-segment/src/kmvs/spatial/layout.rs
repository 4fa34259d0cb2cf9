//! How a grid divides into bricks.

use ivd_core::Grid;

/// Bits of a voxel's place inside its brick, in all and along one axis.
const BRICK_BITS: u32 = 12;
const AXIS_BITS: u32 = 8;

/// Bricks of up to 4096 voxels, as near to cubes (in mm) as powers of two allow; x fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layout {
    dims: [usize; 3],
    /// Logarithms of a brick's edges (voxels).
    pub(super) log: [u32; 3],
    /// Bricks along each axis.
    pub(super) counts: [usize; 3],
}

impl Layout {
    pub(super) fn new(grid: &Grid) -> Self {
        let (dims, spacing) = (grid.dims(), grid.spacing());
        let mut log = [0_u32; 3];
        for _ in 0..BRICK_BITS {
            let edge = |a: &usize| spacing[*a] * (1_u64 << log[*a]) as f64;
            let open = (0..3).filter(|a| log[*a] < AXIS_BITS && 1 << log[*a] < dims[*a]);
            match open.min_by(|a, b| edge(a).total_cmp(&edge(b))) {
                Some(axis) => log[axis] += 1,
                None => break,
            }
        }
        let counts = std::array::from_fn(|a| dims[a].div_ceil(1 << log[a]));
        Self { dims, log, counts }
    }

    pub(super) fn bricks(&self) -> usize {
        self.counts.iter().product()
    }

    /// Voxels of one layer of bricks, which follow one another in the volume.
    pub(super) fn layer_voxels(&self) -> usize {
        (self.dims[0] * self.dims[1]) << self.log[2]
    }

    /// First voxel of a brick, and its edges (voxels).
    pub(super) fn brick(&self, index: usize) -> ([usize; 3], [usize; 3]) {
        let [nx, ny, _] = self.counts;
        let at = [index % nx, index / nx % ny, index / (nx * ny)];
        let origin: [usize; 3] = std::array::from_fn(|a| at[a] << self.log[a]);
        (origin, std::array::from_fn(|a| (self.dims[a] - origin[a]).min(1 << self.log[a])))
    }

    /// Linear index in the volume of a voxel index.
    #[inline(always)]
    pub(super) fn linear(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.dims[0] * (y + self.dims[1] * z)
    }

    /// A place inside a brick from offsets along the axes, in one number.
    #[inline(always)]
    pub(super) fn pack(&self, [x, y, z]: [usize; 3]) -> u16 {
        (x | y << self.log[0] | z << (self.log[0] + self.log[1])) as u16
    }

    #[inline(always)]
    pub(super) fn unpack(&self, place: u16) -> [usize; 3] {
        let place = usize::from(place);
        let [x, y, _] = self.log;
        [place & ((1 << x) - 1), place >> x & ((1 << y) - 1), place >> (x + y)]
    }
}
