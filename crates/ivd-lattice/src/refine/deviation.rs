//! A bound on the distance between a surface before and after a vertex is removed.
//!
//! Removing `u` by a collapse onto its neighbour `v` replaces the fan round `u` by a fan from `v` with the same border
//! `v = r0, r1, … r(k-1)`. A continuous map of the old fan onto the new one that leaves the border alone bounds the
//! distance both ways: it reaches every point of the new fan, because a map of a disc that is the identity on the border
//! does. This one is piecewise linear. It sends `u` to the closest point `y` of the new fan, say in the triangle `j`
//! between the spokes `r(j)` and `r(j+1)`, and each edge `u r(i)` to a path from `y` to `r(i)` that crosses the spokes
//! `v r(m)` in between, one after another. Where it crosses a spoke is free: the closest points of the edge and the spoke
//! are taken. Within the pieces the map is linear, so that its displacement is largest at their corners.
//!
//! Bounds add up along a chain of collapses: a triangle of the new fan takes the largest bound of the old triangles
//! whose images meet it, and adds the displacement within itself. (That distances of removed vertices alone are no bound
//! shows at the flipped diagonal of a bent quadrangle: no vertex is off the new surface, but the middle is.)

use nalgebra::Vector3;

use super::distance::{closest_approach, closest_on_segment, closest_on_triangle};
use super::star::MAX_VALENCE;

/// Room for the bounds of one fan.
pub(super) struct Deviation {
    moved: [f64; MAX_VALENCE],
    bounds: [f32; MAX_VALENCE],
}

impl Deviation {
    pub(super) fn new() -> Self {
        Self { moved: [0.0; MAX_VALENCE], bounds: [0.0; MAX_VALENCE] }
    }

    /// Bounds (mm) of the `k - 2` triangles `(v, r(i), r(i+1))`, `i` in `1..k - 1`, of the new fan, rounded up.
    ///
    /// - `removed`: place of the vertex that goes.
    /// - `ring`: places of its `k` neighbours in order, the one that it is collapsed onto first.
    /// - `old`: bounds of its triangles; entry `i` is that of `(u, r(i), r(i+1))`.
    pub(super) fn bounds_after(
        &mut self,
        removed: &Vector3<f64>,
        ring: &[Vector3<f64>],
        old: impl Iterator<Item = f32>,
    ) -> &[f32] {
        let k = ring.len();
        let home = self.displace(removed, ring);
        self.bounds[..k].fill(0.0);
        for (i, bound) in old.enumerate() {
            // The image of old triangle i runs from triangle `home` to the one with its side of the ring.
            let end = i.clamp(1, k - 2);
            for b in &mut self.bounds[end.min(home)..=end.max(home)] {
                *b = b.max(bound);
            }
        }
        for i in 1..k - 1 {
            self.bounds[i] = above(f64::from(self.bounds[i]) + self.moved[i]);
        }
        &self.bounds[1..k - 1]
    }

    /// Finds the largest displacement within each new triangle, and the triangle that the vertex goes to.
    fn displace(&mut self, removed: &Vector3<f64>, ring: &[Vector3<f64>]) -> usize {
        let k = ring.len();
        let moved = &mut self.moved[..k];
        moved.fill(0.0);
        let (home, off) = nearest_of_fan(removed, ring);
        moved[home] = off;
        for i in 1..k {
            // Spokes on the way from triangle `home` to vertex `i`, in the order of crossing.
            let mut along = 0.0_f64;
            let mut cross = |m: usize| {
                along = along.max(closest_approach(removed, &ring[i], &ring[0], &ring[m]));
                let x = removed + (ring[i] - removed) * along;
                let q = ring[0] + (ring[m] - ring[0]) * closest_on_segment(&x, &ring[0], &ring[m]);
                let off = (x - q).norm();
                moved[m - 1] = moved[m - 1].max(off);
                moved[m] = moved[m].max(off);
            };
            if i <= home {
                (i + 1..=home).rev().for_each(&mut cross);
            } else {
                (home + 1..i).for_each(&mut cross);
            }
        }
        home
    }
}

/// The least number in single precision that isn't below.
pub(super) fn above(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

/// The triangle `(r0, r(i), r(i+1))` of the new fan nearest to a point, and its distance.
fn nearest_of_fan(point: &Vector3<f64>, ring: &[Vector3<f64>]) -> (usize, f64) {
    let mut best = (1, f64::INFINITY);
    for i in 1..ring.len() - 1 {
        let off = (closest_on_triangle(point, [&ring[0], &ring[i], &ring[i + 1]]) - point).norm();
        if off < best.1 {
            best = (i, off);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds_after(u: &Vector3<f64>, ring: &[Vector3<f64>], old: &[f32]) -> Vec<f64> {
        let mut deviation = Deviation::new();
        deviation.bounds_after(u, ring, old.iter().copied()).iter().map(|&b| f64::from(b)).collect()
    }

    fn fan(apex: Vector3<f64>, ring: &[Vector3<f64>], closed: bool) -> Vec<[Vector3<f64>; 3]> {
        let k = ring.len();
        (usize::from(!closed)..k - usize::from(!closed)).map(|i| [apex, ring[i], ring[(i + 1) % k]]).collect()
    }

    fn samples(t: &[Vector3<f64>; 3]) -> impl Iterator<Item = Vector3<f64>> {
        const N: usize = 16;
        (0..=N)
            .flat_map(move |i| (0..=N - i).map(move |j| (i as f64 / N as f64, j as f64 / N as f64)))
            .map(|(s, u)| t[0] * (1.0 - s - u) + t[1] * s + t[2] * u)
    }

    fn one_sided(from: &[[Vector3<f64>; 3]], to: &[[Vector3<f64>; 3]]) -> f64 {
        let nearest = |p: Vector3<f64>| {
            to.iter()
                .map(|t| (closest_on_triangle(&p, [&t[0], &t[1], &t[2]]) - p).norm())
                .fold(f64::INFINITY, f64::min)
        };
        from.iter().flat_map(samples).map(nearest).fold(0.0, f64::max)
    }

    /// −1…1.
    fn noise(i: u64) -> f64 {
        2.0 * ivd_core::noise::unit(0, i) - 1.0
    }

    #[test]
    fn the_bound_is_never_below_the_sampled_distance_of_two_fans() {
        let mut worst = 0.0_f64;
        for case in 0..400 {
            let k = 3 + case as usize % 7;
            let height = [0.02, 0.3, 1.5][case as usize % 3];
            let ring: Vec<_> = (0..k)
                .map(|i| {
                    let angle =
                        (i as f64 + 0.3 * noise(case * 64 + i as u64)) * std::f64::consts::TAU / k as f64;
                    Vector3::new(angle.cos(), angle.sin(), height * noise(case * 64 + 20 + i as u64))
                })
                .collect();
            let u = Vector3::new(noise(case * 64 + 40), noise(case * 64 + 41), noise(case * 64 + 42)) * 0.4;
            let bounds = bounds_after(&u, &ring, &vec![0.0; k]);
            let bound = bounds.iter().copied().fold(0.0, f64::max);
            let (old, new) = (fan(u, &ring, true), fan(ring[0], &ring, false));
            let measured = one_sided(&old, &new).max(one_sided(&new, &old));
            assert!(bound >= measured - 1e-12, "case {case}: {bound} below {measured}");
            worst = worst.max(bound / measured);
            for (t, b) in new.iter().zip(&bounds) {
                let off = one_sided(&[*t], &old);
                assert!(*b >= off - 1e-12, "case {case}: a triangle's {b} below {off}");
            }
        }
        assert!(worst < 12.0, "loose by {worst}");
    }

    #[test]
    fn a_flat_fan_has_no_deviation_and_hands_its_bounds_on() {
        let ring: Vec<_> = (0..6)
            .map(|i| (i as f64 * std::f64::consts::FRAC_PI_3).sin_cos())
            .map(|(s, c)| Vector3::new(c, s, 0.0))
            .collect();
        let bounds = bounds_after(&Vector3::new(0.1, -0.05, 0.0), &ring, &[0.0, 0.0, 0.5, 0.0, 0.0, 0.0]);
        assert!((bounds.iter().copied().fold(0.0, f64::max) - 0.5).abs() < 1e-7);
    }

    #[test]
    fn a_bent_quadrangle_whose_diagonal_flips_is_not_without_deviation() {
        // u lies on the edge between r0 and r2: no vertex leaves the new surface.
        let ring = [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 1.0]].map(Vector3::from);
        let bounds = bounds_after(&Vector3::new(0.0, 0.0, 0.0), &ring, &[0.0; 4]);
        assert_eq!(bounds.iter().copied().fold(0.0, f64::max), 0.0, "here the crease stays");
        let turned = [ring[1], ring[2], ring[3], ring[0]];
        let bounds = bounds_after(&Vector3::new(0.0, 0.0, 0.0), &turned, &[0.0; 4]);
        assert!(bounds.iter().copied().fold(0.0, f64::max) >= 0.5);
    }
}
