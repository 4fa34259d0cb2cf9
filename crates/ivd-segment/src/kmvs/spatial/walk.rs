//! Which centroid every voxel is nearest to, by bricks, groups and voxels (the filter of Kanungo et al. 2002).
//!
//! A box of features keeps those centroids that may be nearest to some point in it. Where one is left, the whole brick or
//! group belongs to it; else its parts are looked at with the centroids that are left. Only decisions beyond all doubt of
//! rounding are made for boxes; the rest is left to [`distance`] voxel by voxel, so that no label depends on the boxes.

use std::ops::Range;

use ivd_core::Scalar;

use super::brick::{Brick, GROUP};
use super::frame::{Centroid, Frame, Point, distance};
use super::hierarchy::Hierarchy;

/// A centroid is left out where every point of a box is nearer to another one by this, relative to the distances: a
/// thousandfold of what rounding can do, and more than counts as a tie.
const DOUBT: f64 = 4e-12;
/// Distances within this of each other, relatively, are a tie.
pub(super) const TIE: f64 = 1e-12;

/// A centroid that may be the nearest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) id: u16,
    pub(super) at: Point,
    /// Squared distance from the middle of the box at hand.
    far: f64,
}

/// All centroids.
pub(super) fn candidates(centroids: &[Centroid]) -> Vec<Candidate> {
    centroids.iter().enumerate().map(|(id, c)| Candidate { id: id as u16, at: c.at, far: 0.0 }).collect()
}

/// What is done with voxels once their centroid is known.
pub(super) trait Sink<T> {
    /// All voxels of a brick are nearest to one centroid.
    fn brick(&mut self, hierarchy: &Hierarchy<T>, brick: &Brick, id: u16);
    /// All voxels of a group are.
    fn group(&mut self, hierarchy: &Hierarchy<T>, brick: &Brick, group: usize, id: u16);
    /// The voxels of a group, each with the number of its candidate.
    fn voxels(&mut self, hierarchy: &Hierarchy<T>, group: &Group<'_>);
}

/// A group whose voxels were looked at one by one.
pub(super) struct Group<'a> {
    pub(super) brick: &'a Brick,
    /// Its voxels in the hierarchy.
    pub(super) members: Range<usize>,
    /// The centroids that they were compared with.
    pub(super) near: &'a [Candidate],
    pub(super) looked: &'a Looked,
}

/// Voxels looked at one by one: features, distance to the nearest candidate and its number.
pub(super) struct Looked {
    pub(super) at: [[f64; GROUP]; 4],
    pub(super) best: [f64; GROUP],
    pub(super) which: [u32; GROUP],
}

/// Memory of one thread.
pub(super) struct Walk {
    of_brick: Vec<Candidate>,
    of_group: Vec<Candidate>,
    looked: Looked,
    /// Voxels that were looked at one by one.
    pub(super) visited: u64,
}

impl Default for Walk {
    fn default() -> Self {
        let looked = Looked { at: [[0.0; GROUP]; 4], best: [0.0; GROUP], which: [0; GROUP] };
        Self { of_brick: Vec::new(), of_group: Vec::new(), looked, visited: 0 }
    }
}

impl Walk {
    /// Hands every voxel of a brick to the sink. Without `skip`, all are looked at one by one with every centroid.
    pub(super) fn brick<T: Scalar>(
        &mut self,
        (hierarchy, frame): (&Hierarchy<T>, &Frame),
        brick: &Brick,
        all: &[Candidate],
        skip: bool,
        sink: &mut impl Sink<T>,
    ) {
        let groups = brick.count.div_ceil(GROUP);
        if !skip {
            for group in 0..groups {
                self.voxels((hierarchy, frame), brick, group, all, sink);
            }
            return;
        }
        let mut of_brick = std::mem::take(&mut self.of_brick);
        let mut of_group = std::mem::take(&mut self.of_group);
        prune(&Cell::of_brick(frame, brick), all, &mut of_brick);
        if let [only] = &of_brick[..] {
            sink.brick(hierarchy, brick, only.id);
        } else {
            for group in 0..groups {
                prune(&Cell::of_group(frame, hierarchy, brick, group), &of_brick, &mut of_group);
                match &of_group[..] {
                    [only] => sink.group(hierarchy, brick, group, only.id),
                    near => self.voxels((hierarchy, frame), brick, group, near, sink),
                }
            }
        }
        (self.of_brick, self.of_group) = (of_brick, of_group);
    }

    fn voxels<T: Scalar>(
        &mut self,
        (hierarchy, frame): (&Hierarchy<T>, &Frame),
        brick: &Brick,
        group: usize,
        near: &[Candidate],
        sink: &mut impl Sink<T>,
    ) {
        let members = brick.members(group);
        let len = members.len();
        self.visited += len as u64;
        self.looked.set_features(hierarchy, frame, brick, members.clone());
        self.looked.choose(near, len);
        sink.voxels(hierarchy, &Group { brick, members, near, looked: &self.looked });
    }
}

impl Looked {
    fn set_features<T: Scalar>(
        &mut self,
        hierarchy: &Hierarchy<T>,
        frame: &Frame,
        brick: &Brick,
        members: Range<usize>,
    ) {
        let axes: [&[f64]; 3] = std::array::from_fn(|a| &frame.axes[a][brick.origin[a]..]);
        let members = hierarchy.places[members.clone()].iter().zip(&hierarchy.values[members]);
        for (i, (place, value)) in members.enumerate() {
            let [x, y, z] = hierarchy.layout.unpack(*place);
            let i = i % GROUP;
            self.at[0][i] = axes[0][x];
            self.at[1][i] = axes[1][y];
            self.at[2][i] = axes[2][z];
            self.at[3][i] = frame.value(frame.relative(*value));
        }
    }

    pub(super) fn feature(&self, i: usize) -> Point {
        [self.at[0][i], self.at[1][i], self.at[2][i], self.at[3][i]]
    }

    /// The nearest candidate, the first among equals.
    fn choose(&mut self, near: &[Candidate], len: usize) {
        // Says that no index is out of bounds, so that the loops take several voxels at once.
        let len = len.min(GROUP);
        for i in 0..len {
            self.best[i] = distance(&self.feature(i), &near[0].at);
            self.which[i] = 0;
        }
        for (number, candidate) in near.iter().enumerate().skip(1) {
            for i in 0..len {
                let d = distance(&self.feature(i), &candidate.at);
                let nearer = d < self.best[i];
                self.best[i] = if nearer { d } else { self.best[i] };
                self.which[i] = if nearer { number as u32 } else { self.which[i] };
            }
        }
    }

    /// Voxels with more than one nearest candidate, as far as rounding can tell.
    pub(super) fn ties(&self, near: &[Candidate], len: usize) -> u64 {
        let tied = |i: &usize| {
            let most = self.best[*i] * (1.0 + TIE);
            near.iter().filter(|c| distance(&self.feature(*i), &c.at) <= most).count() > 1
        };
        (0..len).filter(tied).count() as u64
    }
}

/// A box in feature space.
pub(super) struct Cell {
    pub(super) middle: Point,
    pub(super) half: Point,
}

impl Cell {
    pub(super) fn of_brick(frame: &Frame, brick: &Brick) -> Self {
        let end = |a: usize, at: u8| frame.axes[a][brick.origin[a] + usize::from(at)];
        Self::between(
            std::array::from_fn(|a| [end(a, brick.low[a]), end(a, brick.high[a])]),
            brick.values.map(|v| frame.value(v)),
        )
    }

    pub(super) fn of_group<T: Scalar>(
        frame: &Frame,
        hierarchy: &Hierarchy<T>,
        brick: &Brick,
        group: usize,
    ) -> Self {
        let places = &hierarchy.group_places[brick.first_group + group];
        let end = |a: usize, at: u16| frame.axes[a][brick.origin[a] + usize::from(at)];
        Self::between(
            std::array::from_fn(|a| [end(a, places[a]), end(a, places[3 + a])]),
            hierarchy.group_values[brick.first_group + group].map(|v| frame.value(v)),
        )
    }

    fn between([x, y, z]: [[f64; 2]; 3], values: [f64; 2]) -> Self {
        let sides = [x, y, z, values];
        Self {
            middle: sides.map(|[a, b]| 0.5 * (a + b)),
            // A negative slope turns the values round.
            half: sides.map(|[a, b]| 0.5 * (b - a).abs()),
        }
    }
}

/// Keeps the candidates that may be the nearest to some point of the box.
///
/// With `b` the nearest to the middle `m`, the excess `|p - c|² - |p - b|²` is linear in `p`; least in the box it is
/// `|m - c|² - |m - b|² - 2 Σ half |c - b|`.
fn prune(cell: &Cell, from: &[Candidate], into: &mut Vec<Candidate>) {
    into.clear();
    let mut best = (f64::INFINITY, from[0].at, from[0].id);
    for candidate in from {
        let far = distance(&cell.middle, &candidate.at);
        into.push(Candidate { far, ..*candidate });
        if far < best.0 {
            best = (far, candidate.at, candidate.id);
        }
    }
    let (least, nearest, id) = best;
    let size = |p: &Point| p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3];
    let base = least + size(&cell.half) + size(&cell.middle);
    into.retain(|candidate| {
        let spread: f64 = (0..4).map(|a| cell.half[a] * (candidate.at[a] - nearest[a]).abs()).sum();
        // Distances that overflowed compare false, and stay.
        let beyond = candidate.far - least - 2.0 * spread > DOUBT * (candidate.far + base);
        candidate.id == id || !beyond
    });
}
