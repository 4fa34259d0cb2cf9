//! Compressible neo-Hookean matter and the hexahedron made of it.
//!
//! ```text
//! W(F) = μ/2 (F : F − 3 − 2 ln J) + λ/2 (ln J)²,   J = det F
//! P    = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ
//! δ²W  = μ δF : δF + (μ − λ ln J) tr(F⁻¹ δF F⁻¹ δF) + λ tr(F⁻¹ δF)²
//! ```
//!
//! With the displacement's gradient `G = F − I` and `d = J − 1 = tr G + m + det G`, `m` the sum of `G`'s principal minors of two rows,
//! these are
//!
//! ```text
//! W    = μ/2 (G : G + 2 (d − ln(1 + d) − m − det G)) + λ/2 ln(1 + d)²
//! P    = μ (G + F⁻ᵀ Gᵀ) + λ ln(1 + d) F⁻ᵀ
//! ```
//!
//! which keep their digits however little moves.
//!
//! Source: Bonet & Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (2008), 6.4.3.

use nalgebra::{Matrix3, Vector3};

use crate::mesh::weights;

/// Lamé's constants (Pa, or in units of a modulus).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lame {
    /// Shear modulus.
    pub mu: f64,
    /// λ.
    pub lambda: f64,
}

impl Lame {
    /// From Young's modulus and Poisson's ratio, −1 < ν < 1/2.
    pub fn new(young: f64, poisson: f64) -> Self {
        Self {
            mu: young / (2.0 * (1.0 + poisson)),
            lambda: young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
        }
    }

    /// The mean of what parts of a whole are made of; 0 of none.
    pub fn mean(parts: impl ExactSizeIterator<Item = Self>) -> Self {
        let many = parts.len().max(1) as f64;
        let sum = parts.fold(Self { mu: 0.0, lambda: 0.0 }, |sum, part| Self {
            mu: sum.mu + part.mu,
            lambda: sum.lambda + part.lambda,
        });
        Self { mu: sum.mu / many, lambda: sum.lambda / many }
    }

    /// What matter that is pressed to the utmost resists with.
    pub fn bulk(&self) -> f64 {
        self.lambda + self.mu
    }

    /// `W` of a displacement's gradient, and the size of the terms that its rounding comes from; `None` where J ≤ 0.
    pub(crate) fn energy(&self, g: &Matrix3<f64>) -> Option<(f64, f64)> {
        let (bent, cubic) = (minors(g), g.determinant());
        let growth = g.trace() + bent + cubic;
        (growth > -1.0).then(|| {
            let (log, lost) = (growth.ln_1p(), without_log(growth) - bent - cubic);
            let (shear, bulk) = (0.5 * self.mu * g.norm_squared(), 0.5 * self.lambda * log * log);
            (shear + self.mu * lost + bulk, 4.0 * shear + bulk.abs())
        })
    }
}

/// A hexahedron that is an affine image of the unit cube, with 2×2×2 Gauss points.
#[derive(Debug, Clone)]
pub struct Hexahedron {
    /// `gradients[point][corner]`: of the trilinear functions (1/mm), of a cell of size 1.
    gradients: [[Vector3<f64>; 8]; 8],
    /// Volume that a Gauss point stands for (mm³), of a cell of size 1.
    volume: f64,
    guard: Option<Guard>,
}

/// What keeps a cell from folding between its Gauss points: matter pressed below a share `J₀` of its volume at a corner resists,
///
/// ```text
/// κ/2 (ln (J / J₀))²   of an eighth of the cell,   where J < J₀,   κ = λ + μ of the matter, at least a bound: soft matter doesn't vanish
/// ```
#[derive(Debug, Clone)]
struct Guard {
    least: f64,
    modulus: f64,
    /// As those of the Gauss points.
    gradients: [[Vector3<f64>; 8]; 8],
    /// From mm to a cell of size 1.
    to_cell: Matrix3<f64>,
    /// Corners that differ by less than this (mm), of a cell of size 1, leave `J` above `J₀`.
    still: f64,
}

/// What a cell is made of at its Gauss points.
pub type Matter = [Lame; 8];
/// Forces or places at the corners.
pub type Corners = [[f64; 3]; 8];
/// A cell's matrix: 3×3 blocks by corner and corner.
pub(crate) type Stiffness = [[Matrix3<f64>; 8]; 8];

/// Places of the Gauss points in the unit cube.
pub(crate) fn gauss(point: usize) -> [f64; 3] {
    let off = 0.5 / 3.0_f64.sqrt();
    std::array::from_fn(|a| if point >> a & 1 == 1 { 0.5 + off } else { 0.5 - off })
}

impl Hexahedron {
    /// `edges`: the edges of a cell of size 1 (mm), as columns.
    pub fn new(edges: &Matrix3<f64>) -> Self {
        let gradients = std::array::from_fn(|point| slopes(edges, gauss(point)));
        Self { gradients, volume: edges.determinant().abs() / 8.0, guard: None }
    }

    /// With cells that resist being pressed below a share of their volume at their corners, with at least a modulus, so that they don't
    /// fold there.
    #[must_use]
    pub fn guarded(self, edges: &Matrix3<f64>, least: f64, modulus: f64) -> Self {
        let place = |corner: usize| std::array::from_fn(|a| f64::from(u8::from(corner >> a & 1 == 1)));
        let gradients: [[Vector3<f64>; 8]; 8] = std::array::from_fn(|corner| slopes(edges, place(corner)));
        // Each of the three edges at a corner changes by 2 √3 times the difference at most: ‖G‖ by 6 times it over the shortest.
        let shortest = edges.svd(false, false).singular_values.min();
        let still = (1.0 - least.cbrt()) * shortest / 6.0;
        let to_cell = edges.try_inverse().expect("a grid's axes are independent");
        Self { guard: Some(Guard { least, modulus, gradients, to_cell, still }), ..self }
    }

    pub(crate) fn is_guarded(&self) -> bool {
        self.guard.is_some()
    }

    /// `G` where the trilinear functions have these gradients.
    fn gradient(gradients: &[Vector3<f64>; 8], size: f64, u: &Corners) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        for (g, u) in gradients.iter().zip(u) {
            sum += Vector3::from(*u) * g.transpose() / size;
        }
        sum
    }

    /// The corners of a cell at which matter resists, with what `F⁻ᵀ` and `ln (J / J₀)` are there; `None` where one is turned inside out.
    #[allow(clippy::type_complexity, reason = "a corner, its matrix and its number")]
    fn pressed(&self, size: f64, u: &Corners) -> Option<Vec<(usize, Matrix3<f64>, f64)>> {
        let mut found = Vec::new();
        let Some(guard) = &self.guard else { return Some(found) };
        let apart = |a: usize| {
            let (low, high) =
                u.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |m, u| (m.0.min(u[a]), m.1.max(u[a])));
            high - low
        };
        if (0..3).map(apart).fold(0.0, f64::max) < guard.still * size {
            return Some(found);
        }
        for corner in 0..8 {
            // Only the three edges at a corner count there.
            let at = Vector3::from(u[corner]);
            let along = |a: usize| {
                let way = Vector3::from(u[corner ^ (1 << a)]) - at;
                if corner >> a & 1 == 1 { -way } else { way }
            };
            let edges = Matrix3::from_columns(&[along(0), along(1), along(2)]);
            let f = Matrix3::identity() + edges * guard.to_cell / size;
            let growth = f.determinant();
            if growth <= 0.0 {
                return None;
            }
            if growth < guard.least
                && let Some(inverse) = f.try_inverse()
            {
                found.push((corner, inverse.transpose(), (growth / guard.least).ln()));
            }
        }
        Some(found)
    }

    /// Volume of a Gauss point of a cell (mm³).
    pub(crate) fn volume(&self, size: f64) -> f64 {
        self.volume * size.powi(3)
    }

    /// Energy of a cell, and the size of its terms; `None` where J ≤ 0 at a Gauss point, or at a guarded corner.
    pub(crate) fn energy(&self, matter: &Matter, size: f64, u: &Corners) -> Option<(f64, f64)> {
        let mut sum = (0.0, 0.0);
        for (point, lame) in matter.iter().enumerate() {
            let (own, terms) = lame.energy(&Self::gradient(&self.gradients[point], size, u))?;
            sum = (sum.0 + own, sum.1 + terms);
        }
        for (corner, _, log) in self.pressed(size, u)? {
            let own = 0.5 * self.resistance(&matter[corner]) * log * log;
            sum = (sum.0 + own, sum.1 + own);
        }
        let volume = self.volume(size);
        Some((sum.0 * volume, sum.1 * volume))
    }

    /// Derivative of the energy by the corners. J > 0 is asked for.
    pub(crate) fn forces(&self, matter: &Matter, size: f64, u: &Corners) -> Corners {
        let mut out = [[0.0; 3]; 8];
        let weight = self.volume(size) / size;
        for (point, lame) in matter.iter().enumerate() {
            let g = Self::gradient(&self.gradients[point], size, u);
            let (inverse, log) = inverse_transposed(&g);
            let stress = (g + inverse * g.transpose()) * lame.mu + inverse * (lame.lambda * log);
            for (out, g) in out.iter_mut().zip(&self.gradients[point]) {
                let force = stress * g * weight;
                *out = [out[0] + force[0], out[1] + force[1], out[2] + force[2]];
            }
        }
        for (corner, inverse, log) in self.pressed(size, u).unwrap_or_default() {
            let stress = inverse * (self.resistance(&matter[corner]) * log * weight);
            for (out, g) in out.iter_mut().zip(self.corner_gradients(corner)) {
                let force = stress * g;
                *out = [out[0] + force[0], out[1] + force[1], out[2] + force[2]];
            }
        }
        out
    }

    /// κ of matter that is pressed.
    fn resistance(&self, lame: &Lame) -> f64 {
        lame.bulk().max(self.guard.as_ref().map_or(0.0, |guard| guard.modulus))
    }

    fn corner_gradients(&self, corner: usize) -> &[Vector3<f64>] {
        self.guard.as_ref().map_or(&[], |guard| &guard.gradients[corner])
    }

    /// Second derivative of the energy by the corners; `bounded`: what it is at most, in no direction less than nothing.
    pub(crate) fn stiffness(&self, matter: &Matter, size: f64, u: &Corners, bounded: bool) -> Stiffness {
        let mut out = [[Matrix3::zeros(); 8]; 8];
        let weight = self.volume(size) / (size * size);
        for (point, lame) in matter.iter().enumerate() {
            let displaced = Self::gradient(&self.gradients[point], size, u);
            let (inverse, log) = inverse_transposed(&displaced);
            let crossed = lame.mu - lame.lambda * log;
            let bend = if bounded {
                Bend::bounded(crossed, lame.mu * least_stretch(&displaced))
            } else {
                Bend::exact(crossed)
            };
            let law = [weight * lame.mu, weight * lame.lambda];
            add_stiffness(&mut out, &self.gradients[point], &inverse, law, bend.times(weight));
        }
        for (corner, inverse, log) in self.pressed(size, u).unwrap_or_default() {
            let resists = weight * self.resistance(&matter[corner]);
            let bend = if bounded { Bend::bounded(-resists * log, 0.0) } else { Bend::exact(-resists * log) };
            if let Some(guard) = &self.guard {
                add_stiffness(&mut out, &guard.gradients[corner], &inverse, [0.0, resists], bend);
            }
        }
        for (p, q) in (0..8).flat_map(|p| (0..p).map(move |q| (p, q))) {
            out[p][q] = out[q][p].transpose();
        }
        out
    }
}

/// `a |sym A|² − b |skew A|²` of `A = F⁻¹ δF`, which `c tr(A A)` is for `a = b = c`.
#[derive(Debug, Clone, Copy)]
struct Bend {
    stretch: f64,
    turn: f64,
}

impl Bend {
    fn exact(crossed: f64) -> Self {
        Self { stretch: crossed, turn: crossed }
    }

    /// What of it a term of at least `most · |A|²` outweighs.
    fn bounded(crossed: f64, most: f64) -> Self {
        Self { stretch: crossed.max(-most), turn: crossed.min(most) }
    }

    fn times(self, weight: f64) -> Self {
        Self { stretch: self.stretch * weight, turn: self.turn * weight }
    }
}

/// Adds the second derivative of `μ/2 |δF|² + λ/2 (tr A)²` and of half of what bends, of corners `p ≤ q` alone: the rest is their mirror image.
///
/// - `g`: gradients of the corners' functions; `inverse`: `F⁻ᵀ`; `law`: μ and λ.
fn add_stiffness(
    out: &mut Stiffness,
    g: &[Vector3<f64>; 8],
    inverse: &Matrix3<f64>,
    law: [f64; 2],
    bend: Bend,
) {
    let h: [Vector3<f64>; 8] = std::array::from_fn(|c| inverse * g[c]);
    let all = 0.5 * (bend.stretch - bend.turn);
    let square = (all != 0.0).then(|| inverse * inverse.transpose() * all);
    let crossed = 0.5 * (bend.stretch + bend.turn);
    for p in 0..8 {
        for q in p..8 {
            let block = &mut out[p][q];
            let along = g[p].dot(&g[q]);
            *block += h[p] * h[q].transpose() * law[1] + h[q] * h[p].transpose() * crossed;
            for a in 0..3 {
                block[(a, a)] += law[0] * along;
            }
            if let Some(square) = &square {
                *block += square * along;
            }
        }
    }
}

/// The square of the least stretch of `F = I + G`: the least eigenvalue of `FᵀF` (Smith 1961).
pub(crate) fn least_stretch(g: &Matrix3<f64>) -> f64 {
    let f = Matrix3::identity() + g;
    let c = f.transpose() * f;
    let mean = c.trace() / 3.0;
    let off = c - Matrix3::from_diagonal_element(mean);
    let spread = (off.norm_squared() / 6.0).sqrt();
    if spread <= 1e-12 * mean {
        return mean;
    }
    let angle = (off.determinant() / (2.0 * spread.powi(3))).clamp(-1.0, 1.0).acos() / 3.0;
    (mean + 2.0 * spread * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos()).max(0.0)
}

/// Gradients of the trilinear functions at a place in the unit cube, in a cell with such edges.
fn slopes(edges: &Matrix3<f64>, place: [f64; 3]) -> [Vector3<f64>; 8] {
    let inverse = edges.try_inverse().expect("a grid's axes are independent").transpose();
    std::array::from_fn(|corner| {
        let slope = Vector3::from_fn(|axis, _| {
            let mut flat = place;
            flat[axis] = if corner >> axis & 1 == 1 { 1.0 } else { 0.0 };
            let sign = if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            sign * weights(flat)[corner]
        });
        inverse * slope
    })
}

/// `F⁻ᵀ` and `ln J` of a displacement's gradient.
fn inverse_transposed(g: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
    let inverse = (Matrix3::identity() + g).try_inverse().expect("J > 0 is kept by the line search");
    (inverse.transpose(), (g.trace() + minors(g) + g.determinant()).ln_1p())
}

/// Sum of the principal minors of two rows.
fn minors(g: &Matrix3<f64>) -> f64 {
    let minor = |a: usize, b: usize| g[(a, a)] * g[(b, b)] - g[(a, b)] * g[(b, a)];
    minor(0, 1) + minor(0, 2) + minor(1, 2)
}

/// `d − ln(1 + d)`, to all digits however small `d` is.
fn without_log(d: f64) -> f64 {
    if d.abs() > 0.01 {
        return d - d.ln_1p();
    }
    // d²/2 − d³/3 + d⁴/4 − …: the ninth term is less than a rounding of the first.
    let series = (2..=9).rev().fold(0.0, |sum, n| 1.0 / f64::from(n) - d * sum);
    d * d * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_and_stress_are_those_of_the_book_and_keep_their_digits_when_little_moves() {
        let lame = Lame::new(3.0, 0.3);
        let shape = Matrix3::new(0.3, -0.2, 0.1, 0.4, 0.2, -0.3, 0.1, 0.25, -0.15);
        let g = shape * 0.7;
        let f = Matrix3::identity() + g;
        let log = f64::ln(f.determinant());
        let plain = 0.5 * lame.mu * (f.norm_squared() - 3.0 - 2.0 * log) + 0.5 * lame.lambda * log * log;
        assert!((lame.energy(&g).unwrap().0 - plain).abs() < 1e-13);
        assert_eq!(lame.energy(&(Matrix3::identity() * -1.5)), None);
        // Linear elasticity is what is left of small motions.
        let strain = (shape + shape.transpose()) * 0.5;
        let small = lame.mu * strain.norm_squared() + 0.5 * lame.lambda * strain.trace().powi(2);
        for scale in [1e-5, 1e-9, 1e-30, 1e-100] {
            let energy = lame.energy(&(shape * scale)).unwrap().0 / (scale * scale);
            assert!((energy - small).abs() < 1e-12 + 4.0 * scale, "{scale:e}: {energy} for {small}");
        }
        for d in [-0.0101, -0.0099, 0.0099, 0.0101, 1e-4] {
            assert!((without_log(d) - (d - d.ln_1p())).abs() < 1e-15, "{d}");
        }
    }
}
