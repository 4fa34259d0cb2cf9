//! The determinant of a trilinear cell as a polynomial in Bernstein form.

use nalgebra::Vector3;

use crate::sampler::Corners;

/// Coefficients of a polynomial of degree 2 in each of x, y, z; `(i, j, k)` at `i + 3 j + 9 k`.
///
/// The polynomial lies between the smallest and the largest coefficient on the unit cube, takes the coefficients 0, 2,
/// 6, 8, 18, 20, 24, 26 as values at the cube's corners, and their mean as its integral.
pub(super) type Coefficients = [f64; 27];

/// The coefficients that are values at the corners.
pub(super) const CORNERS: [usize; 8] = [0, 2, 6, 8, 18, 20, 24, 26];

/// Coefficients of `det(I + ∇u)` in a cell whose corners move by `u` (voxels).
///
/// `∂φ/∂x` is linear in y and z with coefficients that are differences of corners, and likewise for y and z, so the
/// determinant is a sum of 4³ triple products. A product of linear Bernstein polynomials `B_i B_i'` is the quadratic one
/// of index `i + i'`, times ½ where `i ≠ i'`.
pub(super) fn determinant(u: &Corners) -> Coefficients {
    let edge = |from: usize, axis: usize| {
        let mut d = u[from | 1 << axis] - u[from];
        d[axis] += 1.0;
        d
    };
    // along_x[j + 2k], along_y[i + 2k], along_z[i + 2j]
    let along_x: [Vector3<f64>; 4] = std::array::from_fn(|m| edge(m << 1, 0));
    let along_y: [Vector3<f64>; 4] = std::array::from_fn(|m| edge(m & 1 | (m & 2) << 1, 1));
    let along_z: [Vector3<f64>; 4] = std::array::from_fn(|m| edge(m, 2));
    let mut out = [0.0; 27];
    for (yi, dy) in along_y.iter().enumerate() {
        for (zi, dz) in along_z.iter().enumerate() {
            let normal = dy.cross(dz);
            let i = (yi & 1) + (zi & 1);
            let wi = half_where_mixed(i);
            for (xi, dx) in along_x.iter().enumerate() {
                let j = (xi & 1) + (zi >> 1);
                let k = (xi >> 1) + (yi >> 1);
                out[i + 3 * j + 9 * k] += dx.dot(&normal) * (wi * half_where_mixed(j) * half_where_mixed(k));
            }
        }
    }
    out
}

fn half_where_mixed(index: usize) -> f64 {
    if index == 1 { 0.5 } else { 1.0 }
}

/// The polynomial on the eight half-size cubes (de Casteljau at ½ along each axis).
pub(super) fn subdivide(c: &Coefficients) -> [Coefficients; 8] {
    let mut parts = [*c; 8];
    for (axis, stride) in [1, 3, 9].into_iter().enumerate() {
        for (octant, part) in parts.iter_mut().enumerate() {
            let upper = octant >> axis & 1 == 1;
            for a in 0..27 {
                if a / stride % 3 != 0 {
                    continue;
                }
                let (p, q, r) = (part[a], part[a + stride], part[a + 2 * stride]);
                let (pq, qr) = (0.5 * (p + q), 0.5 * (q + r));
                let mid = 0.5 * (pq + qr);
                (part[a], part[a + stride], part[a + 2 * stride]) =
                    if upper { (mid, qr, r) } else { (p, pq, mid) };
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::gradient;
    use nalgebra::Matrix3;

    fn random_corners(seed: u64) -> Corners {
        let mut s = seed;
        std::array::from_fn(|_| {
            Vector3::from_fn(|_, _| {
                s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (s >> 33) as f64 / (1_u64 << 30) as f64 - 1.0
            })
        })
    }

    fn evaluate(c: &Coefficients, t: Vector3<f64>) -> f64 {
        let basis = |t: f64| [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
        let (x, y, z) = (basis(t.x), basis(t.y), basis(t.z));
        (0..27).map(|a| c[a] * x[a % 3] * y[a / 3 % 3] * z[a / 9]).sum()
    }

    #[test]
    fn coefficients_are_those_of_the_jacobian_determinant() {
        for seed in 0..20 {
            let u = random_corners(seed);
            let c = determinant(&u);
            for i in 0..27_usize {
                let t = Vector3::new((i % 3) as f64, (i / 3 % 3) as f64, (i / 9) as f64) * 0.41;
                let expected = (Matrix3::identity() + gradient(&u, t)).determinant();
                assert!((evaluate(&c, t) - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn subdivision_is_the_same_polynomial_on_the_octants() {
        let c = determinant(&random_corners(7));
        for (octant, part) in subdivide(&c).iter().enumerate() {
            let base = Vector3::new((octant & 1) as f64, (octant >> 1 & 1) as f64, (octant >> 2) as f64);
            for t in [Vector3::new(0.2, 0.9, 0.5), Vector3::zeros(), Vector3::repeat(1.0)] {
                assert!((evaluate(part, t) - evaluate(&c, (base + t) * 0.5)).abs() < 1e-12);
            }
        }
    }
}
