//! Where least is left of the volume.

use ivd_core::{BRICK, Displacement, VoxelIndex};
use rayon::prelude::*;

use super::Model;
use crate::{Overlay, Pane, ShownBy};

/// What has no more opacity than this is clear.
const CLEAR: f32 = 1e-3;

impl Model {
    /// Brings the slices where least is left of what is seen in them, with colours over them that tell how much.
    pub(super) fn show_squeezed(&mut self) {
        self.show_now();
        self.overlay = Some(Overlay::Volume);
        self.hovered = None;
        self.touch(&Pane::ALL[1..]);
        let is_seen = |voxel: [usize; 3]| {
            let value = self.session.whole().value(VoxelIndex(voxel));
            Overlay::is_coloured(self.window.grey(value)) && self.is_drawn(value) && !self.is_taken(voxel)
        };
        let displacement = self.session.displacement();
        let exec = self.in_time();
        let found = exec.run(|| {
            let seen = most_squeezed(displacement, is_seen, || exec.check_cancelled().is_ok());
            // Where nothing that is seen has moved, what isn't has.
            seen.or_else(|| most_squeezed(displacement, |_| true, || exec.check_cancelled().is_ok()))
        });
        if let Some(voxel) = found {
            let grid = self.session.rest().grid().clone();
            self.panes.planes.meet(grid.world(VoxelIndex(voxel).into()).0.into(), &grid);
            self.moved_cross();
        }
    }

    /// Whether the volume's picture draws a value by any class, where values make it: what is clear there is air, or noise beside the body.
    fn is_drawn(&self, value: f64) -> bool {
        let by_value = self.transfer.as_ref().filter(|_| self.subject.shown_by == ShownBy::Values);
        by_value.is_none_or(|transfer| {
            (0..transfer.classes().len()).any(|row| transfer.sample(row, value)[3] > CLEAR)
        })
    }
}

/// The deformed voxel about which least is left of the volume, the first of several, of those that are asked for; none where none of them has moved. Bricks
/// from when on it no longer goes on are left out.
fn most_squeezed(
    displacement: &Displacement,
    is_asked: impl Fn([usize; 3]) -> bool + Sync,
    goes_on: impl Fn() -> bool + Sync,
) -> Option<[usize; 3]> {
    let (field, dims) = (displacement.inverse(), displacement.grid().dims());
    let bricks = field.brick_dims();
    let least = |brick: usize| {
        field.brick(brick).filter(|_| goes_on())?;
        let first = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
        let voxels = (0..BRICK * BRICK * BRICK).map(|slot| -> [usize; 3] {
            let within = [slot % BRICK, slot / BRICK % BRICK, slot / BRICK / BRICK];
            std::array::from_fn(|a| first[a] * BRICK + within[a])
        });
        let inside = voxels.filter(|voxel| (0..3).all(|a| voxel[a] < dims[a]));
        let left = |voxel| Some((Overlay::Volume.value(displacement, voxel)?, voxel));
        inside.filter(|voxel| is_asked(*voxel)).filter_map(left).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let of_bricks: Vec<_> = (0..field.table().len()).into_par_iter().filter_map(least).collect();
    of_bricks.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, voxel)| voxel)
}
