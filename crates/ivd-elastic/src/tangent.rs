//! The second derivative of a body's energy, as what it does to a motion of the nodes: no matrix is put together.
//!
//! At a place with `F`, along the edges of a cell rather than by place (`X = δF E`, `H = F⁻ᵀ E⁻ᵀ`, `C = E⁻¹ E⁻ᵀ`, `E` the edges), the derivative of
//! what [`crate::material`] writes is
//!
//! ```text
//! μ X C + λ tr(Hᵀ X) H + c H Xᵀ H + s F⁻ᵀ F⁻¹ X C
//! ```
//!
//! with `c = μ − λ ln J` and `s = 0`, or with a `c` and `s` by which it bends down nowhere. It is found for the eight Gauss points of a cell at once, by
//! loops that the compiler makes vectors of: compiled twice, they give the same bytes, as every operation is rounded by itself.
//!
//! The argument for the `unsafe` block: what needs AVX2 is called only where it was found.

use ivd_core::{Error, Exec, has_avx2};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::material::{Hexahedron, Matter, inverse_transposed, least_stretch, set};
use crate::slopes::{CORNERS, Corners, GAUSS, Lanes, Places, Slopes, ZERO, turned};
use crate::system::Body;
use crate::vectors::{ROWS, Triple};

/// What the second derivative of a body's energy at a motion does.
pub(crate) struct Tangent<'a> {
    body: &'a Body,
    cells: Vec<CellTangent>,
    /// `C` of a cell of size 1 (1/mm²).
    metric: [[f64; 3]; 3],
    avx2: bool,
}

/// Coefficients at eight places of a cell, times the volume that these stand for.
struct Coefficients {
    /// `H`.
    inverse: Slopes,
    mu: Lanes,
    lambda: Lanes,
    /// `c`.
    crossed: Lanes,
}

struct CellTangent {
    gauss: Coefficients,
    /// `s F⁻ᵀ F⁻¹`, where `s` isn't 0 everywhere.
    stretch: Option<Box<Slopes>>,
    /// The corners at which matter is pressed, where there are any: μ is 0 there.
    pressed: Option<Box<(Coefficients, Slopes)>>,
}

/// `a |sym A|² − b |skew A|²` of `A = F⁻¹ δF`, which `c tr(A A)` is for `a = b = c`.
#[derive(Debug, Clone, Copy)]
struct Bend {
    stretch: f64,
    turn: f64,
}

impl Bend {
    /// `bounded`: what of it a term of at least `most · |A|²` outweighs.
    fn new(crossed: f64, bounded: bool, most: impl FnOnce() -> f64) -> Self {
        if !bounded {
            return Self { stretch: crossed, turn: crossed };
        }
        let most = most();
        Self { stretch: crossed.max(-most), turn: crossed.min(most) }
    }

    /// `c`.
    fn crossed(self) -> f64 {
        0.5 * (self.stretch + self.turn)
    }

    /// `s`.
    fn all(self) -> f64 {
        0.5 * (self.stretch - self.turn)
    }
}

impl Coefficients {
    fn zeros() -> Self {
        Self { inverse: ZERO, mu: [0.0; 8], lambda: [0.0; 8], crossed: [0.0; 8] }
    }
}

impl CellTangent {
    fn new(element: &Hexahedron, matter: &Matter, size: f64, u: &Corners, bounded: bool) -> Self {
        let (to_slope, weight) = (element.to_place().transpose(), element.volume(size) / (size * size));
        let mut gauss = Coefficients::zeros();
        let mut stretch: Option<Box<Slopes>> = None;
        for (l, (lame, g)) in matter.iter().zip(element.gradients(GAUSS, size, u)).enumerate() {
            let (inverse, log) = inverse_transposed(&g);
            let bend = Bend::new(lame.mu - lame.lambda * log, bounded, || lame.mu * least_stretch(&g));
            set(&mut gauss.inverse, l, &(inverse * to_slope));
            (gauss.mu[l], gauss.lambda[l]) = (weight * lame.mu, weight * lame.lambda);
            gauss.crossed[l] = weight * bend.crossed();
            if bend.all() != 0.0 {
                let at = stretch.get_or_insert_with(|| Box::new(ZERO));
                set(at, l, &(inverse * inverse.transpose() * (weight * bend.all())));
            }
        }
        let corners = element.pressed(matter, size, u).unwrap_or_default();
        let pressed = (!corners.is_empty()).then(|| {
            let mut own = Box::new((Coefficients::zeros(), ZERO));
            for at in corners {
                let l = at.corner;
                let bend = Bend::new(-at.resists * at.log, bounded, || 0.0);
                set(&mut own.0.inverse, l, &(at.inverse * to_slope));
                own.0.lambda[l] = weight * at.resists;
                own.0.crossed[l] = weight * bend.crossed();
                set(&mut own.1, l, &(at.inverse * at.inverse.transpose() * (weight * bend.all())));
            }
            own
        });
        Self { gauss, stretch, pressed }
    }

    /// What the corners are pushed by as they move.
    fn pushed(&self, by: &Corners, metric: &[[f64; 3]; 3], avx2: bool) -> Corners {
        #[cfg(target_arch = "x86_64")]
        if avx2 {
            // SAFETY: AVX2 was found.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            return unsafe { self.times_avx2(by, metric) };
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = avx2;
        self.times(by, metric)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn times_avx2(&self, by: &Corners, metric: &[[f64; 3]; 3]) -> Corners {
        self.times(by, metric)
    }

    /// What does the work of [`CellTangent::pushed`].
    #[inline(always)]
    fn times(&self, by: &Corners, metric: &[[f64; 3]; 3]) -> Corners {
        let slopes = GAUSS.slopes(by);
        let mut out = GAUSS.gather(&self.gauss.times(&slopes, metric, self.stretch.as_deref()));
        if let Some(own) = &self.pressed {
            let slopes = CORNERS.slopes(by);
            let more = CORNERS.gather(&own.0.times(&slopes, metric, Some(&own.1)));
            for (out, more) in out.iter_mut().zip(more) {
                for a in 0..3 {
                    out[a] += more[a];
                }
            }
        }
        out
    }
}

/// The function that is 1 at one corner and 0 at the others: its derivatives `g` along the edges, and `g · C g`.
struct Unit {
    slopes: [Lanes; 3],
    square: Lanes,
}

impl Unit {
    fn all(places: Places, metric: &[[f64; 3]; 3]) -> [Self; 8] {
        std::array::from_fn(|corner| {
            let mut values = [[0.0; 3]; 8];
            values[corner][0] = 1.0;
            let slopes = places.slopes(&values);
            let plain = turned(&slopes, metric);
            let square = std::array::from_fn(|l| (0..3).map(|e| slopes[0][e][l] * plain[0][e][l]).sum());
            Self { slopes: slopes[0], square }
        })
    }
}

impl Coefficients {
    /// - `x`: derivatives along the edges of what moves on; `stretch`: `s F⁻ᵀ F⁻¹`.
    #[inline(always)]
    fn times(&self, x: &Slopes, metric: &[[f64; 3]; 3], stretch: Option<&Slopes>) -> Slopes {
        let h = &self.inverse;
        let plain = turned(x, metric);
        let mut trace = [0.0; 8];
        for (h, x) in h.iter().flatten().zip(x.iter().flatten()) {
            for l in 0..8 {
                trace[l] += h[l] * x[l];
            }
        }
        for l in 0..8 {
            trace[l] *= self.lambda[l];
        }
        // c Xᵀ H.
        let mut crossed = ZERO;
        for (b, crossed) in crossed.iter_mut().enumerate() {
            for (e, crossed) in crossed.iter_mut().enumerate() {
                for l in 0..8 {
                    let sum = x[0][b][l] * h[0][e][l] + x[1][b][l] * h[1][e][l] + x[2][b][l] * h[2][e][l];
                    crossed[l] = self.crossed[l] * sum;
                }
            }
        }
        let mut out = ZERO;
        for a in 0..3 {
            for e in 0..3 {
                for l in 0..8 {
                    let turned = h[a][0][l] * crossed[0][e][l]
                        + h[a][1][l] * crossed[1][e][l]
                        + h[a][2][l] * crossed[2][e][l];
                    out[a][e][l] = self.mu[l] * plain[a][e][l] + trace[l] * h[a][e][l] + turned;
                }
            }
        }
        if let Some(s) = stretch {
            for a in 0..3 {
                for e in 0..3 {
                    for l in 0..8 {
                        out[a][e][l] += s[a][0][l] * plain[0][e][l]
                            + s[a][1][l] * plain[1][e][l]
                            + s[a][2][l] * plain[2][e][l];
                    }
                }
            }
        }
        out
    }

    /// What a corner is pushed by as it moves alone.
    fn block(&self, unit: &Unit, stretch: Option<&Slopes>) -> Matrix3<f64> {
        let (g, h) = (&unit.slopes, &self.inverse);
        let along: [Lanes; 3] = std::array::from_fn(|a| {
            std::array::from_fn(|l| h[a][0][l] * g[0][l] + h[a][1][l] * g[1][l] + h[a][2][l] * g[2][l])
        });
        let weight: Lanes = std::array::from_fn(|l| self.lambda[l] + self.crossed[l]);
        let plain: f64 = (0..8).map(|l| self.mu[l] * unit.square[l]).sum();
        Matrix3::from_fn(|a, b| {
            let mut sum = if a == b { plain } else { 0.0 };
            for l in 0..8 {
                sum += weight[l] * along[a][l] * along[b][l];
            }
            if let Some(s) = stretch {
                for l in 0..8 {
                    sum += s[a][b][l] * unit.square[l];
                }
            }
            sum
        })
    }
}

/// Second derivatives by single nodes.
pub(crate) struct Blocks<'a> {
    body: &'a Body,
    gauss: [Unit; 8],
    corners: [Unit; 8],
}

impl<'a> Blocks<'a> {
    /// Of a body.
    pub(crate) fn new(body: &'a Body) -> Self {
        let metric = metric(&body.element);
        Self { body, gauss: Unit::all(GAUSS, &metric), corners: Unit::all(CORNERS, &metric) }
    }

    /// What a corner of a cell is pushed by as it moves alone, of the derivative that bends down nowhere.
    pub(crate) fn of(&self, cell: usize, corner: usize, u: &Corners) -> Matrix3<f64> {
        let (body, size) = (self.body, f64::from(self.body.mesh.cells[cell].size));
        let own = CellTangent::new(&body.element, &body.matter[cell], size, u, true);
        self.block(cell, corner, &own)
    }

    /// The same of what a cell's second derivative is.
    fn block(&self, cell: usize, corner: usize, own: &CellTangent) -> Matrix3<f64> {
        let mut block = own.gauss.block(&self.gauss[corner], own.stretch.as_deref());
        if let Some(pressed) = &own.pressed {
            block += pressed.0.block(&self.corners[corner], Some(&pressed.1));
        }
        for pull in self.body.pulls_of(cell) {
            block +=
                Matrix3::from_diagonal_element(pull.spring * pull.weights[corner] * pull.weights[corner]);
        }
        block
    }
}

/// `C` of a cell of size 1.
fn metric(element: &Hexahedron) -> [[f64; 3]; 3] {
    let metric = element.to_place() * element.to_place().transpose();
    std::array::from_fn(|r| std::array::from_fn(|c| metric[(r, c)]))
}

impl<'a> Tangent<'a> {
    /// `bounded`: what the second derivative is at most, in no direction less than nothing.
    ///
    /// # Errors
    /// Cancelled.
    pub(crate) fn new(body: &'a Body, u: &[Triple], bounded: bool, exec: &Exec) -> Result<Self, Error> {
        exec.check_cancelled()?;
        let of = |cell: usize| {
            let size = f64::from(body.mesh.cells[cell].size);
            CellTangent::new(&body.element, &body.matter[cell], size, &body.mesh.gather(cell, u), bounded)
        };
        let cells = (0..body.mesh.cells.len()).into_par_iter().map(of).collect();
        Ok(Self { body, cells, metric: metric(&body.element), avx2: exec.simd && has_avx2() })
    }

    /// Bytes that a cell takes, pressed or bent or not.
    pub(crate) const fn bytes() -> usize {
        size_of::<CellTangent>() + size_of::<Coefficients>() + size_of::<Corners>() + 2 * size_of::<Slopes>()
    }

    /// What the forces change by, to first order, as the nodes move on; 0 at held nodes.
    pub(crate) fn times(&self, by: &[Triple]) -> Vec<Triple> {
        let mesh = &self.body.mesh;
        let of = |(cell, own): (usize, &CellTangent)| {
            let by = mesh.gather(cell, by);
            let mut out = own.pushed(&by, &self.metric, self.avx2);
            for pull in self.body.pulls_of(cell) {
                let mut moved = Vector3::zeros();
                for (by, w) in by.iter().zip(pull.weights) {
                    moved += Vector3::from(*by) * (w * pull.spring);
                }
                for (out, w) in out.iter_mut().zip(pull.weights) {
                    *out = std::array::from_fn(|a| out[a] + w * moved[a]);
                }
            }
            out
        };
        let forces: Vec<Corners> = self.cells.par_iter().enumerate().with_min_len(ROWS / 4).map(of).collect();
        self.body.at_free_nodes(&forces)
    }

    /// The diagonal blocks, 0 at held nodes; what the corners of one cell that hang on the same node do to one another left out.
    pub(crate) fn diagonal(&self) -> Vec<Matrix3<f64>> {
        let blocks = Blocks::new(self.body);
        let of = |(cell, own): (usize, &CellTangent)| {
            std::array::from_fn(|corner| blocks.block(cell, corner, own))
        };
        let blocks: Vec<[Matrix3<f64>; 8]> = self.cells.par_iter().enumerate().map(of).collect();
        self.body.sum_blocks(&blocks)
    }
}
