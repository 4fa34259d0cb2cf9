//! Ward's agglomeration of regions that touch: always the two neighbours whose merge costs least.
//!
//! A heap holds, for every region, a bound on its cheapest merge. A merge looks at the new region's neighbours once and pushes
//! only what became a neighbour's cheapest. What got dearer keeps its old, lower bound and is looked at again when that comes
//! up (as in the generic algorithm of Müllner 2011, arXiv:1109.2378).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

const NONE: Key = Key { cost: u64::MAX, pair: u64::MAX };

/// A merge: its cost as ordered bits, then the lesser and the greater region. Ties go to the lesser regions.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    cost: u64,
    pair: u64,
}

#[derive(Clone, Copy)]
struct Region {
    count: f64,
    sum: f64,
    mean: f64,
    /// Itself, while it is a region.
    above: u32,
    /// The last look that met it.
    met: u32,
}

/// Regions with their neighbours. A region is named by the least of its members.
#[derive(Default)]
pub(super) struct Regions {
    all: Vec<Region>,
    /// Members of neighbouring regions, one or more for each.
    near: Vec<Vec<u32>>,
    cheapest: Vec<Key>,
    heap: BinaryHeap<Reverse<Key>>,
    look: u32,
    /// Rows of `near` that are done with.
    spare: Vec<Vec<u32>>,
}

/// What is merged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Merge {
    /// The least members of the two, the lesser first.
    pub(super) pair: [u32; 2],
    /// What it adds to the sum of squared deviations.
    pub(super) cost: f64,
}

impl Regions {
    pub(super) fn clear(&mut self) {
        self.all.clear();
        self.cheapest.clear();
        self.heap.clear();
        self.look = 0;
        self.spare.append(&mut self.near);
    }

    /// Adds a region of `count` values with their sum and the regions it touches (more may be told by [`Regions::touch`]).
    pub(super) fn add(&mut self, count: f64, sum: f64, near: &[u32]) {
        let above = self.all.len() as u32;
        self.all.push(Region { count, sum, mean: sum / count, above, met: 0 });
        let mut row = self.spare.pop().unwrap_or_default();
        row.clear();
        row.extend_from_slice(near);
        self.near.push(row);
    }

    /// Two regions touch.
    pub(super) fn touch(&mut self, a: u32, b: u32) {
        self.near[a as usize].push(b);
        self.near[b as usize].push(a);
    }

    /// The region that a member belongs to: [`ivd_core::sets::root`] where what leads to it lies beside the figures that are read next.
    #[inline]
    pub(super) fn root(&mut self, mut at: u32) -> u32 {
        loop {
            let above = self.all[at as usize].above;
            if above == at {
                return at;
            }
            let next = self.all[above as usize].above;
            self.all[at as usize].above = next;
            at = next;
        }
    }

    /// A member of one of two regions that touches the other.
    pub(super) fn between(&mut self, [a, b]: [u32; 2]) -> u32 {
        let (from, to) =
            if self.near[a as usize].len() <= self.near[b as usize].len() { (a, b) } else { (b, a) };
        let row = std::mem::take(&mut self.near[from as usize]);
        let found = row.iter().copied().find(|member| self.root(*member) == to);
        self.near[from as usize] = row;
        found.unwrap_or(to)
    }

    /// Merges until nothing touches or `merged` says to stop; it hears of each merge just before it is done.
    pub(super) fn run<E>(
        &mut self,
        mut merged: impl FnMut(&mut Self, Merge) -> Result<(), E>,
    ) -> Result<(), E> {
        self.cheapest.resize(self.all.len(), NONE);
        for region in 0..self.all.len() as u32 {
            if self.alive(region) {
                self.find(region, false);
            }
        }
        while let Some(Reverse(key)) = self.heap.pop() {
            let pair = [(key.pair >> 32) as u32, key.pair as u32];
            if pair.iter().all(|region| self.alive(*region)) && self.key(pair[0], pair[1]) == key {
                merged(self, Merge { pair, cost: f64::from_bits(key.cost) })?;
                self.merge(pair);
                continue;
            }
            for region in pair {
                if self.alive(region) && self.cheapest[region as usize] == key {
                    self.find(region, false);
                }
            }
        }
        Ok(())
    }

    /// Makes the regions that are left touch in the order of their means.
    pub(super) fn line_up(&mut self) -> usize {
        let mut left: Vec<u32> = (0..self.all.len() as u32).filter(|r| self.alive(*r)).collect();
        let mean = |r: &u32| self.all[*r as usize].mean;
        left.sort_by(|a, b| mean(a).total_cmp(&mean(b)).then(a.cmp(b)));
        left.windows(2).for_each(|w| self.touch(w[0], w[1]));
        left.len()
    }

    #[inline]
    fn alive(&self, region: u32) -> bool {
        self.all[region as usize].above == region
    }

    #[inline]
    fn key(&self, a: u32, b: u32) -> Key {
        let (x, y) = (&self.all[a as usize], &self.all[b as usize]);
        let difference = x.mean - y.mean;
        let cost = x.count * y.count / (x.count + y.count) * (difference * difference);
        Key { cost: cost.to_bits(), pair: u64::from(a.min(b)) << 32 | u64::from(a.max(b)) }
    }

    fn merge(&mut self, [low, high]: [u32; 2]) {
        let other = self.all[high as usize];
        let region = &mut self.all[low as usize];
        region.count += other.count;
        region.sum += other.sum;
        region.mean = region.sum / region.count;
        self.all[high as usize].above = low;
        let mut short = std::mem::take(&mut self.near[high as usize]);
        let long = &mut self.near[low as usize];
        if long.len() < short.len() {
            std::mem::swap(long, &mut short);
        }
        long.append(&mut short);
        self.find(low, true);
    }

    /// Looks for a region's cheapest merge, and forgets neighbours that are listed twice. Where the region is new, its
    /// neighbours hear of it.
    fn find(&mut self, region: u32, new: bool) {
        let mut row = std::mem::take(&mut self.near[region as usize]);
        self.look += 1;
        let mut cheapest = NONE;
        let mut kept = 0;
        for i in 0..row.len() {
            let other = self.root(row[i]);
            let look = self.look;
            if other == region || std::mem::replace(&mut self.all[other as usize].met, look) == look {
                continue;
            }
            row[kept] = row[i];
            kept += 1;
            let key = self.key(region, other);
            cheapest = cheapest.min(key);
            if new && key < self.cheapest[other as usize] {
                self.cheapest[other as usize] = key;
                self.heap.push(Reverse(key));
            }
        }
        row.truncate(kept);
        self.near[region as usize] = row;
        self.cheapest[region as usize] = cheapest;
        if cheapest != NONE {
            self.heap.push(Reverse(cheapest));
        }
    }
}
