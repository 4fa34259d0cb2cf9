//! Distances between two surfaces, measured by dense sampling and an exhaustive search: the plain twin of the bound.

use ivd_core::Lattice;
use nalgebra::Vector3;

type Point = Vector3<f64>;

/// Triangles by the cells of a grid that their boxes meet.
struct Cells<'a> {
    places: &'a [Point],
    triangles: &'a [[u32; 3]],
    size: f64,
    low: Point,
    dims: [i64; 3],
    lists: Vec<Vec<usize>>,
}

impl<'a> Cells<'a> {
    fn new(places: &'a [Point], triangles: &'a [[u32; 3]], size: f64) -> Self {
        let (low, high) = places.iter().fold((places[0], places[0]), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        let dims: [i64; 3] = ((high - low) / size).map(|c| c as i64 + 1).into();
        let lists = vec![Vec::new(); dims.iter().product::<i64>() as usize];
        let mut grid = Self { places, triangles, size, low, dims, lists };
        for (t, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|v| places[v as usize]);
            let (lo, hi) = (grid.cell(a.inf(&b).inf(&c)), grid.cell(a.sup(&b).sup(&c)));
            for z in lo[2]..=hi[2] {
                for y in lo[1]..=hi[1] {
                    for x in lo[0]..=hi[0] {
                        grid.lists[(x + dims[0] * (y + dims[1] * z)) as usize].push(t);
                    }
                }
            }
        }
        grid
    }

    fn cell(&self, p: Point) -> [i64; 3] {
        ((p - self.low) / self.size).map(|c| c.floor() as i64).into()
    }

    /// Looks through the cells shell by shell round the point's own, which may lie outside.
    fn distance(&self, p: Point) -> f64 {
        let home = self.cell(p);
        let mut best = f64::INFINITY;
        for shell in 0_i64.. {
            // Whatever lies in this shell or beyond is further away than all but one of the shells within.
            if best <= (shell - 1) as f64 * self.size {
                break;
            }
            let range = |a: usize| (home[a] - shell).max(0)..=(home[a] + shell).min(self.dims[a] - 1);
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        let off = (x - home[0]).abs().max((y - home[1]).abs()).max((z - home[2]).abs());
                        if off == shell {
                            for &t in &self.lists[(x + self.dims[0] * (y + self.dims[1] * z)) as usize] {
                                best = best.min(self.to_triangle(p, t));
                            }
                        }
                    }
                }
            }
        }
        best
    }

    fn to_triangle(&self, p: Point, t: usize) -> f64 {
        let corners = self.triangles[t].map(|v| self.places[v as usize]);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let inside = (0..3).all(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            normal.dot(&(b - a).cross(&(p - a))) >= 0.0
        });
        if inside {
            return normal.dot(&(p - corners[0])).abs() / normal.norm();
        }
        (0..3).map(|i| to_segment(p, corners[i], corners[(i + 1) % 3])).fold(f64::INFINITY, f64::min)
    }
}

fn to_segment(p: Point, a: Point, b: Point) -> f64 {
    let along = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
    (a + (b - a) * along - p).norm()
}

/// Points of every triangle, at two thirds of the grid's spacing or finer.
fn samples(places: &[Point], triangles: &[[u32; 3]], spacing: f64) -> Vec<Point> {
    let mut points = Vec::new();
    for t in triangles {
        let [a, b, c] = t.map(|v| places[v as usize]);
        let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
        let n = (1.5 * longest / spacing).ceil().max(2.0) as usize;
        for i in 0..=n {
            for j in 0..=n - i {
                let (s, u) = (i as f64 / n as f64, j as f64 / n as f64);
                points.push(a * (1.0 - s - u) + b * s + c * u);
            }
        }
    }
    points
}

/// Largest distance (mm) of a sampled point of either surface from the other, and the mean of the worse direction.
pub(crate) fn hausdorff_and_mean(a: &Lattice, b: &Lattice) -> (f64, f64) {
    let spacing = a.grid().longest_edge();
    let (pa, pb) = (a.local_positions(), b.local_positions());
    let one_sided = |from: &[Point], of: &[[u32; 3]], to: &[Point], onto: &[[u32; 3]]| {
        let cells = Cells::new(to, onto, spacing);
        let points = samples(from, of, spacing);
        let off: Vec<f64> = points.iter().map(|&p| cells.distance(p)).collect();
        (off.iter().copied().fold(0.0, f64::max), off.iter().sum::<f64>() / off.len() as f64)
    };
    let there = one_sided(&pa, a.triangles(), &pb, b.triangles());
    let back = one_sided(&pb, b.triangles(), &pa, a.triangles());
    (there.0.max(back.0), there.1.max(back.1))
}

/// Mean distance (mm) of the points of a surface from the other, each triangle's points standing for its area, and the worse
/// direction.
pub(crate) fn mean_by_area(a: &Lattice, b: &Lattice) -> f64 {
    let spacing = a.grid().longest_edge();
    let (pa, pb) = (a.local_positions(), b.local_positions());
    let one_sided = |from: &[Point], of: &[[u32; 3]], to: &[Point], onto: &[[u32; 3]]| {
        let cells = Cells::new(to, onto, spacing);
        let (mut sum, mut whole) = (0.0, 0.0);
        for t in of {
            let [p, q, r] = t.map(|v| from[v as usize]);
            let (u, v) = (q - p, r - p);
            let n = (2.0 * u.norm().max(v.norm()).max((r - q).norm()) / spacing).ceil().max(2.0) as usize;
            let area = u.cross(&v).norm() / (2 * n * n) as f64;
            // The middles of n² equal triangles, those that stand on their base and those between.
            for i in 0..n {
                for j in 0..n - i {
                    for third in [1.0 / 3.0, 2.0 / 3.0] {
                        if third > 0.5 && i + j + 2 > n {
                            continue;
                        }
                        let at =
                            p + u * ((i as f64 + third) / n as f64) + v * ((j as f64 + third) / n as f64);
                        sum += area * cells.distance(at);
                        whole += area;
                    }
                }
            }
        }
        sum / whole
    };
    one_sided(&pa, a.triangles(), &pb, b.triangles()).max(one_sided(&pb, b.triangles(), &pa, a.triangles()))
}
