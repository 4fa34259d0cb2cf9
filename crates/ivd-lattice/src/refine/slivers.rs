//! Slivers, removed by half-edge collapse.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use ivd_core::{Exec, Lattice};
use nalgebra::Vector3;

use super::deviation::Deviation;
use super::half_edge::{Limits, check_shape};
use super::locks::Locks;
use super::mesh::Mesh;
use super::shared::GONE;
use super::star::{Fan, HUB};
use crate::Error;

/// Triangles between two looks at whether to stop.
const LOOKS: usize = 256;

/// What a sliver is and how it may be removed.
pub(super) struct Slivers {
    /// Largest longest side over least height; infinite for no limit.
    pub(super) max_aspect: f64,
    /// Least height (mm).
    pub(super) min_height_mm: f64,
    /// Largest distance from the input allowed, both ways (mm).
    pub(super) max_error_mm: f64,
    /// Least cosine between a triangle's normals before and after.
    pub(super) turn_cosine: f64,
}

/// What came of it.
pub(super) struct WithoutSlivers {
    /// Vertices left, ascending.
    pub(super) kept: Vec<u32>,
    /// Triangles left, in the input's numbers.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) found: u64,
    pub(super) left: u64,
    /// Bound on the distance from the input, both ways (mm).
    pub(super) max_error_mm: f64,
}

impl Slivers {
    /// Removes slivers, the worst first, ties by index; each by the shortest collapse of one of its corners that is legal,
    /// leaves the worst triangle round the vertex better than it was, and stays within the error.
    pub(super) fn remove(&self, lattice: &Lattice, exec: &Exec) -> Result<WithoutSlivers, Error> {
        let triangles = lattice.triangles().len();
        let queue = QUEUE_BYTES * most_queued(triangles) as u64 + lattice.keys().len() as u64;
        exec.check_memory("the surface to be repaired and its slivers", Mesh::bytes_for(lattice) + queue)?;
        let mesh = Mesh::new(lattice, Locks::NONE, None);
        let mut free = vec![false; mesh.positions.len()];
        for &v in &mesh.free {
            free[v as usize] = true;
        }
        let queued = vec![0; triangles];
        let mut work = Work { limits: self, mesh, free, queue: BinaryHeap::new(), queued };
        for t in 0..triangles as u32 {
            work.push(t);
        }
        let found = work.queue.len() as u64;
        work.run(exec)?;
        let mesh = &work.mesh;
        let is_left = |&&t: &&[u32; 3]| t != GONE && self.badness(mesh, t) > 1.0;
        Ok(WithoutSlivers {
            left: mesh.triangles.iter().filter(is_left).count() as u64,
            kept: mesh.left(),
            triangles: mesh.triangles.iter().copied().filter(|t| *t != GONE).collect(),
            found,
            max_error_mm: mesh.max_bound(),
        })
    }

    /// How far a triangle exceeds the limits: above 1 it is a sliver.
    fn badness(&self, mesh: &Mesh, corners: [u32; 3]) -> f64 {
        self.badness_of(corners.map(|v| mesh.positions[v as usize]))
    }

    fn badness_of(&self, [a, b, c]: [Vector3<f64>; 3]) -> f64 {
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        let height = (b - a).cross(&(c - a)).norm() / longest;
        if height > 0.0 {
            (longest / height / self.max_aspect).max(self.min_height_mm / height)
        } else {
            f64::INFINITY
        }
    }
}

struct Work<'a> {
    limits: &'a Slivers,
    mesh: Mesh,
    /// Whether each vertex may go.
    free: Vec<bool>,
    /// Badness as bits, triangle.
    queue: BinaryHeap<(u64, Reverse<u32>)>,
    /// Badness that each triangle waits with; 0 where it doesn't. Another entry is out of date.
    queued: Vec<u64>,
}

/// Entries of the queue at most: those that are out of date go when it is full.
fn most_queued(triangles: usize) -> usize {
    2 * triangles + LOOKS
}

/// Bytes of an entry, with room to grow, and of what each triangle waits with.
const QUEUE_BYTES: u64 = 40;

impl Work<'_> {
    fn run(&mut self, exec: &Exec) -> Result<(), Error> {
        let (mut fan, mut deviation) = (Fan::new(), Deviation::new());
        let mut looked = 0_usize;
        while let Some((bits, Reverse(t))) = self.queue.pop() {
            if looked.is_multiple_of(LOOKS) {
                exec.check_cancelled()?;
            }
            looked += 1;
            // Triangles that have changed since were queued anew.
            if self.queued[t as usize] != bits {
                continue;
            }
            self.queued[t as usize] = 0;
            let corners = self.mesh.triangles[t as usize];
            let [a, b, c] = corners;
            let mut ways = [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]];
            let length = |w: &[u32; 2]| {
                let [u, y] = w.map(|v| self.mesh.positions[v as usize]);
                (u - y).norm()
            };
            ways.sort_by(|x, y| length(x).total_cmp(&length(y)).then(x.cmp(y)));
            let ways = ways.iter().filter(|w| self.free[w[0] as usize]).copied().collect::<Vec<_>>();
            ways.into_iter().any(|way| self.collapse(way, &mut fan, &mut deviation));
        }
        Ok(())
    }

    /// Queues a triangle if it is a sliver.
    fn push(&mut self, t: u32) {
        let corners = self.mesh.triangles[t as usize];
        let badness = if corners == GONE { 0.0 } else { self.limits.badness(&self.mesh, corners) };
        let bits = if badness > 1.0 { badness.to_bits() } else { 0 };
        if bits == std::mem::replace(&mut self.queued[t as usize], bits) || bits == 0 {
            return;
        }
        self.queue.push((bits, Reverse(t)));
        if self.queue.len() > most_queued(self.queued.len()) {
            let queued = &self.queued;
            self.queue.retain(|(bits, Reverse(t))| queued[*t as usize] == *bits);
        }
    }

    /// Collapses `u` onto `y` if that is legal and makes things better.
    fn collapse(&mut self, [u, y]: [u32; 2], fan: &mut Fan, deviation: &mut Deviation) -> bool {
        let mesh = &self.mesh;
        if !mesh.read(u, fan) {
            return false;
        }
        fan.turn_to(y);
        let from = &mesh.positions[u as usize];
        let (ring, places) = (fan.ring(), fan.places());
        let k = ring.len();
        let (turn_cosine, bound) = (self.limits.turn_cosine, self.limits.max_error_mm);
        let limits = Limits { turn_cosine, bound, edge_squared: f64::INFINITY };
        if !mesh.links([u, y], ring) || check_shape(from, places, &limits).is_err() {
            return false;
        }
        let worst = |triangles: &mut dyn Iterator<Item = [Vector3<f64>; 3]>| {
            triangles.map(|t| self.limits.badness_of(t)).fold(0.0, f64::max)
        };
        let before = worst(&mut (0..k).map(|i| [*from, places[i], places[(i + 1) % k]]));
        let after = worst(&mut (1..k - 1).map(|i| [places[0], places[i], places[i + 1]]));
        let old = fan.triangles().iter().map(|&t| mesh.bounds[t as usize]);
        let bounds = deviation.bounds_after(from, places, old);
        let largest = bounds.iter().copied().fold(0.0, f32::max);
        if after >= before || f64::from(largest) > limits.bound {
            return false;
        }
        let patch: Vec<[u8; 3]> = (1..k as u8 - 1).map(|i| [0, i, i + 1]).collect();
        self.mesh.replace(u, fan, &patch, bounds, y);
        // What couldn't go before may now; round a hub only what has changed.
        let stars = ring.iter().map(|&r| self.mesh.star_of(r)).filter(|star| star.len() <= HUB);
        let mut around: Vec<u32> = stars.flatten().chain(fan.triangles()).copied().collect();
        around.sort_unstable();
        around.dedup();
        for t in around {
            self.push(t);
        }
        true
    }
}
