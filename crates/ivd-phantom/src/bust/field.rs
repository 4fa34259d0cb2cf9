//! Signed distances of a few solids, and what joins, cuts and sculpts them. Lengths in mm; negative is inside.

/// A place in the bust's frame (mm on an adult): x to the right of the patient, y to the front, z to the head.
pub(super) type Point = [f64; 3];

/// An ellipsoid along the axes; an infinite radius makes an elliptic cylinder of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ellipsoid {
    pub(super) centre: Point,
    pub(super) radii: [f64; 3],
}

impl Ellipsoid {
    pub(super) const fn new(centre: Point, radii: [f64; 3]) -> Self {
        Self { centre, radii }
    }

    /// First-order distance: exact outside on the axes, right to first order near the surface, never deeper than the middle is.
    pub(super) fn distance(&self, p: Point) -> f64 {
        let q = from(p, self.centre);
        let r = norm([q[0] / self.radii[0], q[1] / self.radii[1], q[2] / self.radii[2]]);
        let slope = norm([
            q[0] / (self.radii[0] * self.radii[0]),
            q[1] / (self.radii[1] * self.radii[1]),
            q[2] / (self.radii[2] * self.radii[2]),
        ]);
        let deepest = -self.radii[0].min(self.radii[1]).min(self.radii[2]);
        if slope > 1e-9 { ((r - 1.0) * r / slope).max(deepest) } else { deepest }
    }
}

/// A ball swept along a line while its radius goes from the first to the second.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cone {
    pub(super) ends: [Point; 2],
    pub(super) radii: [f64; 2],
}

impl Cone {
    pub(super) const fn new(a: Point, radius_a: f64, b: Point, radius_b: f64) -> Self {
        Self { ends: [a, b], radii: [radius_a, radius_b] }
    }

    pub(super) fn distance(&self, p: Point) -> f64 {
        let (t, away) = along(self.ends, p);
        away - (self.radii[0] + (self.radii[1] - self.radii[0]) * t)
    }
}

/// Cones end to end through knots `[x, y, z, radius]`; where several are met the least distance counts.
pub(super) fn tube(knots: &[[f64; 4]], p: Point) -> f64 {
    let cone = |k: &[[f64; 4]]| {
        let [a, b] = [k[0], k[1]];
        Cone::new([a[0], a[1], a[2]], a[3], [b[0], b[1], b[2]], b[3]).distance(p)
    };
    knots.windows(2).map(cone).fold(f64::INFINITY, f64::min)
}

/// A box along the axes, its edges rounded by `round`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    pub(super) centre: Point,
    pub(super) half: [f64; 3],
    pub(super) round: f64,
}

impl Block {
    pub(super) const fn new(centre: Point, half: [f64; 3], round: f64) -> Self {
        Self { centre, half, round }
    }

    pub(super) fn distance(&self, p: Point) -> f64 {
        let q = from(p, self.centre);
        let over: [f64; 3] = std::array::from_fn(|a| q[a].abs() - self.half[a] + self.round);
        let outside = norm(over.map(|v| v.max(0.0)));
        outside + over[0].max(over[1]).max(over[2]).min(0.0) - self.round
    }
}

/// A round swelling of a surface (a hollow where `height` is negative), which ends where its reach does.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bump {
    pub(super) centre: Point,
    pub(super) reach: [f64; 3],
    pub(super) height: f64,
}

impl Bump {
    pub(super) const fn new(centre: Point, reach: [f64; 3], height: f64) -> Self {
        Self { centre, reach, height }
    }

    /// How far the surface is moved outwards at a place (mm).
    pub(super) fn lift(&self, p: Point) -> f64 {
        let q = from(p, self.centre);
        let r = [q[0] / self.reach[0], q[1] / self.reach[1], q[2] / self.reach[2]];
        self.height * hill(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    }
}

/// A swelling along a line through knots (a groove where `height` is negative).
#[derive(Debug, Clone, Copy)]
pub(super) struct Ridge {
    pub(super) knots: &'static [Point],
    pub(super) reach: f64,
    pub(super) height: f64,
}

impl Ridge {
    pub(super) const fn new(knots: &'static [Point], reach: f64, height: f64) -> Self {
        Self { knots, reach, height }
    }

    /// How far the surface is moved outwards at a place (mm).
    pub(super) fn lift(&self, p: Point) -> f64 {
        let away = |k: &[Point]| along([k[0], k[1]], p).1;
        let away = self.knots.windows(2).map(away).fold(f64::INFINITY, f64::min);
        self.height * hill((away / self.reach).powi(2))
    }
}

/// 1 at 0, 0 from 1 on, smooth between; of a squared ratio.
pub(super) fn hill(square: f64) -> f64 {
    let rest = (1.0 - square).max(0.0);
    rest * rest
}

/// Union whose edge is filled over a width of about `k` (polynomial smooth minimum, Quilez).
pub(super) fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

/// Intersection with its edge rounded over a width of about `k`.
pub(super) fn meet(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, -b, k)
}

/// `a` without `b`, the edge rounded over a width of about `k`.
pub(super) fn cut(a: f64, b: f64, k: f64) -> f64 {
    meet(a, -b, k)
}

/// |x| without its crease at 0: what is mirrored with it has no ridge on the midline.
pub(super) fn soft_abs(x: f64, width: f64) -> f64 {
    (x * x + width * width).sqrt() - width * (-x * x / (width * width)).exp() * 0.5
}

/// 0 at `low` and before, 1 at `high` and beyond, smooth between; `high` may be the lesser.
pub(super) fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Share of the way along a line, 0…1, and distance from there.
fn along(ends: [Point; 2], p: Point) -> (f64, f64) {
    let way = from(ends[1], ends[0]);
    let q = from(p, ends[0]);
    let t = (dot(q, way) / dot(way, way)).clamp(0.0, 1.0);
    (t, norm([q[0] - t * way[0], q[1] - t * way[1], q[2] - t * way[2]]))
}

pub(super) fn from(p: Point, origin: Point) -> Point {
    [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn norm(q: Point) -> f64 {
    dot(q, q).sqrt()
}
