//! The field before any repair: each voxel takes the weighted motion of the nearest lattice point.

use std::collections::BTreeMap;

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
///
/// - `kept`: what was found before, for the same `nearest`; takes what is found now.
pub(super) fn carry<N: Nearest>(
    part: &Part<'_, N>,
    displacement: &[[f64; 3]],
    region: &Region,
    params: &MapParams,
    bricks: &[usize],
    mut kept: Option<&mut Kept>,
    exec: &Exec,
) -> Result<Vec<Box<[[f32; 3]]>>, Error> {
    let carrier =
        Carrier { part, displacement, region, params, layer: LAYER * part.lattice.grid.voxel_diagonal() };
    let mut seen = bricks.iter().map(|&brick| kept.as_mut().map(|kept| kept.take(brick))).collect::<Vec<_>>();
    let observer = exec.observer();
    observer.begin("map", bricks.len() as u64);
    let out = bricks
        .par_iter()
        .zip(&mut seen)
        .map(|(&brick, seen)| {
            exec.check_cancelled()?;
            let vectors = carrier.brick(brick, seen.as_deref_mut());
            observer.advance("map", 1);
            Ok(vectors)
        })
        .collect();
    observer.end("map");
    if let Some(kept) = kept {
        // What a long way has left behind is given up.
        if kept.bricks.len() > 64 + 2 * bricks.len() {
            kept.clear();
        }
        kept.bricks.extend(bricks.iter().copied().zip(seen.into_iter().flatten()));
    }
    out
}

/// What is nearest to a voxel.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// Up to what distance this was searched (mm); below 0: not at all.
    within: f64,
    /// The triangle that may move; [`Seen::NONE`] where none is nearest.
    triangle: u32,
    /// Weights of its second and third corner.
    others: [f64; 2],
    /// Distance (mm).
    distance: f64,
}

impl Seen {
    const NONE: u32 = u32::MAX;

    fn nothing(within: f64) -> Self {
        Self { within, triangle: Self::NONE, others: [0.0; 2], distance: f64::INFINITY }
    }

    fn on(hit: &Hit) -> Self {
        let [_, b, c] = hit.barycentric;
        Self { within: f64::INFINITY, triangle: hit.triangle, others: [b, c], distance: hit.distance }
    }
}

/// Nearest points that were found, by brick. They are right for as long as the same triangles may move.
#[derive(Debug, Default)]
pub(super) struct Kept {
    bricks: BTreeMap<usize, Box<[Seen]>>,
}

impl Kept {
    /// Bytes kept for a brick.
    pub(super) const BRICK: u64 = (FieldBricks::VOXELS * size_of::<Seen>()) as u64;
    /// How much further than asked for is searched, so that a motion may grow a little before that is done again.
    const AHEAD: f64 = 1.5;

    /// Bricks of which something is kept when these are too.
    pub(super) fn with(&self, bricks: &[usize]) -> usize {
        self.bricks.len() + bricks.iter().filter(|brick| !self.bricks.contains_key(brick)).count()
    }

    /// Gives everything up.
    pub(super) fn clear(&mut self) {
        self.bricks.clear();
    }

    fn take(&mut self, brick: usize) -> Box<[Seen]> {
        let unseen = || vec![Seen::nothing(-1.0); FieldBricks::VOXELS].into_boxed_slice();
        self.bricks.remove(&brick).unwrap_or_else(unseen)
    }
}

struct Carrier<'a, N> {
    part: &'a Part<'a, N>,
    displacement: &'a [[f64; 3]],
    region: &'a Region,
    params: &'a MapParams,
    layer: f64,
}

impl<N: Nearest> Carrier<'_, N> {
    fn brick(&self, brick: usize, mut kept: Option<&mut [Seen]>) -> Box<[[f32; 3]]> {
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
            let limit = self.limit(inside);
            let seen = match &mut kept {
                None => self.search(slot, point, limit, &mut known),
                Some(kept) if kept[slot].within >= limit => kept[slot],
                Some(kept) => {
                    kept[slot] = self.search(slot, point, limit * Kept::AHEAD, &mut known);
                    kept[slot]
                }
            };
            if seen.triangle == Seen::NONE {
                continue;
            }
            let weight = cut * self.weight(inside, seen.distance);
            if weight > 0.0 {
                out[slot] = (self.motion(&seen) * weight).map(|c| c as f32).into();
            }
        }
        out
    }

    /// What is nearest to the point of a voxel, within a limit (mm).
    fn search(&self, slot: usize, point: Vector3<f64>, limit: f64, known: &mut Known) -> Seen {
        let near = known.nearest(slot, point);
        let (bound, still) = near.map_or((f64::INFINITY, None), |near| near.bound(point, known.slack));
        let within = bound.min(limit);
        match self.part.nearest.nearest(point, within, still.is_some() && bound <= limit) {
            Found::On(hit) => {
                known.set(slot, Some(self.position(&hit)), false);
                Seen::on(&hit)
            }
            Found::Still(place) => {
                known.set(slot, place.or(still), true);
                Seen::nothing(f64::INFINITY)
            }
            Found::Nothing => Seen::nothing(within),
        }
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
    fn motion(&self, seen: &Seen) -> Vector3<f64> {
        let [a, b, c] = self.part.lattice.triangles[seen.triangle as usize]
            .map(|v| Vector3::from(self.displacement[v as usize]));
        a + (b - a) * seen.others[0] + (c - a) * seen.others[1]
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
