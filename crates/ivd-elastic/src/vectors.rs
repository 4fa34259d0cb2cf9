//! Vectors of three values a node, and sums over them.

use rayon::prelude::*;

/// A value for each axis of space.
pub type Triple = [f64; 3];

/// Rows, or cells, that one task does: enough to be worth its start, and the unit of sums whose order is fixed.
pub(crate) const ROWS: usize = 256;

/// `x ← x + s y`.
pub(crate) fn add(x: &mut [Triple], y: &[Triple], s: f64) {
    x.par_iter_mut().zip(y).with_min_len(ROWS).for_each(|(x, y)| {
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
