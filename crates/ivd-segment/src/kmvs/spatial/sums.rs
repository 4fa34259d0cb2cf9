//! Exact sums over the voxels of every centroid.

use ivd_core::{Exec, Scalar, parallel};

use super::brick::Brick;
use super::frame::{Centroid, Frame, wide};
use super::hierarchy::Hierarchy;
use super::walk::{Group, Sink, Walk, candidates};
use crate::Error;

/// Bricks that one task takes.
const TASK: usize = 16;

/// Number of voxels, sums of their indices, and of their values in fixed point: integers, so that no order matters.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Sums {
    pub(super) count: u64,
    pub(super) indices: [u64; 3],
    pub(super) values: i128,
}

impl Sums {
    /// Adds `count` voxels by the sums of their places in a brick.
    #[inline(always)]
    fn add(&mut self, brick: &Brick, count: u64, places: [u64; 3], values: i64) {
        self.count += count;
        for a in 0..3 {
            self.indices[a] += places[a] + count * brick.origin[a] as u64;
        }
        self.values += i128::from(values);
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.count += other.count;
        for a in 0..3 {
            self.indices[a] += other.indices[a];
        }
        self.values += other.values;
    }

    /// The mean, where there are voxels.
    pub(super) fn centroid(&self, frame: &Frame) -> Option<Centroid> {
        (self.count > 0).then(|| frame.centroid(self.count, self.indices, self.values))
    }
}

/// Sums of what is nearest to each centroid.
pub(super) struct Tally {
    pub(super) sums: Vec<Sums>,
    pub(super) visited: u64,
}

impl Tally {
    pub(super) fn of<T: Scalar>(
        hierarchy: &Hierarchy<T>,
        frame: &Frame,
        centroids: &[Centroid],
        exec: &Exec,
    ) -> Result<Self, Error> {
        let all = candidates(centroids);
        let sink = || Adding { sums: vec![Sums::default(); all.len()], part: Part::default(), frame };
        let tasks = parallel::pieces(hierarchy.bricks.len(), TASK);
        // Sums of whole numbers: the same in any order.
        let parts = parallel::try_gather(tasks, &|| (sink(), Walk::default()), &|(sink, walk), i| {
            exec.check_cancelled()?;
            for brick in &hierarchy.bricks[parallel::piece(hierarchy.bricks.len(), TASK, i)] {
                walk.brick((hierarchy, frame), brick, &all, exec.skip, sink);
            }
            Ok::<_, ivd_core::Error>(())
        })?;
        let mut tally = Self { sums: vec![Sums::default(); all.len()], visited: 0 };
        for (sink, walk) in &parts {
            tally.sums.iter_mut().zip(&sink.sums).for_each(|(a, b)| a.join(b));
            tally.visited += walk.visited;
        }
        Ok(tally)
    }

    /// Sum of squared distances of all voxels from the means of what they are tallied with (real units²):
    /// `Σ|p|² - Σ|S|²/n`, with the digits that the difference needs.
    pub(super) fn inertia<T>(&self, hierarchy: &Hierarchy<T>, frame: &Frame) -> f64 {
        let about = std::array::from_fn(|a| {
            let mut left = wide(hierarchy.squares[a]);
            for sums in self.sums.iter().filter(|s| s.count > 0) {
                let sum = if a < 3 { wide(i128::from(sums.indices[a])) } else { wide(sums.values) };
                left = left.minus(sum.times(sum).over(sums.count as f64));
            }
            left.value().max(0.0)
        });
        frame.inertia(about)
    }
}

/// Sums of one candidate over a group.
#[derive(Debug, Clone, Copy, Default)]
struct Few {
    count: u32,
    places: [u32; 3],
    values: i64,
}

#[derive(Default)]
struct Part(Vec<Few>);

struct Adding<'a> {
    sums: Vec<Sums>,
    part: Part,
    frame: &'a Frame,
}

impl<T: Scalar> Sink<T> for Adding<'_> {
    fn brick(&mut self, _: &Hierarchy<T>, brick: &Brick, id: u16) {
        let sums = &mut self.sums[usize::from(id)];
        sums.add(brick, brick.count as u64, brick.sums.map(u64::from), brick.value_sum);
    }

    #[inline]
    fn group(&mut self, hierarchy: &Hierarchy<T>, brick: &Brick, group: usize, id: u16) {
        let places = &hierarchy.group_places[brick.first_group + group];
        let count = brick.members(group).len() as u64;
        let places = [6, 7, 8].map(|i| u64::from(places[i]));
        let values = hierarchy.group_sums[brick.first_group + group];
        self.sums[usize::from(id)].add(brick, count, places, values);
    }

    fn voxels(&mut self, hierarchy: &Hierarchy<T>, group: &Group<'_>) {
        let Group { brick, near, looked, .. } = *group;
        let part = &mut self.part.0;
        part.clear();
        part.resize(near.len(), Few::default());
        let places = &hierarchy.places[group.members.clone()];
        for (i, (place, value)) in places.iter().zip(&hierarchy.values[group.members.clone()]).enumerate() {
            let few = &mut part[looked.which[i] as usize];
            let at = hierarchy.layout.unpack(*place);
            few.count += 1;
            for a in 0..3 {
                few.places[a] += at[a] as u32;
            }
            few.values += self.frame.fixed(self.frame.relative(*value));
        }
        for (few, candidate) in part.iter().zip(near) {
            let sums = &mut self.sums[usize::from(candidate.id)];
            sums.add(brick, u64::from(few.count), few.places.map(u64::from), few.values);
        }
    }
}
