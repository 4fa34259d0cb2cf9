//! Closest points between points, segments and triangles (Ericson 2005, section 5.1.9).

use ivd_core::geometry::{self, share};
use nalgebra::Vector3;

type Point = Vector3<f64>;

/// Point of triangle `abc` closest to `p`, a corner's or an edge's to the bit.
pub(super) fn closest_on_triangle(p: &Point, [a, b, c]: [&Point; 3]) -> Point {
    let [u, v, w] = geometry::closest_on_triangle(&[*a, *b, *c], *p);
    if v == 1.0 {
        *b
    } else if w == 1.0 {
        *c
    } else if u == 0.0 {
        b + (c - b) * w
    } else {
        a + (b - a) * v + (c - a) * w
    }
}

/// Parameter in 0…1 of the point of segment `a + s (b - a)` closest to `p`.
pub(super) fn closest_on_segment(p: &Point, a: &Point, b: &Point) -> f64 {
    let d = b - a;
    share((p - a).dot(&d).max(0.0), d.norm_squared())
}

/// Parameter `s` in 0…1 at which segment `a + s (b - a)` comes closest to segment `c d`.
pub(super) fn closest_approach(a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv) = (u.norm_squared(), u.dot(&v), v.norm_squared());
    let (uw, vw) = (u.dot(&w), v.dot(&w));
    let area = uu * vv - uv * uv;
    if area <= 1e-14 * uu * vv {
        // Parallel: any end of the overlap serves.
        return closest_on_segment(c, a, b);
    }
    let s = ((uv * vw - vv * uw) / area).clamp(0.0, 1.0);
    // The best t for this s, clamped, and the best s for that t.
    let t = share((s * uv + vw).max(0.0), vv);
    share((t * uv - uw).max(0.0), uu)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice_of_points() -> impl Iterator<Item = Point> {
        (0..343).map(|i| {
            Point::new((i % 7) as f64, (i / 7 % 7) as f64, (i / 49) as f64) * 0.9 - Point::repeat(2.3)
        })
    }

    #[test]
    fn closest_points_beat_every_sampled_point_of_the_triangle() {
        let corners = [Point::new(0.0, 0.0, 0.2), Point::new(1.5, 0.3, 0.0), Point::new(-0.4, 1.1, 0.5)];
        for p in lattice_of_points() {
            let found = (closest_on_triangle(&p, [&corners[0], &corners[1], &corners[2]]) - p).norm();
            let mut least = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (s, t) = (i as f64 / 60.0, j as f64 / 60.0);
                    let q = corners[0] * (1.0 - s - t) + corners[1] * s + corners[2] * t;
                    least = least.min((q - p).norm());
                }
            }
            assert!(found <= least + 1e-12 && found >= least - 0.05, "{p:?}: {found} against {least}");
        }
    }

    #[test]
    fn a_triangle_with_two_corners_at_one_place_is_a_segment() {
        let (near, far) = (Point::new(0.0, 0.0, 0.0), Point::new(4.0, 0.0, 0.0));
        let p = Point::new(3.0, 1.0, 0.0);
        for corners in [[&near, &near, &far], [&near, &far, &near], [&far, &near, &near], [&far, &far, &near]]
        {
            assert_eq!(closest_on_triangle(&p, corners), Point::new(3.0, 0.0, 0.0));
        }
        assert_eq!(closest_on_triangle(&p, [&near; 3]), near);
    }

    #[test]
    fn closest_approach_beats_every_sampled_pair_of_the_segments() {
        let (c, d) = (Point::new(0.1, -0.7, 0.2), Point::new(0.4, 0.9, 0.3));
        for a in lattice_of_points() {
            let b = Point::new(0.3, 0.2, -0.1) - a * 0.4;
            let x = a + (b - a) * closest_approach(&a, &b, &c, &d);
            let y = c + (d - c) * closest_on_segment(&x, &c, &d);
            let sampled = (0..=200).map(|i| {
                let x = a + (b - a) * (i as f64 / 200.0);
                (x - c - (d - c) * closest_on_segment(&x, &c, &d)).norm()
            });
            assert!((x - y).norm() <= sampled.fold(f64::INFINITY, f64::min) + 1e-9);
        }
    }
}
