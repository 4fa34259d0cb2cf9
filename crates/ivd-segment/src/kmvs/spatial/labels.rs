//! The last pass: labels, and the figures of the classes.

use ivd_core::{Class, Exec, Scalar, SpillVec, parallel};

use super::brick::Brick;
use super::build::squares_of;
use super::frame::{Centroid, Frame, wide};
use super::hierarchy::Hierarchy;
use super::sums::{Sums, Tally};
use super::walk::{Candidate, Group, Sink, Walk, candidates};
use crate::Error;
use crate::classes::set_crossings;

/// What the last pass found.
pub(super) struct Labelled {
    pub(super) ids: SpillVec<u16>,
    pub(super) classes: Vec<Class>,
    /// The centroid of each class.
    pub(super) order: Vec<usize>,
    pub(super) ties: u64,
    pub(super) visited: u64,
}

/// Labels every voxel by its nearest centroid; `tally` is of these centroids. Classes are in the order of their means, the
/// larger first where means are equal; a centroid without voxels has none.
pub(super) fn label<T: Scalar>(
    (hierarchy, frame): (&Hierarchy<T>, &Frame),
    centroids: &[Centroid],
    tally: &Tally,
    voxels: usize,
    exec: &Exec,
) -> Result<Labelled, Error> {
    let mean = |k: usize| mean_of(tally, k, frame);
    let order = by_mean(tally, frame);
    let mut classes = vec![0; centroids.len()];
    order.iter().enumerate().for_each(|(i, k)| classes[*k] = i as u16 + 1);
    let mut ids = exec.bulk("the labels", voxels)?;
    let found = write((hierarchy, frame), &candidates(centroids), &classes, &mut ids, exec)?;
    let class = |(i, &k): (usize, &usize)| Class {
        id: i as u16 + 1,
        name: None,
        mean: mean(k),
        sd: frame.spread(about(&tally.sums[k], found.squares[k]), tally.sums[k].count),
        voxels: tally.sums[k].count,
        lower: None,
        upper: None,
    };
    let mut classes: Vec<Class> = order.iter().enumerate().map(class).collect();
    set_crossings(&mut classes);
    Ok(Labelled { ids, classes, order, ties: found.ties, visited: found.visited })
}

/// The mean value of a cluster.
fn mean_of(tally: &Tally, k: usize, frame: &Frame) -> f64 {
    tally.sums[k].centroid(frame).map_or(0.0, |c| c.real[3])
}

/// The clusters that have voxels, by mean value, the larger first where these are equal.
fn by_mean(tally: &Tally, frame: &Frame) -> Vec<usize> {
    let mut order: Vec<usize> = (0..tally.sums.len()).filter(|k| tally.sums[*k].count > 0).collect();
    order.sort_by(|&a, &b| {
        let larger = tally.sums[b].count.cmp(&tally.sums[a].count);
        mean_of(tally, a, frame).total_cmp(&mean_of(tally, b, frame)).then(larger).then(a.cmp(&b))
    });
    order
}

/// Sum of squared deviations from the mean, in fixed point.
fn about(sums: &Sums, squares: i128) -> f64 {
    let sum = wide(sums.values);
    wide(squares).minus(sum.times(sum).over(sums.count as f64)).value().max(0.0)
}

/// Counts of one layer of bricks, or of all.
struct Found {
    /// Sum of squared values in fixed point, by centroid.
    squares: Vec<i128>,
    ties: u64,
    visited: u64,
}

impl Found {
    fn join(mut self, other: &Self) -> Self {
        self.squares.iter_mut().zip(&other.squares).for_each(|(a, b)| *a += b);
        self.ties += other.ties;
        self.visited += other.visited;
        self
    }
}

/// Writes the labels, one layer of bricks a task.
fn write<T: Scalar>(
    (hierarchy, frame): (&Hierarchy<T>, &Frame),
    all: &[Candidate],
    classes: &[u16],
    ids: &mut [u16],
    exec: &Exec,
) -> Result<Found, Error> {
    let depth = 1 << hierarchy.layout.log[2];
    let voxels = hierarchy.layout.layer_voxels();
    let layer = |index: usize, ids: &mut [u16]| {
        let z = |brick: &Brick| brick.origin[2] / depth;
        let from = hierarchy.bricks.partition_point(|b| z(b) < index);
        let to = hierarchy.bricks.partition_point(|b| z(b) <= index);
        let found = Found { squares: vec![0; all.len()], ties: 0, visited: 0 };
        let mut sink = Writing { ids, base: index * voxels, classes, frame, found, fixed: Vec::new() };
        let mut walk = Walk::default();
        for brick in &hierarchy.bricks[from..to] {
            exec.check_cancelled()?;
            walk.brick((hierarchy, frame), brick, all, exec.skip, &mut sink);
        }
        Ok::<_, ivd_core::Error>(Found { visited: walk.visited, ..sink.found })
    };
    let none = Found { squares: vec![0; all.len()], ties: 0, visited: 0 };
    let layers = parallel::try_map_pieces_mut(ids, voxels, &layer)?;
    Ok(layers.iter().fold(none, Found::join))
}

struct Writing<'a> {
    ids: &'a mut [u16],
    /// Linear index of the first label.
    base: usize,
    classes: &'a [u16],
    frame: &'a Frame,
    found: Found,
    fixed: Vec<i64>,
}

impl Writing<'_> {
    fn add_squares<T: Scalar>(&mut self, values: &[T], id: u16) {
        self.fixed.clear();
        self.fixed.extend(values.iter().map(|v| self.frame.fixed(self.frame.relative(*v))));
        self.found.squares[usize::from(id)] += squares_of::<T>(&self.fixed);
    }

    #[inline(always)]
    fn at<T: Scalar>(&self, hierarchy: &Hierarchy<T>, brick: &Brick, place: u16) -> usize {
        let [x, y, z] = hierarchy.layout.unpack(place);
        hierarchy.layout.linear([brick.origin[0] + x, brick.origin[1] + y, brick.origin[2] + z]) - self.base
    }
}

impl<T: Scalar> Sink<T> for Writing<'_> {
    fn brick(&mut self, hierarchy: &Hierarchy<T>, brick: &Brick, id: u16) {
        self.found.squares[usize::from(id)] += brick.value_squares;
        let class = self.classes[usize::from(id)];
        if brick.whole {
            let edges: [usize; 3] = std::array::from_fn(|a| usize::from(brick.high[a]) + 1);
            for (z, y) in (0..edges[2]).flat_map(|z| (0..edges[1]).map(move |y| (z, y))) {
                let start = self.at(hierarchy, brick, hierarchy.layout.pack([0, y, z]));
                self.ids[start..start + edges[0]].fill(class);
            }
            return;
        }
        for &place in &hierarchy.places[brick.first..brick.first + brick.count] {
            let at = self.at(hierarchy, brick, place);
            self.ids[at] = class;
        }
    }

    fn group(&mut self, hierarchy: &Hierarchy<T>, brick: &Brick, group: usize, id: u16) {
        let members = brick.members(group);
        self.add_squares(&hierarchy.values[members.clone()], id);
        let class = self.classes[usize::from(id)];
        for &place in &hierarchy.places[members] {
            let at = self.at(hierarchy, brick, place);
            self.ids[at] = class;
        }
    }

    fn voxels(&mut self, hierarchy: &Hierarchy<T>, group: &Group<'_>) {
        let Group { brick, near, looked, .. } = *group;
        let members = group.members.clone();
        self.found.ties += looked.ties(near, members.len());
        for (i, member) in members.enumerate() {
            let id = near[looked.which[i] as usize].id;
            self.add_squares(&hierarchy.values[member..=member], id);
            let at = self.at(hierarchy, brick, hierarchy.places[member]);
            self.ids[at] = self.classes[usize::from(id)];
        }
    }
}
