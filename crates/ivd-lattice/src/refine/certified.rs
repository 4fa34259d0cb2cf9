//! The distance between two meshes, both ways, between proven bounds.
//!
//! The distance from a triangle `t` is a convex function of the point, so that over a triangle `T` it is largest in a corner
//! of `T`: the largest distance of the points of `T` from the mesh that has `t` is at most the largest of the three. The
//! least of these over a few candidates `t` bounds `T` from above; the exact distance of any point from the nearest triangle
//! bounds the maximum from below. A triangle whose upper bound exceeds what is known from below by more than the tolerance
//! is divided, and its parts are judged in its place (Tang, Lee & Kim 2009; Guthe, Borodin & Klein 2005).
//!
//! A large part is halved. A part as small as its candidate is cut along the plane through a side of the candidate that it
//! overhangs, perpendicular to the candidate: of two surfaces that lie in one plane the parts then end in one triangle
//! each, where halving would go on for ever along every side.

use ivd_core::{Exec, Lattice};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::tree::{Near, Tree};
use crate::Error;

type Point = Vector3<f64>;

/// How much the upper bound may exceed the lower one.
const TOLERANCE: f64 = 1.0 / 32.0;
/// A distance that isn't looked into any further, as a share of the diagonal of both meshes' box.
const TINY: f64 = 1e-9;
/// What rounding may add to a distance, as a share of the diagonal.
const ROUNDING: f64 = 1e-13;
/// Cuts of a part in a row before it is halved.
const CUTS: u8 = 6;
/// Divisions of a triangle after which its part is left with the bound that it has.
const DEPTH: u8 = 96;
/// Points of a surface at which the mean is taken, for each triangle of both; at least the first of [`SAMPLES`], and at most
/// hardly more than the second.
const DENSITY: usize = 4;
/// Least and largest number of points.
const SAMPLES: [usize; 2] = [1 << 10, 1 << 16];
/// Triangles summed as one piece: sums don't depend on the number of threads.
const PIECE: usize = 1024;

/// Distances between two meshes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distances {
    /// Upper bound on the Hausdorff distance (mm): no point of either surface is further from the other.
    pub max_mm: f64,
    /// Lower bound on it (mm): some point of one of them is as far from the other.
    pub least_max_mm: f64,
    /// Mean distance (mm) of the points of a surface from the other, the larger of both ways. Found by sampling.
    pub mean_mm: f64,
}

impl Distances {
    const NONE: Self = Self { max_mm: 0.0, least_max_mm: 0.0, mean_mm: 0.0 };
    const INFINITE: Self =
        Self { max_mm: f64::INFINITY, least_max_mm: f64::INFINITY, mean_mm: f64::INFINITY };
}

/// Bounds on the Hausdorff distance between the surfaces of two lattices, and the mean distance.
///
/// The upper bound exceeds the lower by a thirty-second at most, and by 10⁻⁹ of the diagonal of both lattices' box. (Parts of
/// a surface that were divided 96 times keep what was found; none of the tests does so.) Vertices that no triangle names
/// don't count. From a surface without triangles to one with some the distance is infinite, and between two without any
/// it is 0. The result is the same for any number of threads.
///
/// After Tang, Lee & Kim 2009 and Guthe, Borodin & Klein 2005.
///
/// # Errors
/// [`ivd_core::Error::Inconsistent`] for a lattice whose parts don't fit, [`ivd_core::Error::MemoryLimit`],
/// [`ivd_core::Error::Cancelled`].
pub fn distances(a: &Lattice, b: &Lattice, exec: &Exec) -> Result<Distances, Error> {
    exec.run(|| Ok(Pair::new(a, b, exec)?.distances(f64::INFINITY, exec)?.unwrap_or(Distances::INFINITE)))
}

/// The same, or nothing where the largest distance is sure to exceed `limit` (mm), or can't be proven not to.
///
/// Call it within [`Exec::run`].
pub(super) fn distances_within(
    a: &Lattice,
    b: &Lattice,
    limit: f64,
    exec: &Exec,
) -> Result<Option<Distances>, Error> {
    Pair::new(a, b, exec)?.distances(limit, exec)
}

/// A lower bound on the Hausdorff distance (mm) that is hardly less: what the corners and middles of the triangles are away.
///
/// Call it within [`Exec::run`].
pub(super) fn least_distance(a: &Lattice, b: &Lattice, exec: &Exec) -> Result<f64, Error> {
    let pair = Pair::new(a, b, exec)?;
    match pair.is_apart() {
        Some(distances) => Ok(distances.max_mm),
        None => Ok(pair.sampled(exec)?.1),
    }
}

/// Two meshes about the middle of their box.
struct Pair {
    meshes: [Mesh; 2],
    diagonal: f64,
}

struct Mesh {
    places: Vec<Point>,
    /// Triangles that the other mesh doesn't have.
    own: Vec<[u32; 3]>,
    /// All triangles.
    tree: Tree,
    /// Area of all triangles (mm²).
    area: f64,
}

impl Mesh {
    fn new(places: Vec<Point>, triangles: &[[u32; 3]], own: Vec<[u32; 3]>) -> Self {
        let tree = Tree::new(&places, triangles);
        let area = piecewise(triangles, |t| [area(&corners(&places, t)), 0.0])[0];
        Self { places, own, tree, area }
    }
}

fn corners(places: &[Point], triangle: &[u32; 3]) -> [Point; 3] {
    triangle.map(|v| places[v as usize])
}

fn area([a, b, c]: &[Point; 3]) -> f64 {
    0.5 * (b - a).cross(&(c - a)).norm()
}

fn sorted(mut t: [u64; 3]) -> [u64; 3] {
    t.sort_unstable();
    t
}

/// The triangles of `a` that `b` hasn't: no point of the others is away from `b`.
fn without_shared(a: &Lattice, b: &Lattice) -> Vec<[u32; 3]> {
    if a.grid() != b.grid() {
        return a.triangles().to_vec();
    }
    let mut known: Vec<[u64; 3]> =
        b.triangles().par_iter().map(|t| sorted(t.map(|v| b.keys()[v as usize].0))).collect();
    known.par_sort_unstable();
    let same_place = |v: u32| {
        let v = v as usize;
        b.vertex_at(a.keys()[v]).is_some_and(|w| a.places()[v] == b.places()[w as usize])
    };
    let shared = |t: &[u32; 3]| {
        known.binary_search(&sorted(t.map(|v| a.keys()[v as usize].0))).is_ok()
            && t.iter().all(|&v| same_place(v))
    };
    a.triangles().par_iter().filter(|t| !shared(t)).copied().collect()
}

impl Pair {
    fn new(a: &Lattice, b: &Lattice, exec: &Exec) -> Result<Self, Error> {
        let bytes = |l: &Lattice| {
            48 * l.keys().len() as u64 + Tree::bytes(l.triangles().len()) + 36 * l.triangles().len() as u64
        };
        exec.check_memory("the distance between two lattices", bytes(a) + bytes(b))?;
        let shift = Point::from(b.grid().origin()) - Point::from(a.grid().origin());
        let (mut pa, mut pb) = (a.local_positions(), b.local_positions());
        for p in &mut pb {
            *p += shift;
        }
        let far = Point::repeat(f64::INFINITY);
        let [low, high] = pa.iter().chain(&pb).fold([far, -far], |[low, high], p| [low.inf(p), high.sup(p)]);
        let middle = (low + high) / 2.0;
        for p in pa.iter_mut().chain(&mut pb) {
            *p -= middle;
        }
        let mesh = |places, of: &Lattice, other| Mesh::new(places, of.triangles(), without_shared(of, other));
        let (a, b) = rayon::join(|| mesh(pa, a, b), || mesh(pb, b, a));
        Ok(Self { meshes: [a, b], diagonal: (high - low).norm() })
    }

    /// The distances where a mesh has no triangles.
    fn is_apart(&self) -> Option<Distances> {
        match self.meshes.each_ref().map(|mesh| mesh.tree.is_empty()) {
            [true, true] => Some(Distances::NONE),
            [true, false] | [false, true] => Some(Distances::INFINITE),
            [false, false] => None,
        }
    }

    fn ways(&self) -> [Way<'_>; 2] {
        let [a, b] = &self.meshes;
        [Way { from: a, to: &b.tree }, Way { from: b, to: &a.tree }]
    }

    /// The nearest triangle to each vertex, either way, and what is known of the largest distance (mm) from below.
    fn sampled(&self, exec: &Exec) -> Result<(Vec<Vec<Near>>, f64), Error> {
        let (mut corners, mut lower) = (Vec::new(), 0.0_f64);
        for way in self.ways() {
            let (near, largest) = way.sample(exec);
            exec.check_cancelled()?;
            lower = lower.max(largest);
            corners.push(near);
        }
        Ok((corners, lower))
    }

    fn distances(&self, limit: f64, exec: &Exec) -> Result<Option<Distances>, Error> {
        if let Some(distances) = self.is_apart() {
            return Ok(Some(distances).filter(|d| d.max_mm < f64::INFINITY));
        }
        // What is known from below of either way serves both.
        let ways = self.ways();
        let (corners, lower) = self.sampled(exec)?;
        if lower > limit {
            return Ok(None);
        }
        let tiny = TINY * self.diagonal;
        let mut found = Found { upper: lower, lower };
        for (way, near) in ways.iter().zip(&corners) {
            found = found.or(way.bound(near, lower, tiny, exec));
            exec.check_cancelled()?;
        }
        // Surfaces that are one and the same have no distance; all others are given what rounding may add.
        let max_mm = if found.upper > 0.0 { found.upper + ROUNDING * self.diagonal } else { 0.0 };
        if max_mm > limit {
            return Ok(None);
        }
        let mean_mm = ways.iter().map(|way| way.mean(exec)).fold(0.0, f64::max);
        exec.check_cancelled()?;
        // The mean is sampled and can't exceed the bound.
        Ok(Some(Distances { max_mm, least_max_mm: found.lower, mean_mm: mean_mm.min(max_mm) }))
    }
}

/// One mesh and the tree of the other.
struct Way<'a> {
    from: &'a Mesh,
    to: &'a Tree,
}

/// Bounds on the largest distance (mm).
#[derive(Debug, Clone, Copy)]
struct Found {
    upper: f64,
    lower: f64,
}

impl Found {
    fn or(self, other: Self) -> Self {
        Self { upper: self.upper.max(other.upper), lower: self.lower.max(other.lower) }
    }
}

impl Way<'_> {
    /// The nearest triangle to each vertex, and the largest distance of a triangle's corner or middle.
    fn sample(&self, exec: &Exec) -> (Vec<Near>, f64) {
        let mesh = self.from;
        let mut used = vec![false; mesh.places.len()];
        for &v in mesh.own.iter().flatten() {
            used[v as usize] = true;
        }
        let nearest = |(p, &used): (&Point, &bool)| {
            let wanted = used && !exec.cancel.is_cancelled();
            if wanted { self.to.nearest(p, 0) } else { Near { triangle: 0, off: 0.0 } }
        };
        let near: Vec<Near> = mesh.places.par_iter().zip(&used).map(nearest).collect();
        let middle = |t: &[u32; 3]| {
            if exec.cancel.is_cancelled() {
                return 0.0;
            }
            let [a, b, c] = corners(&mesh.places, t);
            self.to.nearest(&((a + b + c) / 3.0), near[t[0] as usize].triangle).off
        };
        let ends = near.par_iter().map(|n| n.off).reduce(|| 0.0, f64::max);
        let middles = mesh.own.par_iter().map(middle).reduce(|| 0.0, f64::max);
        (near, ends.max(middles))
    }

    /// Bounds over all triangles. Each is searched by itself, so that the result depends on no order.
    fn bound(&self, near: &[Near], lower: f64, tiny: f64, exec: &Exec) -> Found {
        let none = Found { upper: 0.0, lower };
        self.from
            .own
            .par_iter()
            .map_init(Vec::new, |stack, t| {
                if exec.cancel.is_cancelled() {
                    return none;
                }
                let corners =
                    t.map(|v| Corner { place: self.from.places[v as usize], near: near[v as usize] });
                self.divide(Part { corners, cuts: 0, depth: 0 }, lower, tiny, stack)
            })
            .reduce(|| none, Found::or)
    }

    /// Bounds over one triangle, as tight as the tolerance asks where it can raise the maximum.
    fn divide(&self, whole: Part, lower: f64, tiny: f64, stack: &mut Vec<Part>) -> Found {
        let mut found = Found { upper: 0.0, lower };
        stack.clear();
        stack.push(whole);
        while let Some(part) = stack.pop() {
            let enough = |found: &Found| found.lower * (1.0 + TOLERANCE) + tiny;
            let (mut upper, mut candidate) = self.upper(&part, enough(&found));
            if upper > enough(&found) {
                // The triangle nearest to the middle is one more candidate, and its distance one more from below.
                let guess = self.to.nearest(&part.middle(), candidate);
                found.lower = found.lower.max(guess.off);
                let other =
                    part.corners.iter().map(|c| self.to.off(&c.place, guess.triangle)).fold(0.0, f64::max);
                if other < upper {
                    (upper, candidate) = (other, guess.triangle);
                }
            }
            if upper <= enough(&found) || part.depth == DEPTH {
                found.upper = found.upper.max(upper);
                continue;
            }
            let before = stack.len();
            self.split(&part, candidate, stack);
            for new in &stack[before..] {
                found.lower = new.corners.iter().map(|c| c.near.off).fold(found.lower, f64::max);
            }
        }
        found
    }

    /// An upper bound over a part, and the candidate that gives it. What is below `enough` is taken at once.
    fn upper(&self, part: &Part, enough: f64) -> (f64, u32) {
        let corners = &part.corners;
        let mut best = (f64::INFINITY, corners[0].near.triangle);
        for (i, corner) in corners.iter().enumerate() {
            let t = corner.near.triangle;
            if corners[..i].iter().any(|c| c.near.triangle == t) {
                continue;
            }
            let off = |c: &Corner| if c.near.triangle == t { c.near.off } else { self.to.off(&c.place, t) };
            let largest = corners.iter().map(off).fold(0.0, f64::max);
            if largest < best.0 {
                best = (largest, t);
            }
            if best.0 <= enough {
                return best;
            }
        }
        // No point of the part is further than this from its nearest corner.
        let off = corners.iter().map(|c| c.near.off).fold(0.0, f64::max);
        (best.0.min(off + part.longest().0 / 3.0_f64.sqrt()), best.1)
    }

    /// Divides a part that is bounded by a candidate, and pushes what it is divided into.
    fn split(&self, part: &Part, candidate: u32, stack: &mut Vec<Part>) {
        let (longest, side) = part.longest();
        let triangle = self.to.corners(candidate);
        let size = (0..3).map(|i| (triangle[(i + 1) % 3] - triangle[i]).norm()).fold(0.0, f64::max);
        if longest <= 2.0 * size
            && part.cuts < CUTS
            && let Some(levels) = overhang(&part.corners, triangle, 1e-9 * longest)
        {
            self.cut(part, levels, stack);
            return;
        }
        let [a, b, c] = [0, 1, 2].map(|i| part.corners[(side + i) % 3]);
        let middle = self.corner((a.place + b.place) / 2.0, a.near.triangle);
        let depth = part.depth + 1;
        stack.extend([[a, middle, c], [middle, b, c]].map(|corners| Part { corners, cuts: 0, depth }));
    }

    /// Cuts a part where its corners' levels pass 0.
    fn cut(&self, part: &Part, levels: [f64; 3], stack: &mut Vec<Part>) {
        let (mut beyond, mut within) = (Polygon::new(), Polygon::new());
        for i in 0..3 {
            let j = (i + 1) % 3;
            let (a, b) = (part.corners[i], part.corners[j]);
            if levels[i] >= 0.0 {
                beyond.push(a);
            }
            if levels[i] <= 0.0 {
                within.push(a);
            }
            if levels[i] * levels[j] < 0.0 {
                let along = levels[i] / (levels[i] - levels[j]);
                let new = self.corner(a.place + (b.place - a.place) * along, a.near.triangle);
                beyond.push(new);
                within.push(new);
            }
        }
        let (cuts, depth) = (part.cuts + 1, part.depth + 1);
        for polygon in [beyond, within] {
            stack.extend(polygon.triangles().map(|corners| Part { corners, cuts, depth }));
        }
    }

    fn corner(&self, place: Point, guess: u32) -> Corner {
        Corner { place, near: self.to.nearest(&place, guess) }
    }

    /// Mean distance (mm) over the surface.
    fn mean(&self, exec: &Exec) -> f64 {
        let mesh = self.from;
        let samples = (DENSITY * (mesh.own.len() + self.to.len())).clamp(SAMPLES[0], SAMPLES[1]);
        let step = mesh.own.len().div_ceil(samples).max(1);
        let some: Vec<[u32; 3]> = mesh.own.iter().step_by(step).copied().collect();
        let own = piecewise(&mesh.own, |t| [area(&corners(&mesh.places, t)), 0.0])[0];
        let density = if own > 0.0 { samples as f64 / own } else { 0.0 };
        let [sum, weight] = piecewise(&some, |t| {
            if exec.cancel.is_cancelled() {
                return [0.0; 2];
            }
            let triangle = corners(&mesh.places, t);
            let area = area(&triangle);
            let n = if step > 1 { 1.0 } else { (area * density).sqrt().ceil().max(1.0) };
            [area * self.mean_of(triangle, n as usize), area]
        });
        // What both meshes have is no distance away.
        if weight > 0.0 { sum / weight * own / mesh.area } else { 0.0 }
    }

    /// Mean distance of the middles of the `n²` equal parts of a triangle.
    fn mean_of(&self, [a, b, c]: [Point; 3], n: usize) -> f64 {
        let (u, v) = ((b - a) / n as f64, (c - a) / n as f64);
        let (mut sum, mut guess) = (0.0, 0);
        for i in 0..n {
            for j in 0..n - i {
                let upright = a + u * (i as f64 + 1.0 / 3.0) + v * (j as f64 + 1.0 / 3.0);
                let mut take = |p: Point| {
                    let near = self.to.nearest(&p, guess);
                    guess = near.triangle;
                    sum += near.off;
                };
                take(upright);
                if i + j + 1 < n {
                    take(upright + (u + v) / 3.0);
                }
            }
        }
        sum / (n * n) as f64
    }
}

/// Sums over triangles that don't depend on the number of threads.
fn piecewise(triangles: &[[u32; 3]], value: impl Fn(&[u32; 3]) -> [f64; 2] + Sync) -> [f64; 2] {
    let add = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
    let pieces: Vec<_> =
        triangles.par_chunks(PIECE).map(|piece| piece.iter().map(&value).fold([0.0; 2], add)).collect();
    pieces.into_iter().fold([0.0; 2], add)
}

/// Part of a triangle.
#[derive(Debug, Clone, Copy)]
struct Part {
    corners: [Corner; 3],
    /// Cuts since it was halved last.
    cuts: u8,
    depth: u8,
}

/// A point and what of the other mesh is nearest to it.
#[derive(Debug, Clone, Copy)]
struct Corner {
    place: Point,
    near: Near,
}

impl Part {
    fn middle(&self) -> Point {
        let [a, b, c] = &self.corners;
        (a.place + b.place + c.place) / 3.0
    }

    /// Length of the longest side (mm), and the corner that it begins in.
    fn longest(&self) -> (f64, usize) {
        let length = |i: usize| (self.corners[(i + 1) % 3].place - self.corners[i].place).norm();
        (1..3).fold((length(0), 0), |best, i| if length(i) > best.0 { (length(i), i) } else { best })
    }
}

/// Heights of the corners over the plane, perpendicular to a triangle, through that of its sides that they overhang the
/// most while others of them don't; `None` where there is no such side. Heights within `close` are 0.
fn overhang(corners: &[Corner; 3], triangle: &[Point; 3], close: f64) -> Option<[f64; 3]> {
    let normal = (triangle[1] - triangle[0]).cross(&(triangle[2] - triangle[0]));
    let mut best = None;
    let mut most = 0.0;
    for i in 0..3 {
        let Some(out) = (triangle[(i + 1) % 3] - triangle[i]).cross(&normal).try_normalize(0.0) else {
            continue;
        };
        let height = |c: &Corner| out.dot(&(c.place - triangle[i]));
        let levels = [0, 1, 2].map(|k| height(&corners[k])).map(|h| if h.abs() <= close { 0.0 } else { h });
        let (low, high) = levels.iter().fold((0.0_f64, 0.0_f64), |(low, high), &h| (low.min(h), high.max(h)));
        if low < 0.0 && high > most {
            (best, most) = (Some(levels), high);
        }
    }
    best
}

/// Three or four corners in order, or fewer.
struct Polygon {
    corners: [Option<Corner>; 4],
    len: usize,
}

impl Polygon {
    fn new() -> Self {
        Self { corners: [None; 4], len: 0 }
    }

    fn push(&mut self, corner: Corner) {
        self.corners[self.len] = Some(corner);
        self.len += 1;
    }

    fn triangles(self) -> impl Iterator<Item = [Corner; 3]> {
        let [first, rest @ ..] = self.corners;
        (0..2).filter_map(move |i| Some([first?, rest[i]?, rest[i + 1]?]))
    }
}

#[cfg(test)]
mod tests;
