use std::ops::AddAssign;

use nalgebra::Vector3;

/// Weighted sum of squared distances from planes (Garland & Heckbert 1997): `Σ w (n·x + d)²`, with `w` the area of the
/// triangle that spans the plane.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quadric {
    /// `Σ w n nᵀ`: xx, yy, zz, xy, xz, yz.
    a: [f64; 6],
    /// `Σ w d n`.
    b: [f64; 3],
    /// `Σ w d²`.
    c: f64,
    /// `Σ w` (mm²).
    weight: f64,
}

impl Quadric {
    /// The quadric of a triangle's plane; 0 for a triangle without area.
    pub(super) fn of_triangle([p, q, r]: [Vector3<f64>; 3]) -> Self {
        let normal = (q - p).cross(&(r - p));
        let length = normal.norm();
        if length == 0.0 {
            return Self::default();
        }
        let n = normal / length;
        let (d, w) = (-n.dot(&p), 0.5 * length);
        Self {
            a: [n.x * n.x, n.y * n.y, n.z * n.z, n.x * n.y, n.x * n.z, n.y * n.z].map(|v| v * w),
            b: [n.x, n.y, n.z].map(|v| v * d * w),
            c: d * d * w,
            weight: w,
        }
    }

    /// Mean squared distance (mm²) of a point from the planes.
    #[inline]
    pub(super) fn mean_square(&self, p: &Vector3<f64>) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.a;
        let x = xx * p.x + 2.0 * (xy * p.y + xz * p.z + self.b[0]);
        let y = yy * p.y + 2.0 * (yz * p.z + self.b[1]);
        let z = zz * p.z + 2.0 * self.b[2];
        let sum = x * p.x + y * p.y + z * p.z + self.c;
        if self.weight > 0.0 { sum.max(0.0) / self.weight } else { 0.0 }
    }
}

impl AddAssign for Quadric {
    fn add_assign(&mut self, other: Self) {
        for (a, b) in self.a.iter_mut().zip(other.a) {
            *a += b;
        }
        for (a, b) in self.b.iter_mut().zip(other.b) {
            *a += b;
        }
        self.c += other.c;
        self.weight += other.weight;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_square_is_the_area_weighted_mean_of_squared_plane_distances() {
        let [o, x, y, z] = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]].map(Vector3::from);
        let mut quadric = Quadric::of_triangle([o, x, y]);
        quadric += Quadric::of_triangle([o, z, x]);
        quadric += Quadric::of_triangle([o, o, y]);
        let p = Vector3::new(7.0, 0.5, 0.25);
        let expected = (1.0 * 0.25_f64.powi(2) + 3.0 * 0.5_f64.powi(2)) / 4.0;
        assert!((quadric.mean_square(&p) - expected).abs() < 1e-12);
        assert_eq!(Quadric::default().mean_square(&p), 0.0);
    }
}
