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

use nalgebra::Matrix3;

use crate::slopes::{CORNERS, Corners, GAUSS, Places, Slopes, ZERO};

/// Lamé's constants (Pa, or in units of a modulus).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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

    /// Times a factor.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self { mu: self.mu * factor, lambda: self.lambda * factor }
    }

    /// The mean of what parts of a whole are made of; 0 of none.
    pub fn mean(parts: impl ExactSizeIterator<Item = Self>) -> Self {
        let many = parts.len().max(1) as f64;
        let sum = parts.fold(Self::default(), |sum, part| Self {
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
    /// From derivatives along the edges of a cell of size 1 to those by place (1/mm).
    to_place: Matrix3<f64>,
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
}

/// What a cell is made of at its Gauss points.
pub type Matter = [Lame; 8];

/// A corner of a cell at which matter is pressed and resists.
pub(crate) struct Pressed {
    pub(crate) corner: usize,
    /// `F⁻ᵀ`.
    pub(crate) inverse: Matrix3<f64>,
    /// `ln (J / J₀)`.
    pub(crate) log: f64,
    /// κ.
    pub(crate) resists: f64,
}

/// Places of the Gauss points in the unit cube.
#[cfg(test)]
pub(crate) fn gauss(point: usize) -> [f64; 3] {
    let off = 0.5 / 3.0_f64.sqrt();
    std::array::from_fn(|a| if point >> a & 1 == 1 { 0.5 + off } else { 0.5 - off })
}

impl Hexahedron {
    /// `edges`: the edges of a cell of size 1 (mm), as columns.
    pub fn new(edges: &Matrix3<f64>) -> Self {
        let to_place = edges.try_inverse().expect("a grid's axes are independent");
        Self { to_place, volume: edges.determinant().abs() / 8.0, guard: None }
    }

    /// With cells that resist being pressed below a share of their volume at their corners, with at least a modulus, so that they don't
    /// fold there.
    #[must_use]
    pub fn guarded(self, least: f64, modulus: f64) -> Self {
        Self { guard: Some(Guard { least, modulus }), ..self }
    }

    pub(crate) fn is_guarded(&self) -> bool {
        self.guard.is_some()
    }

    /// From derivatives along the edges of a cell of size 1 to those by place (1/mm).
    pub(crate) fn to_place(&self) -> &Matrix3<f64> {
        &self.to_place
    }

    /// The gradients of a motion at eight places of a cell.
    pub(crate) fn gradients(&self, places: Places, size: f64, u: &Corners) -> [Matrix3<f64>; 8] {
        let slopes = places.slopes(u);
        let to_place = self.to_place / size;
        std::array::from_fn(|l| Matrix3::from_fn(|a, edge| slopes[a][edge][l]) * to_place)
    }

    /// The corners of a cell at which matter resists; `None` where one is turned inside out.
    pub(crate) fn pressed(&self, matter: &Matter, size: f64, u: &Corners) -> Option<Vec<Pressed>> {
        let mut found = Vec::new();
        let Some(guard) = &self.guard else { return Some(found) };
        for (corner, g) in self.gradients(CORNERS, size, u).into_iter().enumerate() {
            let f = Matrix3::identity() + g;
            let growth = f.determinant();
            if growth <= 0.0 {
                return None;
            }
            if growth < guard.least
                && let Some(inverse) = f.try_inverse()
            {
                let resists = matter[corner].bulk().max(guard.modulus);
                let log = (growth / guard.least).ln();
                found.push(Pressed { corner, inverse: inverse.transpose(), log, resists });
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
        for (lame, g) in matter.iter().zip(self.gradients(GAUSS, size, u)) {
            let (own, terms) = lame.energy(&g)?;
            sum = (sum.0 + own, sum.1 + terms);
        }
        for pressed in self.pressed(matter, size, u)? {
            let own = 0.5 * pressed.resists * pressed.log * pressed.log;
            sum = (sum.0 + own, sum.1 + own);
        }
        let volume = self.volume(size);
        Some((sum.0 * volume, sum.1 * volume))
    }

    /// Derivative of the energy by the corners, and the most that a pressed corner resists with (κ). J > 0 is asked for.
    pub(crate) fn forces(&self, matter: &Matter, size: f64, u: &Corners) -> (Corners, f64) {
        // P of every place, by the derivatives along the edges.
        let (to_slope, weight) = (self.to_place.transpose(), self.volume(size) / size);
        let mut stresses = ZERO;
        for (l, (lame, g)) in matter.iter().zip(self.gradients(GAUSS, size, u)).enumerate() {
            let (inverse, log) = inverse_transposed(&g);
            let stress = (g + inverse * g.transpose()) * lame.mu + inverse * (lame.lambda * log);
            set(&mut stresses, l, &(stress * to_slope * weight));
        }
        let mut out = GAUSS.gather(&stresses);
        let pressed = self.pressed(matter, size, u).unwrap_or_default();
        let resists = pressed.iter().map(|at| at.resists).fold(0.0, f64::max);
        if !pressed.is_empty() {
            let mut stresses = ZERO;
            for at in pressed {
                set(&mut stresses, at.corner, &(at.inverse * to_slope * (at.resists * at.log * weight)));
            }
            for (out, own) in out.iter_mut().zip(CORNERS.gather(&stresses)) {
                *out = [out[0] + own[0], out[1] + own[1], out[2] + own[2]];
            }
        }
        (out, resists)
    }
}

/// Puts a matrix at one of the eight places.
pub(crate) fn set(slopes: &mut Slopes, lane: usize, matrix: &Matrix3<f64>) {
    for a in 0..3 {
        for edge in 0..3 {
            slopes[a][edge][lane] = matrix[(a, edge)];
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

/// `F⁻ᵀ` and `ln J` of a displacement's gradient.
pub(crate) fn inverse_transposed(g: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
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
