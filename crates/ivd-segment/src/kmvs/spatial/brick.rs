/// Voxels in a group; the last of a brick may hold fewer. More cost less memory and time for groups, but more voxels stand in
/// groups that must be looked at one by one.
pub(super) const GROUP: usize = 64;

/// What is known of a brick's voxels that are data inside the mask.
#[derive(Debug, Clone, Copy)]
pub(super) struct Brick {
    /// Voxel index of its first corner.
    pub(super) origin: [usize; 3],
    /// Where its members and groups begin.
    pub(super) first: usize,
    pub(super) first_group: usize,
    pub(super) count: usize,
    /// Whether every voxel of the brick counts.
    pub(super) whole: bool,
    /// Box of the places, from the origin, and of the values, from the frame's centre; ends included.
    pub(super) low: [u8; 3],
    pub(super) high: [u8; 3],
    pub(super) values: [f64; 2],
    /// Sums of the places from the origin, and of the values in fixed point.
    pub(super) sums: [u32; 3],
    pub(super) value_sum: i64,
    pub(super) value_squares: i128,
}

impl Brick {
    /// Members of a group, as a range of all members.
    #[inline]
    pub(super) fn members(&self, group: usize) -> std::ops::Range<usize> {
        let from = group * GROUP;
        self.first + from..self.first + self.count.min(from + GROUP)
    }
}

/// Box and sums of the places of a group: lows, highs and sums along each axis.
pub(super) type Places = [u16; 9];
