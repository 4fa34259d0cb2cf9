//! The field before any repair: each voxel takes the weighted motion of the nearest lattice point.

use ivd_core::{Exec, FieldBricks, Lattice, Mask, VoxelCoord};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::params::{MapParams, Outside, smooth_fall};
use super::region::Region;
use crate::Error;
use crate::sampler::{brick_at, brick_voxels};

/// The lattice point nearest to a place.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Triangle of the lattice.
    pub triangle: u32,
    /// Weights of the triangle's corners, ≥ 0, sum 1.
    pub barycentric: [f64; 3],
    /// Distance (mm), ≥ 0.
    pub distance: f64,
}

/// What is nearest to a place.
#[derive(Debug, Clone, Copy)]
pub enum Found {
    /// A lattice point that may move.
    On(Hit),
    /// A lattice point that doesn't move, whichever it is: one that is nearer (mm, relative to the grid's origin) than all
    /// that move, or none where the caller knows one.
    Still(Option<Vector3<f64>>),
    /// Nothing within the bound.
    Nothing,
}

/// Finds the lattice point nearest to a place.
pub trait Nearest: Sync {
    /// The lattice point nearest to `point` (mm, relative to the grid's origin), where it is within `bound` (mm).
    /// `known_still`: a lattice point that doesn't move lies within the bound.
    fn nearest(&self, point: Vector3<f64>, bound: f64, known_still: bool) -> Found;
}

/// A lattice with what the map asks of it.
pub(super) struct Part<'a, N> {
    pub(super) lattice: &'a Lattice,
    /// Vertices relative to the grid's origin (mm).
    pub(super) positions: &'a [Vector3<f64>],
    pub(super) inside: &'a Mask,
    pub(super) nearest: &'a N,
}

/// Thickness of the layer round a part that moves alone in which its motion continues (voxel diagonals): the cells at its
/// surface need all their corners, which lie within one diagonal; one more keeps relaxation away from the layer's end.
const LAYER: f64 = 2.0;

/// The motion of the nearest lattice point, weighted; on the given bricks, zeros where nothing moves.
pub(super) fn carry<N: Nearest>(
    part: &Part<'_, N>,
    displacement: &[[f64; 3]],
    region: &Region,
    params: &MapParams,
    bricks: &[usize],
    exec: &Exec,
) -> Result<Vec<Box<[[f32; 3]]>>, Error> {
    let carrier =
        Carrier { part, displacement, region, params, layer: LAYER * part.lattice.grid.voxel_diagonal() };
    let observer = exec.observer();
    observer.begin("map", bricks.len() as u64);
    let out = bricks
        .par_iter()
        .map(|&brick| {
            exec.check_cancelled()?;
            let vectors = carrier.brick(brick);
            observer.advance("map", 1);
            Ok(vectors)
        })
        .collect();
    observer.end("map");
    out
}

struct Carrier<'a, N> {
    part: &'a Part<'a, N>,
    displacement: &'a [[f64; 3]],
    region: &'a Region,
    params: &'a MapParams,
    layer: f64,
}

impl<N: Nearest> Carrier<'_, N> {
    fn brick(&self, brick: usize) -> Box<[[f32; 3]]> {
        let grid = &self.part.lattice.grid;
        let dims = grid.dims();
        let linear = grid.linear_part();
        let mut out = vec![[0.0_f32; 3]; FieldBricks::VOXELS].into_boxed_slice();
        let mut known = Known::new(grid.voxel_diagonal());
        for (slot, voxel) in brick_voxels(dims, brick_at(dims.map(|n| n.div_ceil(8)), brick)) {
            let point = linear * VoxelCoord::from(voxel).0;
            let cut = self.region.weight(point);
            if cut == 0.0 {
                continue;
            }
            let inside = self.part.inside.inside()[grid.linear(voxel)] != 0;
            let near = known.nearest(slot, point);
            let (bound, still) = near.map_or((f64::INFINITY, None), |near| near.bound(point, known.slack));
            let limit = self.limit(inside);
            let hit =
                match self.part.nearest.nearest(point, bound.min(limit), still.is_some() && bound <= limit) {
                    Found::On(hit) => hit,
                    Found::Still(place) => {
                        known.set(slot, place.or(still), true);
                        continue;
                    }
                    Found::Nothing => continue,
                };
            known.set(slot, Some(self.position(&hit)), false);
            let weight = cut * self.weight(inside, hit.distance);
            if weight > 0.0 {
                out[slot] = (self.motion(&hit) * weight).map(|c| c as f32).into();
            }
        }
        out
    }

    /// Distance beyond which the weight is 0.
    fn limit(&self, inside: bool) -> f64 {
        match (inside, self.params.outside) {
            (true, _) if self.params.weight == super::DepthWeight::One => f64::INFINITY,
            (true, _) => self.region.depth,
            (false, Outside::Band) => self.region.margin,
            (false, Outside::Free) => self.layer,
        }
    }

    fn weight(&self, inside: bool, distance: f64) -> f64 {
        match (inside, self.params.outside) {
            (true, _) => self.params.weight.at(distance / self.region.depth),
            (false, Outside::Band) => smooth_fall(distance / self.region.margin),
            (false, Outside::Free) => f64::from(u8::from(distance <= self.layer)),
        }
    }

    /// Where a lattice point lies (mm, relative to the grid's origin).
    fn position(&self, hit: &Hit) -> Vector3<f64> {
        let [a, b, c] =
            self.part.lattice.triangles[hit.triangle as usize].map(|v| self.part.positions[v as usize]);
        a * hit.barycentric[0] + b * hit.barycentric[1] + c * hit.barycentric[2]
    }

    /// The motion at a lattice point, linear on its triangle; exact where the corners move alike.
    fn motion(&self, hit: &Hit) -> Vector3<f64> {
        let [a, b, c] = self.part.lattice.triangles[hit.triangle as usize]
            .map(|v| Vector3::from(self.displacement[v as usize]));
        a + (b - a) * hit.barycentric[1] + (c - a) * hit.barycentric[2]
    }
}

/// A lattice point near a voxel.
#[derive(Debug, Clone, Copy)]
struct Near {
    point: Vector3<f64>,
    still: bool,
}

impl Near {
    /// A distance from a place within which this point lies, and the point where it doesn't move.
    fn bound(&self, place: Vector3<f64>, slack: f64) -> (f64, Option<Vector3<f64>>) {
        let distance = (place - self.point).norm() * (1.0 + 1e-9) + slack;
        (distance, self.still.then_some(self.point))
    }
}

/// The lattice points found so far in a brick: those of a voxel's lower neighbours bound its own search.
struct Known {
    near: Vec<Option<Near>>,
    /// Room for the rounding of a point (mm).
    slack: f64,
}

impl Known {
    fn new(diagonal: f64) -> Self {
        Self { near: vec![None; FieldBricks::VOXELS], slack: 1e-9 * diagonal }
    }

    fn set(&mut self, slot: usize, point: Option<Vector3<f64>>, still: bool) {
        self.near[slot] = point.map(|point| Near { point, still });
    }

    /// What the voxel's lower neighbours found that is nearest to a place.
    fn nearest(&self, slot: usize, place: Vector3<f64>) -> Option<Near> {
        let neighbours = [1, 8, 64].into_iter().enumerate();
        let of = |(axis, stride): (usize, usize)| {
            (slot >> (3 * axis) & 7 > 0).then(|| self.near[slot - stride]).flatten()
        };
        let square = |near: &Near| (place - near.point).norm_squared();
        neighbours.filter_map(of).min_by(|a, b| square(a).total_cmp(&square(b)))
    }
}
