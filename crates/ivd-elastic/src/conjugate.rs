//! Conjugate gradients for symmetric equations of three values a node.

use ivd_core::{Error, Exec};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::tangent::Tangent;
use crate::vectors::{ROWS, Triple, add, dot};

/// An approximate solution.
pub(crate) struct Found {
    pub(crate) values: Vec<Triple>,
    pub(crate) iterations: u32,
    /// Whether a direction of negative curvature ended it.
    pub(crate) indefinite: bool,
}

/// Solves `A x = b` until the residual is `tolerance` of `b`, both preconditioned by the diagonal blocks: lengths, so that soft matter counts. Where
/// a direction of negative curvature is met, the solution so far is given, which goes downhill (Nocedal & Wright 2006, algorithm 7.1).
///
/// # Errors
/// Cancelled.
pub(crate) fn solve(
    tangent: &Tangent<'_>,
    b: &[Triple],
    tolerance: f64,
    limit: u32,
    exec: &Exec,
) -> Result<Found, Error> {
    let diagonal: Vec<Matrix3<f64>> = tangent.diagonal().into_iter().map(inverse).collect();
    let precondition = |r: &[Triple]| -> Vec<Triple> {
        let one = |(m, r): (&Matrix3<f64>, &Triple)| (m * Vector3::from(*r)).into();
        diagonal.par_iter().zip(r).with_min_len(ROWS).map(one).collect()
    };
    let mut x = vec![[0.0; 3]; b.len()];
    let mut r = b.to_vec();
    let mut z = precondition(&r);
    let end = tolerance * tolerance * dot(&z, &z);
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    let (mut iterations, mut indefinite) = (0, false);
    while iterations < limit && dot(&z, &z) > end {
        if iterations % 32 == 0 {
            exec.check_cancelled()?;
        }
        let q = tangent.times(&p);
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
        z = precondition(&r);
        let next = dot(&r, &z);
        let turn = next / rz;
        rz = next;
        p.par_iter_mut().zip(&z).with_min_len(ROWS).for_each(|(p, z)| {
            *p = [z[0] + turn * p[0], z[1] + turn * p[1], z[2] + turn * p[2]];
        });
        iterations += 1;
    }
    Ok(Found { values: x, iterations, indefinite })
}

/// The inverse of a diagonal block; of its trace where it isn't positive.
fn inverse(block: Matrix3<f64>) -> Matrix3<f64> {
    if block == Matrix3::zeros() {
        // Of a node that is held.
        return block;
    }
    block.cholesky().map_or_else(
        || Matrix3::from_diagonal_element(3.0 / block.trace().abs().max(f64::MIN_POSITIVE)),
        |c| c.inverse(),
    )
}
