//! Closest points.

use nalgebra::Vector3;

/// Weights of the corners of the triangle's point nearest to `point` (Ericson 2005, Real-Time Collision Detection, 5.1.5).
///
/// A corner or an edge has exact zeros for the corners that don't take part, so that the triangles at a corner agree on
/// its distance to the last bit. A triangle without area is its longest edge.
#[inline]
pub fn closest_on_triangle(corners: &[Vector3<f64>; 3], point: Vector3<f64>) -> [f64; 3] {
    let [a, b, c] = corners;
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let w_c = d1 * d4 - d3 * d2;
    // The square of the edge's length is d1 - d3: where two corners are one, another edge is the triangle.
    if w_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
        let t = share(d1, d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let w_b = d5 * d2 - d1 * d6;
    if w_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = share(d2, d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let w_a = d3 * d6 - d5 * d4;
    if w_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = share(d4 - d3, (d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = w_a + w_b + w_c;
    let (v, w) = (share(w_b, sum), share(w_c, sum));
    [(1.0 - v - w).max(0.0), v, w]
}

/// A quotient in 0…1; 0 where the whole is nothing.
#[inline]
pub fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_points_of_all_seven_regions_are_right() {
        let corners = [Vector3::new(0.0, 0.0, 0.0), Vector3::new(2.0, 0.0, 0.0), Vector3::new(0.0, 2.0, 0.0)];
        let at = |x, y, z| closest_on_triangle(&corners, Vector3::new(x, y, z));
        assert_eq!(at(-1.0, -1.0, 1.0), [1.0, 0.0, 0.0]);
        assert_eq!(at(4.0, -1.0, 1.0), [0.0, 1.0, 0.0]);
        assert_eq!(at(-1.0, 4.0, 1.0), [0.0, 0.0, 1.0]);
        assert_eq!(at(1.0, -1.0, 1.0), [0.5, 0.5, 0.0]);
        assert_eq!(at(-1.0, 1.0, 1.0), [0.5, 0.0, 0.5]);
        assert_eq!(at(2.0, 2.0, 1.0), [0.0, 0.5, 0.5]);
        assert_eq!(at(0.5, 1.0, 9.0), [0.25, 0.25, 0.5]);
    }

    #[test]
    fn triangles_without_area_give_numbers() {
        let v = |x: f64| Vector3::new(x, 0.0, 0.0);
        for corners in
            [[v(0.0); 3], [v(0.0), v(0.0), v(1.0)], [v(0.0), v(1.0), v(0.0)], [v(0.0), v(1.0), v(2.0)]]
        {
            for point in [Vector3::new(0.5, 1.0, 0.0), v(-1.0), v(3.0), v(0.0)] {
                let weights = closest_on_triangle(&corners, point);
                assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)), "{weights:?}");
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_triangle_with_two_corners_in_one_is_its_edge() {
        let (a, b) = (Vector3::new(4.0, 3.0, 1.0), Vector3::new(0.0, 0.0, 1.0));
        for corners in [[a, a, b], [a, b, a], [b, a, a], [b, b, a], [b, a, b], [a, b, b]] {
            for (point, nearest) in [
                (Vector3::new(-1.0, 0.0, 0.0), b),
                (Vector3::new(9.0, 9.0, 9.0), a),
                (Vector3::new(2.0, 1.5, 7.0), Vector3::new(2.0, 1.5, 1.0)),
            ] {
                let [u, v, w] = closest_on_triangle(&corners, point);
                let found = corners[0] * u + corners[1] * v + corners[2] * w;
                assert!((found - nearest).norm() < 1e-12, "{corners:?} from {point:?}: {found:?}");
            }
        }
    }
}
