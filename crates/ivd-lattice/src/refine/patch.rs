//! A bound on the distance between a closed fan and any other triangulation of its border.
//!
//! The map is that of [`Deviation`](super::deviation), with the diagonals of the new triangulation in the place of the
//! spokes of a fan: it leaves the border alone, sends the vertex `u` to the closest point of the new triangles, and each
//! edge `u r(i)` to a path from there to `r(i)` across the diagonals in between. The triangles of a polygon without inner
//! vertices hang together as a tree, so that there is one way; the two paths of an old triangle cross the same diagonals
//! until one of them has arrived. In between the map is linear, and its displacement largest at the crossings.

use nalgebra::Vector3;

use super::deviation::above;
use super::distance::{closest_approach, closest_on_segment, closest_on_triangle};
use super::star::MAX_VALENCE;

type Point = Vector3<f64>;

/// No triangle has this side.
const NOTHING: u8 = u8::MAX;

/// Room for the bounds of one triangulated loop.
pub(super) struct Patch {
    /// New triangle with the side from one local vertex to another.
    with_side: Vec<u8>,
    /// Towards the triangle that the vertex goes to: the triangle on the way, and the diagonal between.
    gates: Vec<(u8, [u8; 2])>,
    way: Vec<u8>,
    moved: Vec<f64>,
    bounds: Vec<f32>,
}

impl Patch {
    pub(super) fn new() -> Self {
        Self {
            with_side: Vec::new(),
            gates: Vec::new(),
            way: Vec::new(),
            moved: Vec::new(),
            bounds: Vec::new(),
        }
    }

    /// Bounds (mm) of the new triangles, rounded up.
    ///
    /// - `removed`: place of the vertex that goes; `ring`: places of its `k` neighbours in order.
    /// - `triangles`: a triangulation of the loop `0…k - 1` without further vertices, turning as the loop does.
    /// - `old`: bounds of the vertex's triangles; entry `i` is that of `(u, r(i), r(i+1))`.
    pub(super) fn bounds_after(
        &mut self,
        removed: &Point,
        ring: &[Point],
        triangles: &[[u8; 3]],
        old: &[f32],
    ) -> &[f32] {
        let k = ring.len();
        let (home, off) = nearest(removed, ring, triangles);
        self.find_ways(k, triangles, home);
        self.moved.clear();
        self.moved.resize(triangles.len(), 0.0);
        self.moved[home] = off;
        self.bounds.clear();
        self.bounds.resize(triangles.len(), 0.0);
        for (i, &bound) in old.iter().enumerate() {
            self.walk(i, (i + 1) % k, home);
            for &t in &self.way {
                self.bounds[t as usize] = self.bounds[t as usize].max(bound);
            }
            self.displace(i as u8, removed, ring);
        }
        for (bound, moved) in self.bounds.iter_mut().zip(&self.moved) {
            *bound = above(f64::from(*bound) + moved);
        }
        &self.bounds
    }

    /// For each triangle the next one on the way to `home`.
    fn find_ways(&mut self, k: usize, triangles: &[[u8; 3]], home: usize) {
        self.with_side.clear();
        self.with_side.resize(MAX_VALENCE * k, NOTHING);
        for (t, &[a, b, c]) in triangles.iter().enumerate() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                self.with_side[MAX_VALENCE * from as usize + to as usize] = t as u8;
            }
        }
        self.gates.clear();
        self.gates.resize(triangles.len(), (NOTHING, [0; 2]));
        self.way.clear();
        self.way.push(home as u8);
        while let Some(t) = self.way.pop() {
            let [a, b, c] = triangles[t as usize];
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let beyond = self.with_side[MAX_VALENCE * to as usize + from as usize];
                if beyond != NOTHING && self.gates[t as usize].0 != beyond {
                    self.gates[beyond as usize] = (t, [from, to]);
                    self.way.push(beyond);
                }
            }
        }
    }

    /// Lists the triangles from the one with border side `from to` to `home`, home last.
    fn walk(&mut self, from: usize, to: usize, home: usize) {
        let mut t = self.with_side[MAX_VALENCE * from + to];
        self.way.clear();
        self.way.push(t);
        while t as usize != home {
            t = self.gates[t as usize].0;
            self.way.push(t);
        }
    }

    /// Crosses the diagonals on the way from home to vertex `i`, which lies in the first triangle of the way.
    fn displace(&mut self, i: u8, removed: &Point, ring: &[Point]) {
        let end = &ring[i as usize];
        let mut along = 0.0_f64;
        for &t in self.way[..self.way.len() - 1].iter().rev() {
            let (before, [a, b]) = self.gates[t as usize];
            if a == i || b == i {
                break;
            }
            let (a, b) = (&ring[a as usize], &ring[b as usize]);
            along = along.max(closest_approach(removed, end, a, b));
            let x = removed + (end - removed) * along;
            let off = (x - a - (b - a) * closest_on_segment(&x, a, b)).norm();
            for t in [t, before] {
                self.moved[t as usize] = self.moved[t as usize].max(off);
            }
        }
    }
}

fn nearest(point: &Point, ring: &[Point], triangles: &[[u8; 3]]) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (t, corners) in triangles.iter().enumerate() {
        let off = (closest_on_triangle(point, corners.map(|c| &ring[c as usize])) - point).norm();
        if off < best.1 {
            best = (t, off);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::deviation::Deviation;
    use super::*;

    /// 0…1.
    fn noise(i: u64) -> f64 {
        ivd_core::noise::unit(0, i)
    }

    /// A random triangulation of a loop.
    fn triangulate(part: &[u8], seed: u64, out: &mut Vec<[u8; 3]>) {
        if part.len() < 3 {
            return;
        }
        let at = 1 + (noise(seed) * (part.len() - 2) as f64) as usize;
        out.push([part[0], part[at], part[part.len() - 1]]);
        triangulate(&part[..=at], seed * 2 + 1, out);
        triangulate(&part[at..], seed * 2 + 2, out);
    }

    fn farthest(from: &[[Point; 3]], to: &[[Point; 3]]) -> f64 {
        const N: usize = 16;
        let mut worst = 0.0_f64;
        for t in from {
            for i in 0..=N {
                for j in 0..=N - i {
                    let (s, u) = (i as f64 / N as f64, j as f64 / N as f64);
                    let p = t[0] * (1.0 - s - u) + t[1] * s + t[2] * u;
                    let off = |t: &[Point; 3]| (closest_on_triangle(&p, [&t[0], &t[1], &t[2]]) - p).norm();
                    worst = worst.max(to.iter().map(off).fold(f64::INFINITY, f64::min));
                }
            }
        }
        worst
    }

    #[test]
    fn the_bound_is_never_below_the_sampled_distance_and_a_fan_gets_what_a_fan_gets() {
        let (mut patch, mut deviation) = (Patch::new(), Deviation::new());
        let mut loose = 0.0_f64;
        for case in 0..400_u64 {
            let k = 3 + case as usize % 8;
            let height = [0.02, 0.3, 1.5][case as usize % 3];
            let of = |i: usize| 2.0 * noise(case * 64 + i as u64) - 1.0;
            let ring: Vec<_> = (0..k)
                .map(|i| {
                    let angle = (i as f64 + 0.3 * of(i)) * std::f64::consts::TAU / k as f64;
                    Point::new(angle.cos(), angle.sin(), height * of(20 + i))
                })
                .collect();
            let u = Point::new(of(40), of(41), of(42)) * 0.4;
            let part: Vec<u8> = (0..k as u8).collect();
            let mut triangles = Vec::new();
            triangulate(&part, case + 7, &mut triangles);
            assert_eq!(triangles.len(), k - 2);
            let bounds = patch.bounds_after(&u, &ring, &triangles, &vec![0.0; k]);
            let old: Vec<_> = (0..k).map(|i| [u, ring[i], ring[(i + 1) % k]]).collect();
            let new: Vec<_> = triangles.iter().map(|t| t.map(|c| ring[c as usize])).collect();
            let measured = farthest(&old, &new).max(farthest(&new, &old));
            let bound = f64::from(bounds.iter().copied().fold(0.0, f32::max));
            assert!(bound >= measured - 1e-12, "case {case}: {bound} below {measured}");
            loose = loose.max(bound / measured);
            for (t, b) in new.iter().zip(bounds) {
                assert!(f64::from(*b) >= farthest(&[*t], &old) - 1e-12, "case {case}");
            }
            let fan: Vec<_> = (1..k as u8 - 1).map(|i| [0, i, i + 1]).collect();
            let old: Vec<f32> = (0..k).map(|i| noise(i as u64) as f32).collect();
            let expected = deviation.bounds_after(&u, &ring, old.iter().copied());
            assert_eq!(patch.bounds_after(&u, &ring, &fan, &old), expected, "case {case}");
        }
        assert!(loose < 15.0, "loose by {loose}");
    }
}
