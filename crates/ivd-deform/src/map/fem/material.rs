//! Compressible neo-Hookean matter and the hexahedron made of it.
//!
//! ```text
//! W(F) = μ/2 (F : F − 3 − 2 ln J) + λ/2 (ln J)²,   J = det F
//! P    = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ
//! δ²W  = μ δF : δF + (μ − λ ln J) tr(F⁻¹ δF F⁻¹ δF) + λ tr(F⁻¹ δF)²
//! ```
//!
//! Source: Bonet & Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (2008), 6.4.3.

use nalgebra::{Matrix3, Vector3};

use super::mesh::weights;

/// Lamé's constants (Pa, or in units of a modulus).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lame {
    pub(super) mu: f64,
    pub(super) lambda: f64,
}

impl Lame {
    /// From Young's modulus and Poisson's ratio, −1 < ν < 1/2.
    pub(super) fn new(young: f64, poisson: f64) -> Self {
        Self {
            mu: young / (2.0 * (1.0 + poisson)),
            lambda: young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
        }
    }

    /// The mean of what parts of a whole are made of; 0 of none.
    pub(super) fn mean(parts: impl ExactSizeIterator<Item = Self>) -> Self {
        let many = parts.len().max(1) as f64;
        let sum = parts.fold(Self { mu: 0.0, lambda: 0.0 }, |sum, part| Self {
            mu: sum.mu + part.mu,
            lambda: sum.lambda + part.lambda,
        });
        Self { mu: sum.mu / many, lambda: sum.lambda / many }
    }

    /// `W(F)`; `None` where J ≤ 0.
    pub(super) fn energy(&self, f: &Matrix3<f64>) -> Option<f64> {
        let j = f.determinant();
        (j > 0.0).then(|| {
            let log = j.ln();
            0.5 * self.mu * (f.norm_squared() - 3.0 - 2.0 * log) + 0.5 * self.lambda * log * log
        })
    }
}

/// A hexahedron that is an affine image of the unit cube, with 2×2×2 Gauss points.
#[derive(Debug, Clone)]
pub(super) struct Hexahedron {
    /// `gradients[point][corner]`: of the trilinear functions (1/mm), of a cell of size 1.
    gradients: [[Vector3<f64>; 8]; 8],
    /// Volume that a Gauss point stands for (mm³), of a cell of size 1.
    volume: f64,
}

/// What a cell is made of at its Gauss points.
pub(super) type Matter = [Lame; 8];
/// Forces or places at the corners.
pub(super) type Corners = [[f64; 3]; 8];
/// A cell's matrix: 3×3 blocks by corner and corner.
pub(super) type Stiffness = [[Matrix3<f64>; 8]; 8];

/// Places of the Gauss points in the unit cube.
pub(super) fn gauss(point: usize) -> [f64; 3] {
    let off = 0.5 / 3.0_f64.sqrt();
    std::array::from_fn(|a| if point >> a & 1 == 1 { 0.5 + off } else { 0.5 - off })
}

impl Hexahedron {
    /// `edges`: the edges of a cell of size 1 (mm), as columns.
    pub(super) fn new(edges: &Matrix3<f64>) -> Self {
        let inverse = edges.try_inverse().expect("a grid's axes are independent").transpose();
        let gradients = std::array::from_fn(|point| {
            let place = gauss(point);
            std::array::from_fn(|corner| {
                let slope = Vector3::from_fn(|axis, _| {
                    let mut flat = place;
                    flat[axis] = if corner >> axis & 1 == 1 { 1.0 } else { 0.0 };
                    let sign = if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
                    sign * weights(flat)[corner]
                });
                inverse * slope
            })
        });
        Self { gradients, volume: edges.determinant().abs() / 8.0 }
    }

    /// `F` at a Gauss point.
    fn deformation(&self, point: usize, size: f64, u: &Corners) -> Matrix3<f64> {
        let mut f = Matrix3::identity();
        for (g, u) in self.gradients[point].iter().zip(u) {
            f += Vector3::from(*u) * g.transpose() / size;
        }
        f
    }

    /// Volume of a Gauss point of a cell (mm³).
    pub(super) fn volume(&self, size: f64) -> f64 {
        self.volume * size.powi(3)
    }

    /// Energy of a cell; `None` where J ≤ 0 at a Gauss point.
    pub(super) fn energy(&self, matter: &Matter, size: f64, u: &Corners) -> Option<f64> {
        let mut sum = 0.0;
        for (point, lame) in matter.iter().enumerate() {
            sum += lame.energy(&self.deformation(point, size, u))?;
        }
        Some(sum * self.volume(size))
    }

    /// Derivative of the energy by the corners. J > 0 is asked for.
    pub(super) fn forces(&self, matter: &Matter, size: f64, u: &Corners) -> Corners {
        let mut out = [[0.0; 3]; 8];
        let weight = self.volume(size) / size;
        for (point, lame) in matter.iter().enumerate() {
            let f = self.deformation(point, size, u);
            let (inverse, log) = inverse_transposed(&f);
            let stress = f * lame.mu + inverse * (lame.lambda * log - lame.mu);
            for (out, g) in out.iter_mut().zip(&self.gradients[point]) {
                let force = stress * g * weight;
                *out = [out[0] + force[0], out[1] + force[1], out[2] + force[2]];
            }
        }
        out
    }

    /// Second derivative of the energy by the corners.
    pub(super) fn stiffness(&self, matter: &Matter, size: f64, u: &Corners) -> Stiffness {
        let mut out = [[Matrix3::zeros(); 8]; 8];
        let weight = self.volume(size) / (size * size);
        for (point, lame) in matter.iter().enumerate() {
            let (inverse, log) = inverse_transposed(&self.deformation(point, size, u));
            let g = &self.gradients[point];
            let h: [Vector3<f64>; 8] = std::array::from_fn(|c| inverse * g[c]);
            let (straight, crossed) = (weight * lame.lambda, weight * (lame.mu - lame.lambda * log));
            for p in 0..8 {
                for q in 0..8 {
                    let block = &mut out[p][q];
                    let dot = weight * lame.mu * g[p].dot(&g[q]);
                    *block += h[p] * h[q].transpose() * straight + h[q] * h[p].transpose() * crossed;
                    for a in 0..3 {
                        block[(a, a)] += dot;
                    }
                }
            }
        }
        out
    }
}

/// `F⁻ᵀ` and `ln J`.
fn inverse_transposed(f: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
    let inverse = f.try_inverse().expect("J > 0 is kept by the line search");
    (inverse.transpose(), f.determinant().ln())
}
