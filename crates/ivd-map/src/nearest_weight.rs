//! The field before any repair: each voxel takes the weighted motion of the nearest lattice point.

use std::collections::BTreeMap;

use ivd_core::{Error, Exec, FieldBricks, Lattice, Mask, VoxelCoord, VoxelIndex};
use ivd_field::falloff::smooth_fall;
use ivd_field::sampler::{brick_at, brick_voxels};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::params::{OctreeParams, Outside};
use super::region::{Region, Widths};

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

/// The motion of the nearest lattice point, weighted; of the given bricks one after another, zeros where nothing moves.
///
/// - `kept`: what was found before, for the same `nearest`; takes what is found now.
pub(super) fn carry<N: Nearest>(
    part: &Part<'_, N>,
    displacement: &[[f64; 3]],
    region: &Region,
    params: &OctreeParams,
    bricks: &[usize],
    mut kept: Option<&mut Kept>,
    exec: &Exec,
) -> Result<Vec<[f32; 3]>, Error> {
    let carrier = Carrier::new(part, displacement, region, params);
    let mut seen = bricks.iter().map(|&brick| kept.as_mut().map(|kept| kept.take(brick))).collect::<Vec<_>>();
    let mut vectors = vec![[0.0; 3]; FieldBricks::VOXELS * bricks.len()];
    let observer = exec.observer();
    observer.begin("map", bricks.len() as u64);
    let carried =
        bricks.par_iter().zip(&mut seen).zip(vectors.par_chunks_exact_mut(FieldBricks::VOXELS)).try_for_each(
            |((&brick, seen), out)| {
                exec.check_cancelled()?;
                carrier.brick(brick, seen.as_mut(), out);
                observer.advance("map", 1);
                Ok(())
            },
        );
    observer.end("map");
    if let Some(kept) = kept {
        // What a long way has left behind is given up.
        if !bricks.is_empty() && kept.bricks.len() > 64 + 2 * bricks.len().max(kept.sought) {
            kept.clear();
        }
        kept.bricks.extend(bricks.iter().copied().zip(seen.into_iter().flatten()));
    }
    carried.map(|()| vectors)
}

/// Finds the nearest points of bricks before they are asked for.
pub(super) fn seek<N: Nearest>(
    part: &Part<'_, N>,
    region: &Region,
    params: &OctreeParams,
    bricks: &[usize],
    kept: &mut Kept,
    exec: &Exec,
) -> Result<(), Error> {
    let carrier = Carrier::new(part, &[], region, params);
    let mut seen: Vec<_> = bricks.iter().map(|&brick| (brick, kept.take(brick))).collect();
    let found = seen.par_iter_mut().try_for_each(|(brick, seen)| {
        exec.check_cancelled()?;
        carrier.search_brick(*brick, Kept::AHEAD, seen);
        Ok(())
    });
    kept.bricks.extend(seen);
    kept.sought = bricks.len();
    found
}

/// Nearest points that were found, by brick. They are right for as long as the same triangles may move.
#[derive(Debug, Default)]
pub(super) struct Kept {
    bricks: BTreeMap<usize, KeptBrick>,
    /// Bricks that were searched before they were asked for.
    sought: usize,
}

/// What was found for the voxels of a brick.
#[derive(Debug)]
struct KeptBrick {
    /// Up to what distance each voxel's surroundings were searched (mm, rounded down); below 0: not at all.
    within: Box<[f32]>,
    /// The least of them.
    least: f32,
    /// The voxels to which a triangle that may move is nearest, ascending.
    seen: Vec<Seen>,
}

/// What is nearest to a voxel.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// The voxel's place in its brick.
    slot: u32,
    triangle: u32,
    /// Weights of its second and third corner.
    others: [f64; 2],
    /// Distance (mm).
    distance: f64,
}

impl KeptBrick {
    fn new() -> Self {
        Self { within: vec![-1.0; FieldBricks::VOXELS].into(), least: -1.0, seen: Vec::new() }
    }

    /// Whether voxel `slot` was searched up to a distance (mm).
    fn knows(&self, slot: usize, distance: f64) -> bool {
        f64::from(self.within[slot]) >= distance
    }

    /// Takes what was found at voxel `slot` within a distance (mm).
    fn take(&mut self, slot: usize, within: f64, hit: Option<&Hit>) {
        let near = within as f32;
        self.within[slot] = if f64::from(near) > within { near.next_down() } else { near };
        if let Some(&Hit { triangle, barycentric: [_, b, c], distance }) = hit {
            self.seen.push(Seen { slot: slot as u32, triangle, others: [b, c], distance });
        }
    }

    /// Brings in order what was taken.
    fn sum_up(&mut self) {
        self.seen.sort_unstable_by_key(|seen| seen.slot);
        self.least = self.within.iter().copied().fold(f32::INFINITY, f32::min);
    }
}

impl Kept {
    /// Bytes kept for a brick, at most.
    pub(super) const BRICK: u64 = (FieldBricks::VOXELS * (size_of::<Seen>() + size_of::<f32>())) as u64;
    /// How much further than asked for is searched, so that a motion may grow a little before that is done again.
    const AHEAD: f64 = 1.5;

    /// Bricks of which something is kept when these are too.
    pub(super) fn with(&self, bricks: &[usize]) -> usize {
        self.bricks.len() + bricks.iter().filter(|brick| !self.bricks.contains_key(brick)).count()
    }

    /// Whether something was searched before it was asked for.
    pub(super) fn sought(&self) -> bool {
        self.sought > 0
    }

    /// Gives everything up.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    fn take(&mut self, brick: usize) -> KeptBrick {
        self.bricks.remove(&brick).unwrap_or_else(KeptBrick::new)
    }
}

struct Carrier<'a, N> {
    part: &'a Part<'a, N>,
    /// Of each vertex; a search needs none.
    displacement: &'a [[f64; 3]],
    region: &'a Region,
    params: &'a OctreeParams,
    /// Where they are the same everywhere; and the widest.
    alike: Option<Widths>,
    widest: Widths,
    layer: f64,
}

impl<'a, N: Nearest> Carrier<'a, N> {
    fn new(
        part: &'a Part<'a, N>,
        displacement: &'a [[f64; 3]],
        region: &'a Region,
        params: &'a OctreeParams,
    ) -> Self {
        let layer = LAYER * part.lattice.grid().voxel_diagonal();
        Self { part, displacement, region, params, alike: region.alike(), widest: region.widest(), layer }
    }

    /// Fills a brick, which is 0.
    fn brick(&self, brick: usize, kept: Option<&mut KeptBrick>, out: &mut [[f32; 3]]) {
        let ahead = if kept.is_some() { Kept::AHEAD } else { 1.0 };
        let mut fresh = None;
        let found = kept.unwrap_or_else(|| fresh.insert(KeptBrick::new()));
        self.search_brick(brick, ahead, found);
        let grid = self.part.lattice.grid();
        let linear = grid.linear_part();
        let first = brick_at(grid.dims().map(|n| n.div_ceil(8)), brick).map(|b| 8 * b);
        for seen in &found.seen {
            let slot = seen.slot as usize;
            let voxel = VoxelIndex([first[0] + slot % 8, first[1] + slot / 8 % 8, first[2] + slot / 64]);
            let inside = self.part.inside.inside()[grid.linear(voxel)] != 0;
            let point = || linear * VoxelCoord::from(voxel).0;
            let widths = self.alike.unwrap_or_else(|| self.region.widths(point(), self.widest));
            let near = self.weight(inside, widths, seen.distance);
            if near > 0.0 {
                let weight = self.region.weight(point()) * near;
                if weight > 0.0 {
                    out[slot] = (self.motion(seen) * weight).map(|c| c as f32).into();
                }
            }
        }
    }

    /// Searches for the voxels of a brick that aren't known as far as they need to be, `ahead` times as far as that.
    fn search_brick(&self, brick: usize, ahead: f64, found: &mut KeptBrick) {
        let limits = |widths: Widths| [false, true].map(|inside| self.limit(inside, widths));
        let [outside, inside] = limits(self.widest);
        let most = outside.max(inside);
        let alike = self.alike.map(limits);
        if f64::from(found.least) >= most {
            return;
        }
        let grid = self.part.lattice.grid();
        let dims = grid.dims();
        let linear = grid.linear_part();
        let mut known = None;
        for (slot, voxel) in brick_voxels(dims, brick_at(dims.map(|n| n.div_ceil(8)), brick)) {
            if found.knows(slot, most) {
                continue;
            }
            let point = linear * VoxelCoord::from(voxel).0;
            let limits = alike.unwrap_or_else(|| limits(self.region.widths(point, self.widest)));
            let limit = limits[usize::from(self.part.inside.inside()[grid.linear(voxel)] != 0)];
            if found.knows(slot, limit) {
                continue;
            }
            if self.region.weight(point) > 0.0 {
                let known = known.get_or_insert_with(|| Known::new(grid.voxel_diagonal()));
                self.search(slot, point, limit * ahead, known, found);
            }
        }
        if known.is_some() {
            found.sum_up();
        }
    }

    /// Finds what is nearest to the point of a voxel, within a limit (mm).
    fn search(&self, slot: usize, point: Vector3<f64>, limit: f64, known: &mut Known, found: &mut KeptBrick) {
        let near = known.nearest(slot, point);
        let (bound, still) = near.map_or((f64::INFINITY, None), |near| near.bound(point, known.slack));
        let within = bound.min(limit);
        match self.part.nearest.nearest(point, within, still.is_some() && bound <= limit) {
            Found::On(hit) => {
                known.set(slot, Some(self.position(&hit)), false);
                found.take(slot, f64::INFINITY, Some(&hit));
            }
            Found::Still(place) => {
                known.set(slot, place.or(still), true);
                found.take(slot, f64::INFINITY, None);
            }
            Found::Nothing => found.take(slot, within, None),
        }
    }

    /// Distance beyond which the weight is 0.
    fn limit(&self, inside: bool, widths: Widths) -> f64 {
        match (inside, self.params.band.outside) {
            (true, _) if self.params.weight == super::DepthWeight::One => f64::INFINITY,
            (true, _) => widths.depth,
            (false, Outside::Band) => widths.margin,
            (false, Outside::Free) => self.layer,
        }
    }

    fn weight(&self, inside: bool, widths: Widths, distance: f64) -> f64 {
        match (inside, self.params.band.outside) {
            (true, _) => self.params.weight.at(distance / widths.depth),
            (false, Outside::Band) => smooth_fall(distance / widths.margin),
            (false, Outside::Free) => f64::from(u8::from(distance <= self.layer)),
        }
    }

    /// Where a lattice point lies (mm, relative to the grid's origin).
    fn position(&self, hit: &Hit) -> Vector3<f64> {
        let [a, b, c] =
            self.part.lattice.triangles()[hit.triangle as usize].map(|v| self.part.positions[v as usize]);
        a * hit.barycentric[0] + b * hit.barycentric[1] + c * hit.barycentric[2]
    }

    /// The motion at a lattice point, linear on its triangle; exact where the corners move alike.
    fn motion(&self, seen: &Seen) -> Vector3<f64> {
        let [a, b, c] = self.part.lattice.triangles()[seen.triangle as usize]
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
