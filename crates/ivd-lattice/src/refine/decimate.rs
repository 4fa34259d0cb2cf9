//! Decimation: vertices go in the order of their distance from the average plane round them, and the hole of each is
//! triangulated anew (Schroeder, Zarge & Lorensen 1992).
//!
//! **Classes.** *Simple*: one closed fan. *Interior edge*: two feature edges meet in it; it goes by its distance from the
//! line between their other ends, which becomes an edge. *Corner*, *boundary* and *complex* (on a border, on a non-manifold
//! edge, several fans) stay.
//!
//! **Hole.** The loop is split between two of its vertices along a plane through both that stands upright on the
//! average plane and has the one part of the loop on its one side and the rest on its other; of all such splits that with
//! the largest aspect ratio (least distance of a vertex from the plane as a share of the split's length) is taken; the
//! parts are split in turn. A split along an edge that exists elsewhere would pinch the surface and is none. A vertex
//! whose loop can't be split so stays, until something changes round it; so does one whose new triangles turn too far
//! from the old ones beside the same border, or have no area. When no other can go, such a loop is filled as a fan from
//! one of its vertices, as a half-edge collapse does.
//!
//! **Order.** On a saddle the average plane passes through the vertex, however far off its neighbours are. So a vertex whose
//! removal leads to a bound of more than [`BOUND_FACTOR`] times its distance waits as if that share of the bound were it.
//!
//! **Error.** [`Patch`] bounds each step both ways; bounds add up along a chain of steps as those of a collapse do.
//!
//! One thread does it, in one order: ties go by index.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use ivd_core::{Exec, Iteration, Lattice};
use nalgebra::Vector3;

use super::features::Kind;
use super::half_edge::{LEAST_HEIGHT, edge_squared};
use super::locks::Locks;
use super::mean::distances_seen;
use super::mesh::Mesh;
use super::params::RefineParams;
use super::patch::Patch;
use super::refusal::{Refusal, Refusals, Refused, StopReason};
use super::report::Refined;
use super::small_parts::SmallParts;
use super::star::Fan;
use crate::Error;

/// Least aspect ratio of a split. Marching cubes leaves short edges, and every split of a loop that has one passes close
/// to a vertex: at 0.05 most loops can't be split, and of a gyroid refined to a quarter the largest distance is ten times
/// as large. The best split is taken anyway.
const LEAST_ASPECT: f64 = 1e-3;
/// Bound that a removal may lead to, in distances from the average plane.
const BOUND_FACTOR: f64 = 4.0;
/// Splits tried for one vertex: a part that can't be split sends the search back, and loops of 48 have thousands of ways.
const TRIES: u32 = 256;
/// Vertices between two looks at whether to stop.
const LOOKS: usize = 256;
/// Name for the observer.
const TASK: &str = "decimate";

/// Refines a lattice by decimation; parameters, locks and lattice are checked.
pub(super) fn decimate(
    lattice: &Lattice,
    params: &RefineParams,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    exec.check_memory("the surface to be decimated", Mesh::bytes_for(lattice))?;
    exec.run(|| {
        let mesh = Mesh::new(lattice, locks, params.feature_degrees);
        let (removals, bound) = params.target.get().removals(mesh.positions.len(), mesh.triangles.len());
        let mut run = Decimation {
            stamps: vec![0; mesh.positions.len()],
            small: SmallParts::of(lattice, params),
            mesh,
            turn_cosine: params.max_turn_degrees.to_radians().cos(),
            bound,
            edge_squared: edge_squared(params),
            fans: false,
            queue: BinaryHeap::new(),
            fan: Fan::new(),
            hole: Hole::default(),
            patch: Patch::new(),
        };
        exec.observer().begin(TASK, removals.min(run.mesh.free.len()) as u64);
        let (stopped_by, refused, passes) = run.run(removals, exec)?;
        exec.observer().end(TASK);
        let seen = distances_seen(&run.mesh);
        exec.check_cancelled()?;
        Ok(run.mesh.outcome(seen, stopped_by, refused, passes).report(lattice))
    })
}

/// Distance as bits, vertex, stamp: an entry whose stamp isn't the vertex's is out of date.
type Entry = Reverse<(u64, u32, u32)>;

struct Decimation {
    mesh: Mesh,
    turn_cosine: f64,
    /// Largest bound allowed (mm).
    bound: f64,
    /// As in [`Limits`](super::half_edge::Limits).
    edge_squared: f64,
    /// Parts whose share the others don't make up for.
    small: Option<SmallParts>,
    /// Whether a loop that can't be split is filled as a fan.
    fans: bool,
    queue: BinaryHeap<Entry>,
    /// How often each vertex has been queued; a vertex that may not go has the largest.
    stamps: Vec<u32>,
    fan: Fan,
    hole: Hole,
    patch: Patch,
}

/// Stamp of a vertex that may not go.
const KEPT: u32 = u32::MAX;

impl Decimation {
    /// Removes at most `removals` vertices. A vertex that was refused is tried again when something changes round it, and
    /// once more when the queue is empty, at last by fans too: what is refused at the end can't go.
    fn run(&mut self, removals: usize, exec: &Exec) -> Result<(StopReason, Refused, u32), Error> {
        let free = std::mem::take(&mut self.mesh.free);
        self.stamps.fill(KEPT);
        for &v in &free {
            self.stamps[v as usize] = 0;
        }
        let (mut removed, mut passes) = (0, 0);
        let mut refusals = Refusals::new(self.stamps.len());
        while removed < removals {
            refusals.clear();
            passes += 1;
            let before = removed;
            for &v in free.iter().filter(|&&v| self.stamps[v as usize] != KEPT).collect::<Vec<_>>() {
                self.push(v);
            }
            let mut looked = 0_usize;
            while removed < removals
                && let Some(Reverse((key, v, stamp))) = self.queue.pop()
            {
                let allowed = self.small.as_ref().is_none_or(|small| small.allow(v));
                if stamp != self.stamps[v as usize] || !allowed {
                    continue;
                }
                if looked.is_multiple_of(LOOKS) {
                    exec.check_cancelled()?;
                }
                looked += 1;
                match self.remove(v, f64::from_bits(key)) {
                    Ok(()) => {
                        removed += 1;
                        self.small.iter_mut().for_each(|small| small.count([v].into_iter()));
                        refusals.note(v, None);
                    }
                    Err(Refusal::Bound(bound)) if f64::from(bound) <= self.bound => {
                        let later = f64::from(bound) / BOUND_FACTOR;
                        self.queue.push(Reverse((later.to_bits(), v, stamp)));
                    }
                    Err(refusal) => refusals.note(v, Some(refusal)),
                }
            }
            exec.observer().advance(TASK, (removed - before) as u64);
            let value = (self.mesh.triangles.len() - 2 * removed) as f64;
            exec.observer().iteration(Iteration { method: TASK, index: u64::from(passes), value });
            if removed == before && std::mem::replace(&mut self.fans, true) {
                break;
            }
        }
        let refused = self.mesh.kept + refusals.count();
        let stopped_by = if removed >= removals { StopReason::Target } else { refused.reason() };
        Ok((stopped_by, refused, passes))
    }

    /// Queues a vertex by its distance.
    fn push(&mut self, v: u32) {
        if self.mesh.read(v, &mut self.fan) {
            let distance = self.distance(v);
            self.stamps[v as usize] += 1;
            self.queue.push(Reverse((distance.to_bits(), v, self.stamps[v as usize])));
        }
    }

    /// Distance (mm) of the vertex of the fan from what will be in its place: the average plane, or the line of its crease.
    fn distance(&self, v: u32) -> f64 {
        let place = &self.mesh.positions[v as usize];
        if let Kind::Crease(ends) = self.mesh.features.kind(v) {
            let [a, b] = ends.map(|end| self.mesh.positions[end as usize]);
            let along = (b - a).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            let off = place - a;
            return (off - along * along.dot(&off)).norm();
        }
        let ring = self.fan.places();
        let (mut normal, mut centre, mut area) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        for (i, r) in ring.iter().enumerate() {
            let next = &ring[(i + 1) % ring.len()];
            let cross = (r - place).cross(&(next - place));
            let size = cross.norm();
            normal += cross;
            centre += (r + next - place * 2.0) * (size / 3.0);
            area += size;
        }
        match normal.try_normalize(0.0) {
            Some(normal) if area > 0.0 => normal.dot(&centre).abs() / area,
            _ => 0.0,
        }
    }

    /// Removes a vertex if its hole can be closed. A bound that is too large for the vertex's place in the queue (mm) is
    /// a refusal too.
    fn remove(&mut self, v: u32, place: f64) -> Result<(), Refusal> {
        if !self.mesh.read(v, &mut self.fan) {
            return Err(Refusal::Link);
        }
        let (mesh, fan) = (&self.mesh, &self.fan);
        let from = &mesh.positions[v as usize];
        let ring = fan.ring();
        if ring.len() == 3 && mesh.has_triangle([ring[0], ring[1], ring[2]], v) {
            return Err(Refusal::Speck);
        }
        let ends = crease_of(mesh, v, ring)?;
        let mut by_distance: Vec<usize> = (0..ring.len()).collect();
        let off = |at: usize| (fan.places()[at] - from).norm_squared();
        by_distance.sort_by(|&i, &j| off(i).total_cmp(&off(j)));
        let near = ring[by_distance[0]];
        let old: Vec<f32> = fan.triangles().iter().map(|&t| mesh.bounds[t as usize]).collect();
        self.hole.begin(from, fan.places(), self.turn_cosine);
        let from_hub = |at: &usize| self.fans && ends.is_none_or(|ends| ends.contains(at));
        let hubs = by_distance.into_iter().filter(from_hub).map(Some);
        let mut refusal = None;
        for way in std::iter::once(None).chain(hubs) {
            let filled = match way {
                None => self.hole.split(mesh, fan, ends),
                Some(hub) => self.hole.fan_from(mesh, fan, hub),
            };
            if let Err(why) = filled {
                refusal = refusal.or(Some(why));
                continue;
            }
            if self.hole.diagonals().any(|[a, b]| (b - a).norm_squared() > self.edge_squared) {
                refusal = refusal.or(Some(Refusal::Edge));
                continue;
            }
            let bounds = self.patch.bounds_after(from, fan.places(), &self.hole.triangles, &old);
            let largest = bounds.iter().copied().fold(0.0, f32::max);
            if f64::from(largest) > self.bound {
                refusal = Some(Refusal::Bound(largest));
                continue;
            }
            // Rounded as the key is: a vertex that waited for its bound has it now.
            if f64::from(largest) / BOUND_FACTOR > place {
                return Err(Refusal::Bound(largest));
            }
            let around = ring.to_vec();
            self.mesh.replace(v, &self.fan, &self.hole.triangles, bounds, near);
            self.renew(v, &around);
            return Ok(());
        }
        Err(refusal.unwrap_or(Refusal::Flip))
    }

    /// Queues what lies round a vertex that is gone.
    fn renew(&mut self, gone: u32, around: &[u32]) {
        self.stamps[gone as usize] = KEPT;
        for &r in around {
            if self.stamps[r as usize] != KEPT {
                self.push(r);
            }
        }
    }
}

/// Places in the ring, ascending, of the ends of a vertex's crease, if it is on one that may go on without it.
fn crease_of(mesh: &Mesh, v: u32, ring: &[u32]) -> Result<Option<[usize; 2]>, Refusal> {
    let Kind::Crease(ends) = mesh.features.kind(v) else { return Ok(None) };
    let [Some(a), Some(b)] = ends.map(|end| ring.iter().position(|&r| r == end)) else {
        return Err(Refusal::Feature);
    };
    let adjacent = mesh.has_edge(ring[a], ring[b]);
    if mesh.features.may_join(ends, adjacent) {
        Ok(Some([a.min(b), a.max(b)]))
    } else {
        Err(Refusal::Feature)
    }
}

/// The hole that a vertex leaves, and the triangles that fill it.
#[derive(Default)]
struct Hole {
    places: Vec<Vector3<f64>>,
    /// `2 area · n` of each old triangle.
    old: Vec<Vector3<f64>>,
    turn_cosine: f64,
    /// New triangles, in places of the ring.
    triangles: Vec<[u8; 3]>,
}

impl Hole {
    fn begin(&mut self, from: &Vector3<f64>, ring: &[Vector3<f64>], turn_cosine: f64) {
        self.places.clear();
        self.places.extend_from_slice(ring);
        self.old.clear();
        let k = ring.len();
        self.old.extend((0..k).map(|i| (ring[i] - from).cross(&(ring[(i + 1) % k] - from))));
        self.turn_cosine = turn_cosine;
        self.triangles.clear();
    }

    /// Fills the loop by splitting it, first along the crease between two of its places, if there is one.
    fn split(&mut self, mesh: &Mesh, fan: &Fan, ends: Option<[usize; 2]>) -> Result<(), Refusal> {
        let k = fan.ring().len();
        let Some([a, b]) = ends else { return self.fill(mesh, fan, &(0..k as u8).collect::<Vec<_>>()) };
        let one: Vec<u8> = (a..=b).map(|i| i as u8).collect();
        let other: Vec<u8> = (b..=a + k).map(|i| (i % k) as u8).collect();
        if one.len() == 2 || other.len() == 2 {
            // The crease moves onto an edge of the border.
            return self.fill(mesh, fan, &(0..k as u8).collect::<Vec<_>>());
        }
        if mesh.has_edge(fan.ring()[a], fan.ring()[b]) {
            return Err(Refusal::Link);
        }
        self.fill(mesh, fan, &one)?;
        self.fill(mesh, fan, &other)
    }

    /// Fills the loop as a fan from one of its places.
    fn fan_from(&mut self, mesh: &Mesh, fan: &Fan, hub: usize) -> Result<(), Refusal> {
        let k = self.places.len();
        let at = |step: usize| ((hub + step) % k) as u8;
        if (2..k - 1).any(|i| mesh.has_edge(fan.ring()[hub], fan.ring()[at(i) as usize])) {
            return Err(Refusal::Link);
        }
        self.triangles.clear();
        self.triangles.extend((1..k - 1).map(|i| [at(0), at(i), at(i + 1)]));
        // Every triangle of a fan has a side on the border.
        let well = self.triangles.iter().all(|t| self.is_well(*t, &Vector3::zeros()));
        if well { Ok(()) } else { Err(Refusal::Flip) }
    }

    /// Fills a loop, or says what speaks against it.
    fn fill(&mut self, mesh: &Mesh, fan: &Fan, part: &[u8]) -> Result<(), Refusal> {
        let k = self.places.len();
        let inside = part.windows(2).map(|w| (w[0], w[1])).chain([(part[part.len() - 1], part[0])]);
        let sum = inside
            .filter(|&(i, j)| (i as usize + 1) % k == j as usize)
            .map(|(i, _)| self.old[i as usize])
            .sum::<Vector3<f64>>();
        let Some(normal) = sum.try_normalize(0.0) else { return Err(Refusal::Flip) };
        let first = self.triangles.len();
        let mut search =
            Search { places: &self.places, ring: fan.ring(), mesh, normal, tries: TRIES, pinched: false };
        if !search.split(part, &mut self.triangles) {
            return Err(if search.pinched { Refusal::Link } else { Refusal::Flip });
        }
        let well = self.triangles[first..].iter().all(|t| self.is_well(*t, &normal));
        if well { Ok(()) } else { Err(Refusal::Flip) }
    }

    /// The new edges, in each direction.
    fn diagonals(&self) -> impl Iterator<Item = [&Vector3<f64>; 2]> {
        let k = self.places.len();
        let sides = self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let sides = sides.map(|side| side.map(usize::from));
        let is_new = move |[a, b]: &[usize; 2]| (a + 1) % k != *b && (b + 1) % k != *a;
        sides.filter(is_new).map(|side| side.map(|at| &self.places[at]))
    }

    /// Whether a new triangle has area and turns with the old ones: those on the same border, or else their mean.
    fn is_well(&self, corners: [u8; 3], mean: &Vector3<f64>) -> bool {
        let [a, b, c] = corners.map(|i| self.places[i as usize]);
        let (ab, bc, ca) = (b - a, c - b, a - c);
        let normal = ab.cross(&-ca);
        let longest = ab.norm_squared().max(bc.norm_squared()).max(ca.norm_squared());
        let size = normal.norm();
        if size <= LEAST_HEIGHT * longest {
            return false;
        }
        let k = self.places.len();
        let turns = |old: &Vector3<f64>| old.dot(&normal) >= self.turn_cosine * old.norm() * size;
        let mut on_border = false;
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let (from, to) = (corners[from] as usize, corners[to] as usize);
            if (from + 1) % k == to {
                on_border = true;
                if !turns(&self.old[from]) {
                    return false;
                }
            }
        }
        on_border || turns(mean)
    }
}

/// The search for a way to split a loop.
struct Search<'a> {
    places: &'a [Vector3<f64>],
    ring: &'a [u32],
    mesh: &'a Mesh,
    /// Normal of the average plane.
    normal: Vector3<f64>,
    /// Splits that may still be tried.
    tries: u32,
    /// Whether a split was passed over because its edge exists elsewhere.
    pinched: bool,
}

impl Search<'_> {
    /// Splits a loop into triangles, the best split first. Returns `false`, and leaves `out` as it was, if there is no way.
    fn split(&mut self, part: &[u8], out: &mut Vec<[u8; 3]>) -> bool {
        if let &[a, b, c] = part {
            out.push([a, b, c]);
            return true;
        }
        let mut splits: Vec<(f64, usize, usize)> = Vec::new();
        for i in 0..part.len() - 2 {
            let last = if i == 0 { part.len() - 1 } else { part.len() };
            splits.extend((i + 2..last).filter_map(|j| Some((self.aspect(part, i, j)?, i, j))));
        }
        splits.sort_by(|a, b| b.0.total_cmp(&a.0));
        let start = out.len();
        for (_, i, j) in splits {
            let [a, b] = [i, j].map(|at| self.ring[part[at] as usize]);
            if self.mesh.has_edge(a, b) {
                self.pinched = true;
                continue;
            }
            if self.tries == 0 {
                return false;
            }
            self.tries -= 1;
            let rest: Vec<u8> = part[j..].iter().chain(&part[..=i]).copied().collect();
            if self.split(&part[i..=j], out) && self.split(&rest, out) {
                return true;
            }
            out.truncate(start);
        }
        false
    }

    /// Aspect ratio of the split between two places of a loop, if it parts the loop and is wide enough.
    fn aspect(&self, part: &[u8], i: usize, j: usize) -> Option<f64> {
        let place = |at: usize| &self.places[part[at] as usize];
        let line = place(j) - place(i);
        let upright = self.normal.cross(&line).try_normalize(0.0)?;
        let mut least = f64::INFINITY;
        for at in (0..part.len()).filter(|&at| at != i && at != j) {
            let left = upright.dot(&(place(at) - place(i)));
            // Seen from outside the loop turns left: what comes between i and j lies to the right of the line.
            let off = if i < at && at < j { -left } else { left };
            least = least.min(off);
        }
        let aspect = least / line.norm();
        (aspect > LEAST_ASPECT).then_some(aspect)
    }
}
