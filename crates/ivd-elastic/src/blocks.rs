//! Sparse symmetric matrices of 3×3 blocks, and conjugate gradients.

use ivd_core::{Error, Exec};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// A value for each axis of space.
pub type Triple = [f64; 3];

/// Rows, or cells, that one task does: enough to be worth its start, and the unit of sums whose order is fixed.
pub(crate) const ROWS: usize = 256;

/// A sparse matrix by rows.
pub(crate) struct Blocks {
    starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<Matrix3<f64>>,
    /// Inverses of the diagonal blocks: Jacobi's preconditioner.
    diagonal: Vec<Matrix3<f64>>,
}

/// An approximate solution.
pub(crate) struct Found {
    pub(crate) values: Vec<Triple>,
    pub(crate) iterations: u32,
    /// Whether a direction of negative curvature ended it.
    pub(crate) indefinite: bool,
}

impl Blocks {
    /// A square matrix; `row` calls back with columns and blocks, which are added up in its order.
    pub(crate) fn new(height: usize, row: impl Fn(usize, &mut dyn FnMut(u32, Matrix3<f64>)) + Sync) -> Self {
        type Part = (Vec<usize>, Vec<u32>, Vec<Matrix3<f64>>, Vec<Matrix3<f64>>);
        let parts: Vec<Part> = (0..height.div_ceil(ROWS))
            .into_par_iter()
            .map(|part| {
                let (mut ends, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
                let mut diagonal = Vec::new();
                let mut sums: Vec<(u32, Matrix3<f64>)> = Vec::new();
                for i in part * ROWS..((part + 1) * ROWS).min(height) {
                    sums.clear();
                    row(i, &mut |column, block| match sums.binary_search_by_key(&column, |s| s.0) {
                        Ok(at) => sums[at].1 += block,
                        Err(at) => sums.insert(at, (column, block)),
                    });
                    let own = sums.iter().find(|s| s.0 as usize == i).map(|s| s.1);
                    diagonal.push(own.map_or_else(Matrix3::zeros, inverse));
                    columns.extend(sums.iter().map(|s| s.0));
                    values.extend(sums.iter().map(|s| s.1));
                    ends.push(columns.len());
                }
                (ends, columns, values, diagonal)
            })
            .collect();
        let mut out = Self { starts: vec![0], columns: vec![], values: vec![], diagonal: vec![] };
        for (ends, columns, values, diagonal) in parts {
            let base = out.columns.len();
            out.starts.extend(ends.iter().map(|e| base + e));
            out.columns.extend(columns);
            out.values.extend(values);
            out.diagonal.extend(diagonal);
        }
        out
    }

    pub(crate) fn times(&self, x: &[Triple]) -> Vec<Triple> {
        (0..self.diagonal.len())
            .into_par_iter()
            .with_min_len(ROWS)
            .map(|i| {
                let mut sum = Vector3::zeros();
                for at in self.starts[i]..self.starts[i + 1] {
                    sum += self.values[at] * Vector3::from(x[self.columns[at] as usize]);
                }
                sum.into()
            })
            .collect()
    }

    fn precondition(&self, r: &[Triple]) -> Vec<Triple> {
        self.diagonal.iter().zip(r).map(|(m, r)| (m * Vector3::from(*r)).into()).collect()
    }

    /// Conjugate gradients for `A x = b` until the residual is `tolerance` of `b`, both preconditioned: lengths, so that soft matter counts. Where a direction of negative curvature is
    /// met, the solution so far is given, which goes downhill (Nocedal & Wright 2006, algorithm 7.1).
    pub(crate) fn solve(
        &self,
        b: &[Triple],
        tolerance: f64,
        limit: u32,
        exec: &Exec,
    ) -> Result<Found, Error> {
        let mut x = vec![[0.0; 3]; b.len()];
        let mut r = b.to_vec();
        let mut z = self.precondition(&r);
        let end = tolerance * tolerance * dot(&z, &z);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let (mut iterations, mut indefinite) = (0, false);
        while iterations < limit && dot(&z, &z) > end {
            if iterations % 32 == 0 {
                exec.check_cancelled()?;
            }
            let q = self.times(&p);
            let curvature = dot(&p, &q);
            if curvature <= 0.0 {
                indefinite = true;
                if iterations == 0 {
                    x = z;
                }
                break;
            }
            let step = rz / curvature;
            add(&mut x, &p, step);
            add(&mut r, &q, -step);
            z = self.precondition(&r);
            let next = dot(&r, &z);
            let turn = next / rz;
            rz = next;
            p.iter_mut().zip(&z).for_each(|(p, z)| {
                *p = [z[0] + turn * p[0], z[1] + turn * p[1], z[2] + turn * p[2]];
            });
            iterations += 1;
        }
        Ok(Found { values: x, iterations, indefinite })
    }
}

/// The inverse of a diagonal block; of its trace where it isn't positive.
fn inverse(block: Matrix3<f64>) -> Matrix3<f64> {
    block.cholesky().map_or_else(
        || Matrix3::from_diagonal_element(3.0 / block.trace().abs().max(f64::MIN_POSITIVE)),
        |c| c.inverse(),
    )
}

/// `x ← x + s y`.
pub(crate) fn add(x: &mut [Triple], y: &[Triple], s: f64) {
    x.iter_mut().zip(y).for_each(|(x, y)| {
        *x = [x[0] + s * y[0], x[1] + s * y[1], x[2] + s * y[2]];
    });
}

/// Sum of products in a fixed order.
pub(crate) fn dot(a: &[Triple], b: &[Triple]) -> f64 {
    let part = |(a, b): (&[Triple], &[Triple])| {
        a.iter().zip(b).map(|(a, b)| a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).sum::<f64>()
    };
    let parts: Vec<f64> = a.par_chunks(4 * ROWS).zip(b.par_chunks(4 * ROWS)).map(part).collect();
    parts.iter().sum()
}
