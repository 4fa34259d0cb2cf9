//! Whether a triangle meets a box, by separating axes (Akenine-Möller 2001).

use nalgebra::Vector3;

/// Rounding allowed for, as a fraction of the lengths at work. A triangle that misses a box by less counts as meeting
/// it: a leaf may list one triangle too many, never one too few.
const SLACK: f64 = 1e-12;

/// Whether the closed triangle meets the closed box `lo … hi`.
pub(super) fn triangle_meets_box(triangle: &[Vector3<f64>; 3], lo: Vector3<f64>, hi: Vector3<f64>) -> bool {
    let half = (hi - lo) * 0.5;
    let centre = (hi + lo) * 0.5;
    let v = triangle.map(|corner| corner - centre);
    let reach = v.iter().map(Vector3::amax).fold(half.amax(), f64::max);
    let edges = [v[1] - v[0], v[2] - v[1], v[0] - v[2]];

    let separated = |axis: Vector3<f64>| {
        let at = [axis.dot(&v[0]), axis.dot(&v[1]), axis.dot(&v[2])];
        let radius = axis.abs().dot(&half) + SLACK * reach * axis.abs().sum();
        at[0].min(at[1]).min(at[2]) > radius || at[0].max(at[1]).max(at[2]) < -radius
    };
    for axis in 0..3 {
        let unit = Vector3::ith(axis, 1.0);
        if separated(unit) {
            return false;
        }
    }
    // The normal's own rounding is as the square of the lengths.
    let normal = edges[0].cross(&edges[1]);
    if normal.dot(&v[0]).abs() > normal.abs().dot(&half) + SLACK * reach * reach * reach {
        return false;
    }
    for edge in edges {
        let axes = [
            Vector3::new(0.0, -edge.z, edge.y),
            Vector3::new(edge.z, 0.0, -edge.x),
            Vector3::new(-edge.y, edge.x, 0.0),
        ];
        if axes.into_iter().any(separated) {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64, z: f64) -> Vector3<f64> {
        Vector3::new(x, y, z)
    }

    #[test]
    fn touching_counts_and_near_misses_of_every_axis_kind_do_not() {
        let meets = |t: [Vector3<f64>; 3]| triangle_meets_box(&t, v(0.0, 0.0, 0.0), v(1.0, 1.0, 1.0));
        assert!(meets([v(1.0, 0.5, 0.5), v(2.0, 0.0, 0.0), v(2.0, 1.0, 0.0)]), "a corner on a face");
        assert!(meets([v(-1.0, 1.0, 1.0), v(2.0, 1.0, 1.0), v(0.5, 3.0, 3.0)]), "an edge along an edge");
        assert!(meets([v(-5.0, -5.0, 0.5), v(5.0, -5.0, 0.5), v(0.0, 9.0, 0.5)]), "a slice through it");
        assert!(!meets([v(1.001, 0.5, 0.5), v(2.0, 0.0, 0.0), v(2.0, 1.0, 0.0)]), "a face's axis");
        assert!(!meets([v(3.01, 0.0, 0.0), v(0.0, 3.01, 0.0), v(0.0, 0.0, 3.01)]), "the normal");
        assert!(meets([v(2.999, 0.0, 0.0), v(0.0, 2.999, 0.0), v(0.0, 0.0, 2.999)]));
        assert!(!meets([v(2.0, 0.1, -1.0), v(0.1, 2.0, -1.0), v(2.0, 2.0, 3.0)]), "a product of edges");
    }
}
