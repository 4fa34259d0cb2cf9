//! Chain mail: links that give way up to a limit and no further.
//!
//! Every voxel is linked to its six neighbours. A link may be squeezed, stretched and sheared up to its limits without resisting;
//! what is gripped moves, and everything else as little as the limits allow (Gibson 1997). Along each of the grid's axes that is a
//! problem of shortest paths: with `b` the motion of what is gripped and `c` the slack of the links on the way,
//!
//! ```text
//! d(x) = max(0, b − min over paths from the grip to x of Σ c)
//! ```
//!
//! is the least motion that keeps all limits, whatever order it is found in. (Gibson's queue finds it where all links are alike;
//! with different ones the order matters, as Schill et al. 1998 show, and theirs is that of [`solve_by_paths`].) Where all links are
//! alike the cost of a path is the sum of what it goes along each axis, and one sweep forth and back an axis finds it.
//!
//! Where the least size of a squeezed link is more than twice the shear no cell can fold: ∇φ is diagonally dominant.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

use ivd_core::op::{by_class, check_fields};
use ivd_core::{Error, Exec, FieldBricks, Grid, Labels, ParamError, VoxelCoord, VoxelIndex};
use ivd_field::inverse::from_bricks;
use ivd_field::param::{is_finite, is_near};
use ivd_field::sampler::{brick_at, brick_voxels};
use ivd_field::vectors::FARTHEST;
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::reach::too_far;

/// How far links give way. The defaults are soft.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Links {
    /// Least length of a link along its axis, relative to its length at rest.
    #[schemars(range(max = 1.0), extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub shrink: f64,
    /// Largest length of a link along its axis, relative to its length at rest.
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "1"))]
    pub stretch: f64,
    /// Most that a link's ends go sideways, relative to its length at rest.
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "1"))]
    pub shear: f64,
}

impl Default for Links {
    fn default() -> Self {
        Self { shrink: 0.5, stretch: 1.5, shear: 0.2 }
    }
}

/// How far the links of a class give way; what isn't given is as in all others.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ClassLinks {
    /// Least length of a link along its axis, relative to its length at rest.
    #[schemars(range(max = 1.0), extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub shrink: Option<f64>,
    /// Largest length of a link along its axis, relative to its length at rest.
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "1"))]
    pub stretch: Option<f64>,
    /// Most that a link's ends go sideways, relative to its length at rest.
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "1"))]
    pub shear: Option<f64>,
}

impl ClassLinks {
    /// The links, with those of all others where nothing is said.
    pub fn or(self, others: Links) -> Links {
        Links {
            shrink: self.shrink.unwrap_or(others.shrink),
            stretch: self.stretch.unwrap_or(others.stretch),
            shear: self.shear.unwrap_or(others.shear),
        }
    }
}

impl From<Links> for ClassLinks {
    fn from(all: Links) -> Self {
        Self { shrink: Some(all.shrink), stretch: Some(all.stretch), shear: Some(all.shear) }
    }
}

/// Chain mail over the voxels: what is gripped within a ball moves, and links take the rest along.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChainMail {
    /// Middle of what is gripped, RAS.
    #[schemars(extend("x-unit" = "mm"))]
    pub centre: [f64; 3],
    /// Voxels this near to it are gripped, and the nearest one.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub grip: f64,
    /// Way that they go, RAS.
    #[schemars(extend("x-unit" = "mm"))]
    pub by: [f64; 3],
    /// The links.
    #[serde(flatten)]
    pub links: Links,
    /// Links by class, where labels are given; a link between two classes gives way by the mean of both. Only as the first step, and
    /// where nothing has moved before it: labels are of the volume at rest.
    #[serde(default, deserialize_with = "by_class")]
    pub material: BTreeMap<u16, ClassLinks>,
}

impl ChainMail {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    /// What the schema of a single field can't say.
    pub(super) fn check_together(&self) -> Result<(), ParamError> {
        is_finite("centre", &self.centre)?;
        is_near("grip", self.grip)?;
        is_finite("by", &self.by)
    }

    /// Links by class.
    fn classes(&self) -> BTreeMap<u16, Links> {
        self.material.iter().map(|(class, own)| (*class, own.or(self.links))).collect()
    }

    /// The motion of every voxel (mm, RAS), at rest everything.
    ///
    /// - `centre`: its own, relative to the grid's origin.
    ///
    /// # Errors
    /// Nothing to grip; labels on another grid; the memory limit; cancellation.
    pub(super) fn field(
        &self,
        grid: &Grid,
        labels: Option<&Labels>,
        exec: &Exec,
    ) -> Result<FieldBricks, Error> {
        let by = grid.inverse_linear_part() * Vector3::from(self.by);
        if Vector3::from(self.by).norm() > FARTHEST {
            return Err(too_far());
        }
        self.check_classes(labels)?;
        let gripped = self.gripped(grid, exec)?;
        let classes = if labels.is_some() { self.classes() } else { BTreeMap::new() };
        let room = self.room(grid, by, &gripped, &classes);
        let count = room.len() as u64;
        // Three components and the vectors, twice while they are put together; and the queue, to which each neighbour may add an entry.
        let queue = if classes.is_empty() { 0 } else { 6 * 16 };
        exec.check_memory("the chain mail", count * (3 * 8 + 2 * 12 + queue))?;
        let components = (0..3)
            .map(|c| {
                let pull = Pull { component: c, by: by[c], step: step(grid, c) };
                exec.check_cancelled()?;
                match labels.filter(|_| !classes.is_empty()) {
                    Some(labels) => {
                        let links = |i: usize| classes.get(&labels.ids()[i]).unwrap_or(&self.links);
                        solve_by_paths(&room, grid, &gripped, &pull, &|i| *links(i), exec)
                    }
                    None => solve_by_sweeps(&room, &gripped, &pull, &self.links, exec),
                }
            })
            .collect::<Result<Vec<_>, Error>>()?;
        let linear = grid.linear_part();
        let bricks = grid.dims().map(|n| n.div_ceil(8));
        let all: Vec<usize> =
            (0..bricks.iter().product()).filter(|&b| room.meets(brick_at(bricks, b))).collect();
        let vectors: Vec<Box<[[f32; 3]]>> = all
            .par_iter()
            .map(|&b| {
                let mut out = vec![[0.0_f32; 3]; FieldBricks::VOXELS].into_boxed_slice();
                for (slot, voxel) in brick_voxels(grid.dims(), brick_at(bricks, b)) {
                    if let Some(i) = room.index(voxel.0) {
                        let d = Vector3::from_fn(|c, _| components[c][i]);
                        out[slot] = (linear * d).map(|c| c as f32).into();
                    }
                }
                out
            })
            .collect();
        from_bricks(grid.dims(), &all, vectors.into_iter())
    }

    /// Every class is one of the labels'.
    fn check_classes(&self, labels: Option<&Labels>) -> Result<(), Error> {
        let Some(labels) = labels else { return Ok(()) };
        let unknown = |class: &&u16| {
            labels.classes().iter().all(|known| known.id != **class) && !labels.ids().contains(class)
        };
        match self.material.keys().find(unknown) {
            None => Ok(()),
            Some(class) => Err(Error::Mismatch {
                what: "the chain mail",
                problem: format!("it has links of class {class}, and the labels have no such class"),
                remedy: "name a class that ivd info lists for the labels",
            }),
        }
    }

    /// The voxels that are gripped.
    fn gripped(&self, grid: &Grid, exec: &Exec) -> Result<Vec<[usize; 3]>, Error> {
        let (dims, linear) = (grid.dims(), grid.linear_part());
        let middle = grid.inverse_linear_part() * Vector3::from(self.centre);
        if (0..3).any(|a| !(-0.5..=dims[a] as f64 - 0.5).contains(&middle[a])) {
            return Err(Error::Mismatch {
                what: "the chain mail's centre",
                problem: format!("it lies outside the volume, at voxel {:.1?}", <[f64; 3]>::from(middle)),
                remedy: "grip something inside the volume",
            });
        }
        let nearest: [usize; 3] =
            std::array::from_fn(|a| (middle[a].round().max(0.0) as usize).min(dims[a] - 1));
        let reach = grid.ball_extent(self.grip);
        let range = |a: usize| {
            let lo = (middle[a] - reach[a]).ceil().max(0.0) as usize;
            lo..((middle[a] + reach[a]).floor().min(dims[a] as f64 - 1.0) + 1.0).max(0.0) as usize
        };
        // Counted as the list grows: by doubling.
        exec.check_memory(
            "what the chain mail grips",
            48 * (0..3).map(|a| range(a).len() as u64).product::<u64>(),
        )?;
        let near =
            |at: [usize; 3]| (linear * (VoxelCoord::from(VoxelIndex(at)).0 - middle)).norm() <= self.grip;
        let mut out = Vec::new();
        for z in range(2) {
            exec.check_cancelled()?;
            let places = range(1).flat_map(|y| range(0).map(move |x| [x, y, z]));
            out.extend(places.filter(|&at| near(at)));
        }
        if !near(nearest) {
            out.push(nearest);
        }
        Ok(out)
    }

    /// The voxels that may move.
    fn room(
        &self,
        grid: &Grid,
        by: Vector3<f64>,
        gripped: &[[usize; 3]],
        classes: &BTreeMap<u16, Links>,
    ) -> Room {
        let dims = grid.dims();
        let all = std::iter::once(&self.links).chain(classes.values());
        let mut reach = [0.0_f64; 3];
        for links in all {
            for c in 0..3 {
                let costs = Costs::new(links, c, step(grid, c));
                for (a, reach) in reach.iter_mut().enumerate() {
                    // The dearest link decides over how far; one without slack over everything.
                    let least = costs.along[a][0].min(costs.along[a][1]);
                    if by[c] != 0.0 {
                        *reach = reach.max((by[c].abs() / least).min(1e9));
                    }
                }
            }
        }
        let end = |a: usize, f: fn(usize, usize) -> usize, first: usize| {
            gripped.iter().map(|g| g[a]).fold(first, f)
        };
        let lo =
            std::array::from_fn(|a| end(a, usize::min, usize::MAX).saturating_sub(reach[a].ceil() as usize));
        let hi = std::array::from_fn(|a| (end(a, usize::max, 0) + reach[a].ceil() as usize + 1).min(dims[a]));
        Room { lo, hi }
    }
}

/// Lengths of the steps along the grid's axes, in steps along axis `component`.
fn step(grid: &Grid, component: usize) -> [f64; 3] {
    grid.spacing().map(|h| h / grid.spacing()[component])
}

/// What goes on along one of the grid's axes (voxels).
pub(super) struct Pull {
    component: usize,
    by: f64,
    step: [f64; 3],
}

/// Slack of the links of one kind in one component, along each axis, for a step ahead (the way of the pull) and one back; across the
/// component's axis both are the same (voxels).
struct Costs {
    along: [[f64; 2]; 3],
}

impl Costs {
    fn new(links: &Links, component: usize, step: [f64; 3]) -> Self {
        let of = |a: usize| {
            if a == component {
                [1.0 - links.shrink, links.stretch - 1.0]
            } else {
                [links.shear * step[a]; 2]
            }
        };
        Self { along: [of(0), of(1), of(2)] }
    }

    /// Slack of a step along axis `a` of the grid, up (`true`) or down, where the pull goes up or down its own axis.
    fn of(&self, a: usize, up: bool, pull: &Pull) -> f64 {
        self.along[a][usize::from(up != (pull.by > 0.0))]
    }
}

/// A box of voxels.
pub(super) struct Room {
    lo: [usize; 3],
    hi: [usize; 3],
}

impl Room {
    fn size(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.hi[a] - self.lo[a])
    }

    fn len(&self) -> usize {
        self.size().iter().product()
    }

    /// Place of a voxel in the box, x fastest.
    fn index(&self, voxel: [usize; 3]) -> Option<usize> {
        let size = self.size();
        let at: [usize; 3] = std::array::from_fn(|a| voxel[a].wrapping_sub(self.lo[a]));
        (0..3).all(|a| at[a] < size[a]).then(|| at[0] + size[0] * (at[1] + size[1] * at[2]))
    }

    /// Whether it meets a brick.
    fn meets(&self, brick: [usize; 3]) -> bool {
        (0..3).all(|a| self.lo[a] < 8 * brick[a] + 8 && 8 * brick[a] < self.hi[a])
    }
}

/// One component of the motion (voxels) where all links are alike: a sweep forth and one back along every axis.
fn solve_by_sweeps(
    room: &Room,
    gripped: &[[usize; 3]],
    pull: &Pull,
    links: &Links,
    exec: &Exec,
) -> Result<Vec<f64>, Error> {
    let mut out = vec![0.0; room.len()];
    let most = pull.by.abs();
    for &voxel in gripped {
        out[room.index(voxel).expect("the room holds what is gripped")] = most;
    }
    if most == 0.0 {
        return Ok(out);
    }
    let (size, costs) = (room.size(), Costs::new(links, pull.component, pull.step));
    for a in 0..3 {
        let stride = [1, size[0], size[0] * size[1]][a];
        let [up, down] = [true, false].map(|up| costs.of(a, up, pull));
        // Lines of one axis lie in blocks that nothing else touches; in a block each layer follows the one before.
        for block in out.chunks_mut(stride * size[a]).collect::<Vec<_>>().chunks_mut(1 << 12) {
            exec.check_cancelled()?;
            block.par_iter_mut().for_each(|block| sweep(block, stride, up, down));
        }
    }
    turn(&mut out, pull);
    Ok(out)
}

/// The layers of `stride` values of a block, each held by the one before it, and then by the one after it.
fn sweep(block: &mut [f64], stride: usize, up: f64, down: f64) {
    /// Values of a layer that a thread takes at once.
    const SHARE: usize = 1 << 12;
    let layers = block.len() / stride;
    let plain = |(here, other): (&mut [f64], &[f64]), slack: f64| {
        for (here, other) in here.iter_mut().zip(other) {
            *here = here.max(other - slack);
        }
    };
    let hold = |here: &mut [f64], other: &[f64], slack: f64| {
        if stride <= SHARE {
            plain((here, other), slack);
        } else {
            here.par_chunks_mut(SHARE).zip(other.par_chunks(SHARE)).for_each(|rows| plain(rows, slack));
        }
    };
    for i in 1..layers {
        let (before, here) = block.split_at_mut(i * stride);
        hold(&mut here[..stride], &before[(i - 1) * stride..], up);
    }
    for i in (1..layers).rev() {
        let (here, after) = block.split_at_mut(i * stride);
        hold(&mut here[(i - 1) * stride..], &after[..stride], down);
    }
}

/// From lengths to a motion along the pull.
fn turn(moved: &mut [f64], pull: &Pull) {
    for d in moved {
        *d *= pull.by.signum();
    }
}

/// A voxel of the box that is due, the farthest moved first; of equals the first in memory order.
struct Due {
    moved: f64,
    at: usize,
}

impl Ord for Due {
    fn cmp(&self, other: &Self) -> Ordering {
        self.moved.total_cmp(&other.moved).then(other.at.cmp(&self.at))
    }
}

impl PartialOrd for Due {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Due {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Due {}

/// The same where links differ, from voxel to voxel, what moves farthest first: no voxel is looked at twice (Dijkstra 1959; Schill et
/// al. 1998).
fn solve_by_paths(
    room: &Room,
    grid: &Grid,
    gripped: &[[usize; 3]],
    pull: &Pull,
    links: &impl Fn(usize) -> Links,
    exec: &Exec,
) -> Result<Vec<f64>, Error> {
    let mut out = vec![0.0; room.len()];
    let most = pull.by.abs();
    let mut queue = BinaryHeap::new();
    if most > 0.0 {
        for &voxel in gripped {
            let at = room.index(voxel).expect("the room holds what is gripped");
            out[at] = most;
            queue.push(Due { moved: most, at });
        }
    }
    let size = room.size();
    let costs_at =
        |voxel: [usize; 3]| Costs::new(&links(grid.linear(VoxelIndex(voxel))), pull.component, pull.step);
    let mut done = 0_u64;
    while let Some(Due { moved, at }) = queue.pop() {
        if moved < out[at] {
            continue;
        }
        done += 1;
        if done.is_multiple_of(1 << 16) {
            exec.check_cancelled()?;
        }
        let place = [at % size[0], at / size[0] % size[1], at / (size[0] * size[1])];
        let voxel: [usize; 3] = std::array::from_fn(|a| room.lo[a] + place[a]);
        let own = costs_at(voxel);
        for (a, up) in (0..3).flat_map(|a| [(a, true), (a, false)]) {
            let mut next = voxel;
            next[a] = if up { next[a] + 1 } else { next[a].wrapping_sub(1) };
            let Some(to) = room.index(next) else { continue };
            let slack = 0.5 * (own.of(a, up, pull) + costs_at(next).of(a, up, pull));
            if moved - slack > out[to] {
                out[to] = moved - slack;
                queue.push(Due { moved: out[to], at: to });
            }
        }
    }
    turn(&mut out, pull);
    Ok(out)
}

#[cfg(test)]
mod tests;
