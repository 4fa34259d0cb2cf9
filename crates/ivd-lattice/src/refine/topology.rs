//! Collapses that change the topology, where no other can go.
//!
//! Any vertex that isn't locked may be pulled onto a neighbour, whatever else the two share. What the surface becomes is
//! the image of a simplicial map: edges may get four triangles and vertices several fans, but as many triangles run along
//! an edge one way as the other, so that an inside and an outside remain. Two triangles that come to lie on the same
//! vertices and face each other enclose nothing; both go, if each of their sides has a triangle left: so a tunnel or a
//! handle that has been pinched flat vanishes. What would leave a side without a triangle, put two triangles on the same
//! vertices that face the same way, or make a component vanish, is refused.
//!
//! **Error.** A vertex with one closed fan gets the bound of a collapse, which says nothing of the rest of the surface. For
//! any other star the linear map that pulls the vertex moves no point further than the vertex: every triangle of the star
//! adds that to its bound, and so do those that take up a triangle which became an edge. A point of a pair that goes
//! finds its border within the radius of the inscribed circle. Each step tells for every point of the old surface one of the
//! new, and of every point of the new one where it came from: bounds add up both ways.
//!
//! One thread does it, in one order: ties go by index.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use ivd_core::Exec;
use nalgebra::Vector3;

use super::deviation::{Deviation, above};
use super::features::Kind;
use super::half_edge::{LEAST_HEIGHT, Limits, check_shape};
use super::params::{RefineParams, Target};
use super::passes::Run;
use super::refusal::{Refusal, Refusals, Refused, StopReason};
use super::shared::GONE;
use super::star::{Fan, HUB};
use super::surface::{Surface, surface_bytes};
use crate::Error;

/// Vertices between two looks at whether to stop.
const LOOKS: usize = 256;
/// Name for the observer.
const TASK: &str = "pinch";

/// Goes on where other collapses ended, if the target isn't reached.
///
/// - `triangles_in`: triangles of the input; `passes_before`: passes so far.
pub(super) fn run(
    surface: &mut Surface,
    params: &RefineParams,
    triangles_in: usize,
    passes_before: u32,
    exec: &Exec,
) -> Result<Run, Error> {
    let vertices = surface.positions.len();
    let left = (0..vertices).filter(|&v| surface.is_left(v)).count();
    let keep = match params.target.get() {
        Target::Level(level) => {
            Keep::Vertices((vertices as f64 * 0.25_f64.powi(i32::from(level))).round() as usize)
        }
        Target::Ratio(ratio) => Keep::Triangles((triangles_in as f64 * ratio).round() as usize),
        Target::Count(count) => Keep::Triangles(count),
        Target::MaxError(_) => Keep::Vertices(0),
    };
    let bound = if let Target::MaxError(mm) = params.target.get() { mm } else { f64::INFINITY };
    exec.check_memory(
        "the surface whose tunnels are closed",
        surface_bytes(vertices, triangles_in) + bytes_for(vertices, surface.triangles.len()),
    )?;
    let stars: Vec<Vec<u32>> = (0..vertices).map(|v| surface.stars.of(v).to_vec()).collect();
    let mut pinching = Pinching {
        triangles: surface.triangles.len(),
        surface,
        stars,
        vertices: left,
        keep,
        shape_weight: params.shape_weight as f32,
        limits: Limits::new(params, bound),
        stamps: vec![0; vertices],
        queue: BinaryHeap::new(),
        fan: Fan::new(),
        deviation: Deviation::new(),
    };
    exec.observer().begin(TASK, left as u64);
    let (refused, passes) = pinching.run(exec)?;
    exec.observer().end(TASK);
    let stopped_by = if pinching.is_enough() { StopReason::Target } else { refused.reason() };
    surface.tidy(&[]);
    Ok(Run { stopped_by, refused, passes: passes_before + passes })
}

/// Bytes of the stars, which grow by doubling, and of the queue.
fn bytes_for(vertices: usize, triangles: usize) -> u64 {
    let star = (size_of::<Vec<u32>>() + size_of::<u32>()) as u64;
    (star + size_of::<Option<Refusal>>() as u64) * vertices as u64
        + 24 * triangles as u64
        + 24 * most_queued(vertices) as u64
}

/// Entries of the queue at most: those that are out of date go when it is full.
fn most_queued(vertices: usize) -> usize {
    2 * vertices + LOOKS
}

/// How much to keep.
#[derive(Clone, Copy)]
enum Keep {
    Vertices(usize),
    Triangles(usize),
}

struct Pinching<'a> {
    surface: &'a mut Surface,
    /// Triangles round each vertex, always up to date.
    stars: Vec<Vec<u32>>,
    /// Left.
    vertices: usize,
    triangles: usize,
    keep: Keep,
    shape_weight: f32,
    limits: Limits,
    stamps: Vec<u32>,
    /// Cost as bits, vertex, stamp: an entry whose stamp isn't the vertex's is out of date.
    queue: BinaryHeap<Reverse<(u32, u32, u32)>>,
    fan: Fan,
    deviation: Deviation,
}

/// Stamp of a vertex that may not go.
const KEPT: u32 = u32::MAX;

/// What a collapse does to the triangles.
#[derive(Default)]
struct Change {
    /// Triangles that become an edge.
    flat: Vec<u32>,
    /// Triangles that follow, and their new bounds (mm).
    moved: Vec<(u32, f32)>,
    /// Triangles that face each other: one that has moved and one that was there.
    pairs: Vec<[u32; 2]>,
    /// Triangles that take up the points of others, and the bound that these bring (mm).
    raised: Vec<(u32, f32)>,
}

impl Pinching<'_> {
    fn is_enough(&self) -> bool {
        match self.keep {
            Keep::Vertices(n) => self.vertices <= n,
            Keep::Triangles(n) => self.triangles <= n,
        }
    }

    fn run(&mut self, exec: &Exec) -> Result<(Refused, u32), Error> {
        self.stamps.fill(KEPT);
        for &v in &self.surface.free {
            self.stamps[v as usize] = 0;
        }
        let mut passes = 0;
        let mut refusals = Refusals::new(self.stamps.len());
        while !self.is_enough() {
            refusals.clear();
            passes += 1;
            let before = self.vertices;
            for v in 0..self.stamps.len() as u32 {
                self.push(v);
            }
            let mut looked = 0_usize;
            while !self.is_enough()
                && let Some(Reverse((_, v, stamp))) = self.queue.pop()
            {
                if stamp != self.stamps[v as usize] {
                    continue;
                }
                if looked.is_multiple_of(LOOKS) {
                    exec.check_cancelled()?;
                }
                looked += 1;
                match self.remove(v) {
                    Ok(()) => {
                        self.vertices -= 1;
                        refusals.note(v, None);
                    }
                    Err(refusal) => refusals.note(v, Some(refusal)),
                }
            }
            exec.observer().advance(TASK, (before - self.vertices) as u64);
            if self.vertices == before {
                break;
            }
        }
        Ok((self.surface.kept + refusals.count(), passes))
    }

    /// Queues a vertex, if it may go, by the cost of its cheapest collapse.
    fn push(&mut self, v: u32) {
        if self.stamps[v as usize] == KEPT {
            return;
        }
        // A hub stays as long as it is one.
        let hub = self.stars[v as usize].len() > HUB;
        let cost = if hub { Some(f32::INFINITY) } else { self.targets(v).first().map(|target| target.0) };
        let Some(cost) = cost else { return };
        self.stamps[v as usize] += 1;
        self.queue.push(Reverse((cost.to_bits(), v, self.stamps[v as usize])));
        if self.queue.len() > most_queued(self.stamps.len()) {
            let stamps = &self.stamps;
            self.queue.retain(|Reverse((_, v, stamp))| stamps[*v as usize] == *stamp);
        }
    }

    /// Neighbours that a vertex may go to, the cheapest first, ties by index.
    fn targets(&self, v: u32) -> Vec<(f32, u32)> {
        let from = &self.surface.positions[v as usize];
        let star = &self.stars[v as usize];
        let mut around: Vec<u32> = star.iter().flat_map(|&t| self.surface.triangles.corners(t)).collect();
        around.sort_unstable();
        around.dedup();
        let allowed = around.into_iter().filter(|&r| r != v && self.surface.features.allow(v, r));
        let cost =
            |r: u32| self.surface.cost(v, &(self.surface.positions[r as usize] - from), self.shape_weight);
        let mut targets: Vec<_> = allowed.map(|r| (cost(r), r)).collect();
        targets.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        targets
    }

    /// Collapses a vertex onto the cheapest neighbour that can be.
    fn remove(&mut self, u: u32) -> Result<(), Refusal> {
        let mut refusal = Refusal::Link;
        if self.stars[u as usize].len() > HUB {
            return Err(refusal);
        }
        for (_, y) in self.targets(u) {
            match self.plan(u, y) {
                Ok(change) => {
                    self.apply([u, y], &change);
                    return Ok(());
                }
                Err(why) => refusal = why,
            }
        }
        Err(refusal)
    }

    /// What the collapse of `u` onto `y` would do, if nothing speaks against it.
    fn plan(&mut self, u: u32, y: u32) -> Result<Change, Refusal> {
        if let Kind::Crease([a, b]) = self.surface.features.kind(u) {
            let other = if a == y { b } else { a };
            let adjacent = self.on_edge(y, other).next().is_some();
            if !self.surface.features.may_join([y, other], adjacent) {
                return Err(Refusal::Feature);
            }
        }
        let Self { fan, surface, stars, .. } = self;
        let star = stars[u as usize].iter().map(|&t| (t, surface.triangles.corners(t)));
        let closed = fan.gather(u, star);
        let mut change = if closed { self.pull_fan(u, y)? } else { self.pull_star(u, y)? };
        let corners = |t: u32| self.surface.triangles.corners(t);
        let place = |v: u32| &self.surface.positions[v as usize];
        for &(t, _) in &change.moved {
            let mut far =
                corners(t).into_iter().filter(|c| *c != u && !self.limits.allow_edge(place(*c), place(y)));
            if far.any(|c| self.on_edge(y, c).next().is_none()) {
                return Err(Refusal::Edge);
            }
            let moved = corners(t).map(|c| if c == u { y } else { c });
            let stars = moved.map(|c| &self.stars[c as usize]);
            let least = stars.into_iter().min_by_key(|star| star.len()).expect("there are three");
            let twin = least.iter().find(|&&other| {
                let there = corners(other);
                !there.contains(&u) && moved.iter().all(|c| there.contains(c))
            });
            if let Some(&twin) = twin {
                if turns_alike(moved, corners(twin)) {
                    return Err(Refusal::Link);
                }
                change.pairs.push([t, twin]);
            }
        }
        self.hand_on(&mut change, [u, y], closed)?;
        let all = change.moved.iter().chain(&change.raised);
        let largest = all.map(|c| c.1).fold(0.0, f32::max);
        if f64::from(largest) > self.limits.bound { Err(Refusal::Bound(largest)) } else { Ok(change) }
    }

    /// The collapse of a closed fan, which lies on the desk.
    fn pull_fan(&mut self, u: u32, y: u32) -> Result<Change, Refusal> {
        let Self { fan, surface, .. } = self;
        fan.locate(&surface.positions);
        fan.turn_to(y);
        let from = &surface.positions[u as usize];
        check_shape(from, fan.places(), &self.limits)?;
        let triangles = fan.triangles();
        let old = triangles.iter().map(|&t| surface.triangles.bound(t));
        let bounds = self.deviation.bounds_after(from, fan.places(), old);
        let moved = &triangles[1..triangles.len() - 1];
        Ok(Change {
            flat: vec![triangles[0], triangles[triangles.len() - 1]],
            moved: moved.iter().copied().zip(bounds.iter().copied()).collect(),
            ..Change::default()
        })
    }

    /// The collapse of any star: no point goes further than the vertex.
    fn pull_star(&self, u: u32, y: u32) -> Result<Change, Refusal> {
        let [from, to] = [u, y].map(|v| self.surface.positions[v as usize]);
        let length = (to - from).norm();
        let mut change = Change::default();
        for &t in &self.stars[u as usize] {
            let corners = self.surface.triangles.corners(t);
            if corners.contains(&y) {
                change.flat.push(t);
                continue;
            }
            let old = corners.map(|c| self.surface.positions[c as usize]);
            let new = corners.map(|c| if c == u { to } else { self.surface.positions[c as usize] });
            if !self.is_well(old, new) {
                return Err(Refusal::Flip);
            }
            change.moved.push((t, above(f64::from(self.surface.triangles.bound(t)) + length)));
        }
        Ok(change)
    }

    fn is_well(&self, [a, b, c]: [Vector3<f64>; 3], [p, q, r]: [Vector3<f64>; 3]) -> bool {
        let (old, new) = ((b - a).cross(&(c - a)), (q - p).cross(&(r - p)));
        let longest = (q - p).norm_squared().max((r - p).norm_squared()).max((r - q).norm_squared());
        let size = new.norm();
        size > LEAST_HEIGHT * longest && old.dot(&new) >= self.limits.turn_cosine * old.norm() * size
    }

    /// Finds triangles for what vanishes: a triangle that became an edge, and pairs that face each other.
    fn hand_on(&self, change: &mut Change, [u, y]: [u32; 2], closed: bool) -> Result<(), Refusal> {
        let bound = |t: u32| f64::from(self.surface.triangles.bound(t));
        let mut raised = Vec::new();
        // The map of a closed fan leaves nothing on an edge alone.
        for &t in change.flat.iter().filter(|_| !closed) {
            let corners = self.surface.triangles.corners(t);
            let length = (self.surface.positions[u as usize] - self.surface.positions[y as usize]).norm();
            let other = corners.into_iter().find(|c| ![u, y].contains(c)).ok_or(Refusal::Link)?;
            self.raise(change, [u, y], [y, other], above(bound(t) + length), &mut raised)?;
        }
        for &[t, twin] in &change.pairs {
            let own = change.moved.iter().find(|m| m.0 == t).map_or(0.0, |m| f64::from(m.1));
            let corners = self.surface.triangles.corners(twin);
            let bound = above(own.max(bound(twin)) + self.inradius(corners));
            let [a, b, c] = corners;
            for side in [[a, b], [b, c], [c, a]] {
                self.raise(change, [u, y], side, bound, &mut raised)?;
            }
        }
        change.raised = raised;
        Ok(())
    }

    /// Notes a bound for each triangle that will be left on an edge; there has to be one.
    fn raise(
        &self,
        change: &Change,
        [u, y]: [u32; 2],
        [a, b]: [u32; 2],
        bound: f32,
        raised: &mut Vec<(u32, f32)>,
    ) -> Result<(), Refusal> {
        let before = raised.len();
        let goes = |t: u32| change.flat.contains(&t) || change.pairs.iter().any(|p| p.contains(&t));
        raised.extend(self.on_edge(a, b).filter(|&t| !goes(t)).map(|t| (t, bound)));
        // Triangles that come to the edge with the vertex.
        for other in [a, b] {
            if [a, b].contains(&y) && other != y {
                raised.extend(self.on_edge(u, other).filter(|&t| !goes(t)).map(|t| (t, bound)));
            }
        }
        if raised.len() > before {
            return Ok(());
        }
        let speck = self.stars[u as usize].len() == 3;
        Err(if speck { Refusal::Speck } else { Refusal::Link })
    }

    fn on_edge(&self, a: u32, b: u32) -> impl Iterator<Item = u32> {
        let [star, other] = [a, b].map(|v| &self.stars[v as usize]);
        let (star, far) = if star.len() <= other.len() { (star, b) } else { (other, a) };
        star.iter().copied().filter(move |&t| self.surface.triangles.corners(t).contains(&far))
    }

    fn inradius(&self, corners: [u32; 3]) -> f64 {
        let [a, b, c] = corners.map(|v| self.surface.positions[v as usize]);
        let round = (b - a).norm() + (c - b).norm() + (a - c).norm();
        (b - a).cross(&(c - a)).norm() / round
    }

    fn apply(&mut self, [u, y]: [u32; 2], change: &Change) {
        let before: Vec<u32> =
            self.stars[u as usize].iter().flat_map(|&t| self.surface.triangles.corners(t)).collect();
        for &t in &change.flat {
            self.drop(t);
        }
        for &(t, bound) in &change.moved {
            self.surface.triangles.pull(t, u, y, bound);
            self.stars[y as usize].push(t);
        }
        self.stars[u as usize] = Vec::new();
        for &t in change.pairs.iter().flatten() {
            self.drop(t);
        }
        for &(t, bound) in &change.raised {
            self.surface.triangles.raise(t, bound);
        }
        self.surface.onto[u as usize].set(y);
        self.surface.features.join(u);
        self.surface.absorb(u);
        self.stamps[u as usize] = KEPT;
        // What couldn't go before may now; round a hub only what has changed.
        let mut around = before;
        if self.stars[y as usize].len() <= HUB {
            around = self.stars[y as usize].iter().flat_map(|&t| self.surface.triangles.corners(t)).collect();
        }
        around.extend(change.raised.iter().flat_map(|r| self.surface.triangles.corners(r.0)));
        around.sort_unstable();
        around.dedup();
        for v in around {
            self.push(v);
        }
    }

    fn drop(&mut self, t: u32) {
        let corners = self.surface.triangles.corners(t);
        debug_assert_ne!(corners, GONE);
        for c in corners {
            let star = &mut self.stars[c as usize];
            let at = star.iter().position(|&s| s == t).expect("stars are up to date");
            star.remove(at);
        }
        self.surface.triangles.remove(t);
        self.triangles -= 1;
    }
}

/// Whether two triangles on the same vertices turn the same way.
fn turns_alike([a, b, _]: [u32; 3], other: [u32; 3]) -> bool {
    (0..3).any(|i| other[i] == a && other[(i + 1) % 3] == b)
}
