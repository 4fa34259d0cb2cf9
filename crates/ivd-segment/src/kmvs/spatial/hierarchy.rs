//! Bricks, and inside each brick groups of voxels that lie close in feature space.
//!
//! A brick is halved along its widest side in feature space, six times at most; its voxels are ordered by the part that they
//! are in, those of a part by value, and cut into groups of [`GROUP`]. Where the value is the widest side throughout, that is
//! the order of values alone. In noise, neighbours differ in value far more than in place: a group of like values from anywhere in
//! the brick is smaller in feature space than a cube of neighbours, so that fewer groups straddle two centroids.

use ivd_core::{Exec, Mask, Scalar, SpillVec, Volume, parallel};

use super::brick::{Brick, GROUP, Places};
use super::build::{Room, Scratch, build};
use super::frame::Frame;
use super::layout::Layout;
use crate::Error;

/// A volume in the order of bricks and groups.
pub(super) struct Hierarchy<T> {
    pub(super) layout: Layout,
    pub(super) bricks: Vec<Brick>,
    /// Place inside the brick and stored value of every member, brick after brick.
    pub(super) places: SpillVec<u16>,
    pub(super) values: SpillVec<T>,
    /// Of every group: its places, the range of its values from the frame's centre, their sum in fixed point.
    pub(super) group_places: SpillVec<Places>,
    pub(super) group_values: SpillVec<[f64; 2]>,
    pub(super) group_sums: SpillVec<i64>,
    /// Over all members: sums of squared indices and of squared values in fixed point.
    pub(super) squares: [i128; 4],
    pub(super) count: u64,
}

impl<T: Scalar> Hierarchy<T> {
    pub(super) fn new(
        volume: &Volume,
        voxels: &[T],
        mask: Option<&Mask>,
        frame: &Frame,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let layout = Layout::new(volume.grid());
        let extents: Vec<usize> =
            (0..layout.bricks()).map(|i| layout.brick(i).1.iter().product::<usize>()).collect();
        let groups: usize = extents.iter().map(|n| n.div_ceil(GROUP)).sum();
        let mut places = exec.bulk("the voxels' places in their bricks", voxels.len())?;
        let mut values = exec.bulk("the voxels in the order of bricks", voxels.len())?;
        let mut group_places = exec.bulk("the boxes of groups", groups)?;
        let mut group_values = exec.bulk("the values of groups", groups)?;
        let mut group_sums = exec.bulk("the sums of groups", groups)?;
        let whole = Room {
            first: 0,
            first_group: 0,
            places: &mut places[..],
            values: &mut values[..],
            group_places: &mut group_places[..],
            group_values: &mut group_values[..],
            group_sums: &mut group_sums[..],
        };
        let rooms: Vec<Room<T>> = whole.split(&extents);
        let found: Vec<(Brick, [i128; 3])> =
            parallel::try_map_of(rooms, &Scratch::default, &|scratch, index, mut room| {
                exec.check_cancelled()?;
                Ok::<_, ivd_core::Error>(build(voxels, mask, frame, (&layout, index), scratch, &mut room))
            })?;
        let mut squares = [0; 4];
        for (brick, places) in &found {
            (0..3).for_each(|a| squares[a] += places[a]);
            squares[3] += brick.value_squares;
        }
        let bricks: Vec<Brick> = found.into_iter().map(|(brick, _)| brick).filter(|b| b.count > 0).collect();
        let count = bricks.iter().map(|b| b.count as u64).sum();
        Ok(Self { layout, bricks, places, values, group_places, group_values, group_sums, squares, count })
    }

    /// Voxel index of a member.
    #[inline]
    pub(super) fn index(&self, brick: &Brick, member: usize) -> [usize; 3] {
        let place = self.layout.unpack(self.places[member]);
        std::array::from_fn(|a| brick.origin[a] + place[a])
    }
}
