//! Multigrid: the preconditioner, and the conjugate gradients that it serves.
//!
//! A level has every second node of the one before, and the matrix `Pᵀ A P` with linear interpolation `P`: symmetric and
//! positive, and so is the cycle. For fourth derivatives that is a level too stiff by half, and iterations grow by a tenth
//! or two a level; cells' own energy on every level takes twice as many iterations, since kinks of `P` cost nothing in it. Axes
//! along which nodes lie much further
//! apart wait until the others have caught up. Each level is smoothed by a Chebyshev polynomial in `D⁻¹ A` (Adams, Brezina,
//! Hu & Tuminaro 2003), which is as parallel as a product and the same for any number of threads.

use std::borrow::Cow;

use ivd_core::{Error, Exec};

use super::matrix::{Dense, Matrix, Quad, Single, Triple, dot};
use super::nodes::Level as Nodes;

/// Degree of the smoother.
const DEGREE: usize = 4;
/// Largest over smallest eigenvalue that the smoother aims at: modes that the next level can't hold reach from the largest
/// down to a 36th of it for a biharmonic operator.
const BAND: f32 = 40.0;
/// Nodes at which a level is solved directly.
const SMALL: usize = 300;
/// Most iterations.
const ITERATIONS: u32 = 200;

/// A matrix with its coarser levels.
#[derive(Debug, Clone)]
pub(super) struct Hierarchy {
    matrix: Matrix,
    levels: Vec<Level>,
    coarsest: Option<Dense>,
}

/// A level of the preconditioner.
#[derive(Debug, Clone)]
struct Level {
    matrix: Single,
    inverse_diagonal: Vec<f32>,
    /// Bound of the eigenvalues of `D⁻¹ A`.
    bound: f32,
    /// From the next level, and its transpose, where there is one.
    transfer: Option<(Single, Single)>,
}

/// What the iteration found.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub(super) values: Vec<Triple>,
    pub(super) iterations: u32,
    /// `|b − A x| / |b|`.
    pub(super) residual: f64,
    /// Whether it isn't found as well as was asked, and is enough.
    pub(super) is_enough: bool,
}

impl Hierarchy {
    /// - `nodes`: those of the matrix; `spacing`: their distances along each axis (mm).
    pub(super) fn new(matrix: Matrix, nodes: &Nodes, mut spacing: [f64; 3]) -> Self {
        let mut levels = Vec::new();
        let mut nodes = Cow::Borrowed(nodes);
        let mut of_level = Cow::Borrowed(&matrix);
        let coarsest = loop {
            let mut level = Level::new(&of_level);
            if nodes.free.len() <= SMALL {
                levels.push(level);
                break Some(Dense::new(&of_level));
            }
            let least = spacing.iter().copied().fold(f64::INFINITY, f64::min);
            let halved = spacing.map(|h| h <= 1.5 * least);
            let coarse = nodes.coarser(halved);
            if coarse.free.len() == 0 || 10 * coarse.free.len() > 9 * nodes.free.len() {
                levels.push(level);
                break None;
            }
            let up = nodes.interpolation(&coarse, halved);
            let down = up.transposed();
            of_level = Cow::Owned(down.times(&of_level.times(&up)));
            level.transfer = Some((Single::new(&up), Single::new(&down)));
            levels.push(level);
            spacing = std::array::from_fn(|a| spacing[a] * if halved[a] { 2.0 } else { 1.0 });
            nodes = Cow::Owned(coarse);
        };
        drop(of_level);
        Self { matrix, levels, coarsest }
    }

    /// The matrix itself.
    pub(super) fn matrix(&self) -> &Matrix {
        &self.matrix
    }

    /// Conjugate gradients from `start`, an axis at a time in step, until `|b − A x| ≤ tolerance · |b|`, or until what has been found by then is
    /// enough: `enough(x, |b − A x| / |b|)`.
    ///
    /// # Errors
    /// Cancellation, which each step hears.
    pub(super) fn solve(
        &self,
        b: &[Triple],
        start: Vec<Triple>,
        tolerance: f64,
        mut enough: impl FnMut(&[Triple], f64) -> bool,
        exec: &Exec,
    ) -> Result<Solution, Error> {
        let norm = |v: &[Triple]| dot(v, v).iter().sum::<f64>().sqrt();
        let whole = norm(b);
        let mut x = start;
        let mut r = b.to_vec();
        self.matrix().apply(&x, &mut r, |r, v| *r = minus(*r, v));
        let (mut p, mut q) = (Vec::new(), vec![[0.0; 3]; b.len()]);
        let mut rz = [0.0; 3];
        let mut iterations = 0;
        let mut residual = norm(&r);
        let mut is_enough = false;
        while residual > tolerance * whole && iterations < ITERATIONS {
            is_enough = enough(&x, residual / whole);
            if is_enough {
                break;
            }
            exec.check_cancelled()?;
            let z = self.precondition(&r, residual);
            let next = dot(&r, &z);
            let beta = ratio(next, rz);
            if p.is_empty() {
                p = z;
            } else {
                for (p, z) in p.iter_mut().zip(&z) {
                    *p = std::array::from_fn(|a| z[a] + beta[a] * p[a]);
                }
            }
            rz = next;
            self.matrix().apply(&p, &mut q, |q, v| *q = v);
            let alpha = ratio(rz, dot(&p, &q));
            for i in 0..x.len() {
                x[i] = std::array::from_fn(|a| x[i][a] + alpha[a] * p[i][a]);
                r[i] = std::array::from_fn(|a| r[i][a] - alpha[a] * q[i][a]);
            }
            residual = norm(&r);
            iterations += 1;
        }
        let residual = if whole > 0.0 { residual / whole } else { 0.0 };
        Ok(Solution { values: x, iterations, residual, is_enough })
    }

    /// An approximate `A⁻¹ r`, in single precision: what it errs in, the next iteration takes up. `size`: about how long `r` is.
    fn precondition(&self, r: &[Triple], size: f64) -> Vec<Triple> {
        // Brought to about 1, so that no length is too large or small for it.
        let by = 1.0 / size;
        let r: Vec<Quad> =
            r.iter().map(|&[x, y, z]| [x * by, y * by, z * by, 0.0].map(|c| c as f32)).collect();
        let z = self.cycle(0, &r);
        z.iter().map(|&[x, y, z, _]| [x, y, z].map(|c| f64::from(c) * size)).collect()
    }

    /// A V-cycle: an approximate `A⁻¹ b`.
    fn cycle(&self, at: usize, b: &[Quad]) -> Vec<Quad> {
        let level = &self.levels[at];
        let Some((up, down)) = &level.transfer else {
            return match &self.coarsest {
                Some(dense) => {
                    let b: Vec<Triple> = b.iter().map(|&[x, y, z, _]| [x, y, z].map(f64::from)).collect();
                    let x = dense.solve(&b);
                    x.iter().map(|&[x, y, z]| [x, y, z, 0.0].map(|c| c as f32)).collect()
                }
                None => level.smooth(b.to_vec(), vec![Quad::default(); b.len()]).0,
            };
        };
        let (mut x, mut r) = level.smooth(b.to_vec(), vec![Quad::default(); b.len()]);
        let mut coarse = vec![Quad::default(); down.height()];
        down.apply(&r, &mut coarse, |c, v| *c = v);
        let correction = self.cycle(at + 1, &coarse);
        up.apply(&correction, &mut x, |x, v| *x = added(*x, v));
        r.copy_from_slice(b);
        level.matrix.apply(&x, &mut r, |r, v| *r = less(*r, v));
        level.smooth(r, x).0
    }
}

impl Level {
    fn new(matrix: &Matrix) -> Self {
        let diagonal = matrix.diagonal();
        Self {
            bound: matrix.bound(&diagonal) as f32,
            inverse_diagonal: diagonal.iter().map(|d| (1.0 / d) as f32).collect(),
            matrix: Single::new(matrix),
            transfer: None,
        }
    }

    /// Improves `x` given the residual `r = b − A x` (Saad 2003, algorithm 12.1); gives both anew.
    fn smooth(&self, mut r: Vec<Quad>, mut x: Vec<Quad>) -> (Vec<Quad>, Vec<Quad>) {
        let (low, high) = (self.bound / BAND, self.bound);
        let (middle, half) = (f32::midpoint(low, high), (high - low) / 2.0);
        let sigma = middle / half;
        let mut rho = 1.0 / sigma;
        let scaled = |r: &Quad, d: f32, by: f32| r.map(|c| c * d * by);
        let mut step: Vec<Quad> =
            r.iter().zip(&self.inverse_diagonal).map(|(r, d)| scaled(r, *d, 1.0 / middle)).collect();
        for k in 0..DEGREE {
            for (x, d) in x.iter_mut().zip(&step) {
                *x = added(*x, *d);
            }
            self.matrix.apply(&step, &mut r, |r, v| *r = less(*r, v));
            if k + 1 == DEGREE {
                break;
            }
            let next = 1.0 / (2.0 * sigma - rho);
            for ((step, r), d) in step.iter_mut().zip(&r).zip(&self.inverse_diagonal) {
                let add = scaled(r, *d, 2.0 * next / half);
                *step = std::array::from_fn(|a| next * rho * step[a] + add[a]);
            }
            rho = next;
        }
        (x, r)
    }
}

fn added(a: Quad, b: Quad) -> Quad {
    std::array::from_fn(|i| a[i] + b[i])
}

fn less(a: Quad, b: Quad) -> Quad {
    std::array::from_fn(|i| a[i] - b[i])
}

fn minus(a: Triple, b: Triple) -> Triple {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Quotients; 0 where an axis has nothing left to solve.
fn ratio(a: Triple, b: Triple) -> Triple {
    std::array::from_fn(|i| if a[i] > 0.0 && b[i] > 0.0 { a[i] / b[i] } else { 0.0 })
}
