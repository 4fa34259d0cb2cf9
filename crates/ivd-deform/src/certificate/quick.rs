//! A cheap lower bound of the determinant in each cell of a block, single precision, eight cells at a time where the processor can.
//!
//! Along an edge of a cell the map's derivative is the difference of two corners, and the four edges of a direction span an
//! interval for each component. Every Bernstein coefficient of the determinant is a mean of determinants whose columns are
//! such edges, so with `C` the intervals' middles and `R` their radii
//!
//! ```text
//! coefficient ≥ det C − (perm(|C| + R) − perm(|C|))
//! ```
//!
//! where `perm` is the permanent: what all six products can lose.

use nalgebra::Vector3;

/// Rounding of a coordinate (relative to the largest), and of the bound (relative to the permanent): ten times what the few
/// operations on `f32` can lose.
const COORDINATE: f32 = 1e-6;
const BOUND: f32 = 1e-5;

/// Lower bounds of the cells between `size` voxels that move by `values` (voxels), x fastest, a cell less along every axis than
/// voxels. Not a number where single precision doesn't hold it.
pub(super) fn bounds(values: &[Vector3<f64>], size: [usize; 3]) -> Vec<f32> {
    let strides = [1, size[0], size[0] * size[1]];
    // One more than the place of the last cell's lowest corner.
    let count = values.len() - strides.iter().sum::<usize>();
    let mut most = 0.0_f32;
    let by_axis: [Vec<f32>; 3] = std::array::from_fn(|c| values.iter().map(|u| u[c] as f32).collect());
    for v in by_axis.iter().flatten() {
        most = if v.abs() <= most { most } else { v.abs() };
    }
    let slack = COORDINATE * most;
    // Middles and radii by component and direction.
    let mut middle: [[Vec<f32>; 3]; 3] = Default::default();
    let mut radius: [[Vec<f32>; 3]; 3] = Default::default();
    for (c, u) in by_axis.iter().enumerate() {
        for a in 0..3 {
            let [s, t] = [strides[(a + 1) % 3], strides[(a + 2) % 3]];
            let difference: Vec<f32> = u.iter().zip(&u[strides[a]..]).map(|(low, high)| high - low).collect();
            let own = if a == c { 1.0 } else { 0.0 };
            (middle[c][a], radius[c][a]) = intervals(&difference, [s, t], count, own, slack);
        }
    }
    let flat = determinants(&middle, &radius, count);
    let mut out = Vec::with_capacity((size[0] - 1) * (size[1] - 1) * (size[2] - 1));
    for z in 0..size[2] - 1 {
        for y in 0..size[1] - 1 {
            let row = strides[1] * y + strides[2] * z;
            out.extend_from_slice(&flat[row..row + size[0] - 1]);
        }
    }
    out
}

/// Middle and radius of the four edges at every voxel, `own` added to the middle and `slack` to the radius.
fn intervals(d: &[f32], [s, t]: [usize; 2], count: usize, own: f32, slack: f32) -> (Vec<f32>, Vec<f32>) {
    let mut middle = vec![0.0; count];
    let mut radius = vec![0.0; count];
    let edges = (&d[..count], &d[s..s + count], &d[t..t + count], &d[s + t..s + t + count]);
    for i in 0..count {
        let (p, q, r, v) = (edges.0[i], edges.1[i], edges.2[i], edges.3[i]);
        let (low, high) = (smaller(smaller(p, q), smaller(r, v)), larger(larger(p, q), larger(r, v)));
        middle[i] = own + 0.5 * (low + high);
        radius[i] = 0.5 * (high - low) + slack;
    }
    (middle, radius)
}

fn determinants(middle: &[[Vec<f32>; 3]; 3], radius: &[[Vec<f32>; 3]; 3], count: usize) -> Vec<f32> {
    let mut out = vec![0.0; count];
    let m: [[&[f32]; 3]; 3] = middle.each_ref().map(|row| row.each_ref().map(|v| &v[..count]));
    let r: [[&[f32]; 3]; 3] = radius.each_ref().map(|row| row.each_ref().map(|v| &v[..count]));
    for (i, bound) in out.iter_mut().enumerate() {
        let c = |a: usize, b: usize| m[a][b][i];
        let p = |a: usize, b: usize| m[a][b][i].abs();
        let w = |a: usize, b: usize| m[a][b][i].abs() + r[a][b][i];
        let det = c(0, 0) * (c(1, 1) * c(2, 2) - c(1, 2) * c(2, 1))
            - c(0, 1) * (c(1, 0) * c(2, 2) - c(1, 2) * c(2, 0))
            + c(0, 2) * (c(1, 0) * c(2, 1) - c(1, 1) * c(2, 0));
        let plain = p(0, 0) * (p(1, 1) * p(2, 2) + p(1, 2) * p(2, 1))
            + p(0, 1) * (p(1, 0) * p(2, 2) + p(1, 2) * p(2, 0))
            + p(0, 2) * (p(1, 0) * p(2, 1) + p(1, 1) * p(2, 0));
        let wide = w(0, 0) * (w(1, 1) * w(2, 2) + w(1, 2) * w(2, 1))
            + w(0, 1) * (w(1, 0) * w(2, 2) + w(1, 2) * w(2, 0))
            + w(0, 2) * (w(1, 0) * w(2, 1) + w(1, 1) * w(2, 0));
        *bound = det - (wide - plain) - BOUND * wide;
    }
    out
}

fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
