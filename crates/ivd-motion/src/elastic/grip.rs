//! What a handle has hold of.
//!
//! A point has no hold on matter. A ball that goes as one has, but cuts into what is round it along its rim, where the strain has no bound. So the inner
//! half of a grip goes as one, and matter gets softer from there: it is `(ρ / r)³` times as stiff as beyond the grip's border `ρ`. The strain
//! that a force in the middle brings about, which would go as `1 / r²`, then grows from the core to the border, and falls off from there.

use std::collections::BTreeSet;

use ivd_core::{Exec, Grid, Lattice, VoxelCoord, VoxelIndex};
use nalgebra::Vector3;

use crate::Error;

/// Bytes of a voxel that is held.
const BYTES: u64 = 40;
/// Part of a grip's radius in which matter goes as one.
const CORE: f64 = 0.5;

/// Matter that a handle has hold of: the voxels of the part in a ball round its vertex that are joined to it through faces, in the ball.
pub(super) struct Grip {
    middle: Vector3<f64>,
    radius: f64,
    voxels: BTreeSet<[usize; 3]>,
}

impl Grip {
    /// - `is_inside`: whether a voxel is of the part, by its number.
    /// - `middle`, `radius`: of the ball (mm); its middle is where the vertex is.
    pub(super) fn new(
        lattice: &Lattice,
        is_inside: impl Fn(usize) -> bool,
        vertex: usize,
        (middle, radius): (Vector3<f64>, f64),
        exec: &Exec,
    ) -> Result<Self, Error> {
        let grid = lattice.grid();
        let voxels =
            grid.voxels_of_ball(middle, radius).map(|range| range.len() as u64).iter().product::<u64>();
        exec.check_memory("what a handle has hold of", BYTES * voxels)?;
        exec.check_cancelled()?;
        let mut voxels = BTreeSet::new();
        let takes = |at: &[i64; 3]| {
            let Some(voxel) = grid.voxel_at(*at) else { return false };
            let near = (local(grid, voxel) - middle).norm() <= radius;
            near && is_inside(grid.linear(voxel))
        };
        let mut work: Vec<[i64; 3]> = corners(lattice, vertex).filter(takes).collect();
        while let Some(at) = work.pop() {
            if !voxels.insert(at.map(|c| c as usize)) {
                continue;
            }
            for side in 0..6_usize {
                let mut next = at;
                next[side / 2] += if side % 2 == 0 { -1 } else { 1 };
                if takes(&next) && !voxels.contains(&next.map(|c| c as usize)) {
                    work.push(next);
                }
            }
        }
        Ok(Self { middle, radius, voxels })
    }

    /// How far from its vertex matter goes as one (mm).
    pub(super) fn core(&self) -> f64 {
        CORE * self.radius
    }

    /// Whether a voxel is of the matter that it holds.
    pub(super) fn holds(&self, voxel: VoxelIndex) -> bool {
        self.voxels.contains(&voxel.0)
    }

    /// Whether a vertex lies on that matter.
    pub(super) fn touches(&self, lattice: &Lattice, vertex: usize) -> bool {
        corners(lattice, vertex).filter_map(|at| lattice.grid().voxel_at(at)).any(|voxel| self.holds(voxel))
    }

    /// How many times stiffer a voxel's matter is.
    pub(super) fn factor(&self, grid: &Grid, voxel: VoxelIndex) -> f64 {
        let far = (local(grid, voxel) - self.middle).norm();
        if far < self.radius && self.holds(voxel) {
            (self.radius / far.max(self.core())).powi(3)
        } else {
            1.0
        }
    }
}

/// Where a voxel is (mm), relative to the grid's origin.
pub(super) fn local(grid: &Grid, voxel: VoxelIndex) -> Vector3<f64> {
    grid.linear_part() * VoxelCoord::from(voxel).0
}

/// The voxels round a vertex.
fn corners(lattice: &Lattice, vertex: usize) -> impl Iterator<Item = [i64; 3]> {
    let at = lattice.voxel(vertex).0;
    let along = move |c: usize, a: usize| if c >> a & 1 == 1 { at[a].ceil() } else { at[a].floor() };
    (0..8).map(move |c| std::array::from_fn(|a| along(c, a) as i64))
}
