use nalgebra::Vector3;

/// Weighted sum of squared distances from planes (Garland & Heckbert 1997): `Σ w (n·x + d)²`, with `w` the area of the
/// triangle that spans the plane and `x` relative to the vertex that the quadric belongs to.
///
/// Every plane passes near its vertex, so that `d` is small and single precision is enough: a quadric decides only in
/// which order vertices go, never how far a result is from its input.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quadric {
    /// `Σ w n nᵀ`: xx, yy, zz, xy, xz, yz.
    a: [f32; 6],
    /// `Σ w d n`.
    b: [f32; 3],
    /// `Σ w d²`.
    c: f32,
    /// `Σ w` (mm²).
    weight: f32,
}

impl Quadric {
    /// The quadric of the planes that meet in a vertex: all of them have `d = 0`.
    ///
    /// - `roots`: `√w n` of each triangle, as [`plane_root`] tells it.
    pub(super) fn of_star(roots: impl Iterator<Item = Vector3<f32>>) -> Self {
        let mut sum = Self::default();
        for r in roots {
            let products = [r.x * r.x, r.y * r.y, r.z * r.z, r.x * r.y, r.x * r.z, r.y * r.z];
            for (a, p) in sum.a.iter_mut().zip(products) {
                *a += p;
            }
            sum.weight += r.norm_squared();
        }
        sum
    }

    /// Sum of the weights (mm²): the area of the triangles.
    pub(super) fn weight(&self) -> f32 {
        self.weight
    }

    /// Adds the quadric of another vertex, which lies at `offset` (mm) from this one.
    pub(super) fn merge(&mut self, other: &Self, offset: &Vector3<f32>) {
        let ao = other.times(offset);
        let b = Vector3::from(other.b);
        for (a, o) in self.a.iter_mut().zip(other.a) {
            *a += o;
        }
        for (s, o) in self.b.iter_mut().zip((b - ao).iter()) {
            *s += o;
        }
        self.c += other.c + offset.dot(&(ao - b * 2.0));
        self.weight += other.weight;
    }

    /// Mean squared distance (mm²) of a point from the planes.
    ///
    /// - `p`: offset of the point from the quadric's vertex (mm).
    #[inline]
    pub(super) fn mean_square(&self, p: &Vector3<f32>) -> f32 {
        let sum = p.dot(&(self.times(p) + Vector3::from(self.b) * 2.0)) + self.c;
        if self.weight > 0.0 { sum.max(0.0) / self.weight } else { 0.0 }
    }

    /// `(Σ w n nᵀ) p`.
    #[inline]
    fn times(&self, p: &Vector3<f32>) -> Vector3<f32> {
        let [xx, yy, zz, xy, xz, yz] = self.a;
        Vector3::new(
            xx * p.x + xy * p.y + xz * p.z,
            xy * p.x + yy * p.y + yz * p.z,
            xz * p.x + yz * p.y + zz * p.z,
        )
    }
}

/// `√w n` of a triangle (mm), with `w` its area and `n` its normal; 0 for a triangle without area.
pub(super) fn plane_root([p, q, r]: [Vector3<f64>; 3]) -> Vector3<f32> {
    let normal = (q - p).cross(&(r - p));
    let length = normal.norm();
    if length > 0.0 { (normal / (2.0 * length).sqrt()).cast() } else { Vector3::zeros() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, plane by plane.
    fn plain(triangles: &[[Vector3<f64>; 3]], x: &Vector3<f64>) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for [p, q, r] in triangles {
            let normal = (q - p).cross(&(r - p));
            if normal.norm() > 0.0 {
                sum += 0.5 * normal.norm() * normal.normalize().dot(&(x - p)).powi(2);
                weight += 0.5 * normal.norm();
            }
        }
        sum / weight
    }

    #[test]
    fn mean_square_is_the_area_weighted_mean_of_squared_plane_distances() {
        let [o, x, y, z] = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]].map(Vector3::from);
        let quadric = Quadric::of_star([[o, x, y], [o, z, x], [o, o, y]].map(plane_root).into_iter());
        let p = Vector3::new(7.0, 0.5, 0.25);
        let expected = (1.0 * 0.25_f32.powi(2) + 3.0 * 0.5_f32.powi(2)) / 4.0;
        assert!((quadric.mean_square(&p) - expected).abs() < 1e-6);
        assert_eq!(quadric.weight(), 4.0);
        assert_eq!(Quadric::default().mean_square(&p), 0.0);
    }

    #[test]
    fn a_chain_of_merged_quadrics_says_what_the_planes_say() {
        // A walk over a rough sheet, far from 0: each vertex takes over the last one's quadric.
        let place = |i: usize, j: usize| {
            let rough = ((i * 7 + j * 13) % 5) as f64;
            Vector3::new(100.0 + i as f64, -80.0 + j as f64, 0.2 * rough)
        };
        let mut all = Vec::new();
        let (mut last, mut at) = (Quadric::default(), place(1, 1));
        for i in 1..20 {
            let centre = place(i, 1);
            let ring = [place(i + 1, 1), place(i, 2), place(i - 1, 1), place(i, 0)];
            let star: Vec<_> = (0..4).map(|k| [centre, ring[k], ring[(k + 1) % 4]]).collect();
            let mut quadric = Quadric::of_star(star.iter().map(|t| plane_root(*t)));
            quadric.merge(&last, &(at - centre).cast());
            all.extend(star);
            (last, at) = (quadric, centre);
            let p = place(i + 1, 1) + Vector3::new(0.3, -0.7, 1.1);
            let (expected, got) = (plain(&all, &p), f64::from(last.mean_square(&(p - at).cast())));
            assert!((got - expected).abs() <= 1e-4 * expected, "{i}: {got} against {expected}");
        }
    }
}
