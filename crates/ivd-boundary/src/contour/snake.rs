//! A closed curve that follows edges (Kass, Witkin & Terzopoulos 1988).
//!
//! ```text
//! E = Σ stretch |v' |² + bend |v''|²  −  steepness(v)        a point, of points one edge of a voxel apart
//! ```
//!
//! with steepness the squared gradient of the smoothed slice, over its greatest. Steps are implicit in the curve and explicit in the slice; one
//! that doesn't lower the energy is halved.

use ivd_core::{Exec, Iteration, ParamError};
use nalgebra::{Cholesky, DMatrix, Dyn, Matrix2xX};

use super::params::ContourParams;
use super::slice::Slice;
use crate::Error;

/// Set, energies, iterations.
type Followed = (Vec<u8>, Vec<f64>, u32);

/// Weights of stretch and bend, and the Gaussian (voxels), where nothing is said.
const STRETCH: f64 = 0.02;
const BEND: f64 = 0.05;
const SCALE: f64 = 2.0;

/// Share of the energy below which steps end.
const STILL: f64 = 1e-7;

/// Follows edges from the circle.
///
/// # Errors
/// Nothing is left within; cancelled.
pub(super) fn follow(slice: &Slice, params: &ContourParams, exec: &Exec) -> Result<Followed, Error> {
    let steep = Steepness::of(slice, params.scale.unwrap_or(SCALE));
    let (stretch, bend) = (params.stretch.unwrap_or(STRETCH), params.bend.unwrap_or(BEND));
    let shortest = slice.edges[0].min(slice.edges[1]);
    check_radius(slice, shortest)?;
    let count = ((std::f64::consts::TAU * slice.radius / shortest) as usize).clamp(16, 1024);
    let mut curve = Matrix2xX::from_fn(count, |a, i| {
        let turn = std::f64::consts::TAU * i as f64 / count as f64;
        slice.middle[a] * slice.edges[a] + slice.radius * if a == 0 { turn.cos() } else { turn.sin() }
    });
    let apart = std::f64::consts::TAU * slice.radius / count as f64;
    let stiffness = stiffness(count, stretch, bend);
    let energy = |curve: &Matrix2xX<f64>| -> f64 {
        let inner = (curve * &stiffness).component_mul(curve).sum() / (apart * apart);
        let outer: f64 = curve.column_iter().map(|v| steep.at([v[0], v[1]])[0]).sum();
        inner - outer
    };
    let mut step = 1.0;
    let mut solved: Option<(f64, Cholesky<f64, Dyn>)> = None;
    let mut energies = vec![energy(&curve)];
    let mut iterations = 0;
    while iterations < params.iterations {
        exec.check_cancelled()?;
        iterations += 1;
        let factor = if let Some((_, factor)) = solved.take().filter(|(of, _)| *of == step) {
            factor
        } else {
            {
                let matrix = DMatrix::identity(count, count) + &stiffness * (2.0 * step / (apart * apart));
                matrix.cholesky().ok_or_else(|| too_stiff([stretch, bend], apart))?
            }
        };
        let pulled = Matrix2xX::from_fn(count, |a, i| {
            curve[(a, i)] + step * steep.at([curve[(0, i)], curve[(1, i)]])[1 + a]
        });
        let next: Matrix2xX<f64> = factor.solve(&pulled.transpose()).transpose();
        let now = energy(&next);
        let before = *energies.last().expect("the start's");
        exec.observer().iteration(Iteration {
            method: "contour",
            index: u64::from(iterations),
            value: now.min(before),
        });
        if now < before {
            solved = Some((step, factor));
            curve = next;
            energies.push(now);
            if before - now < STILL * before.abs().max(1.0) {
                break;
            }
        } else {
            step *= 0.5;
            if step < 1e-6 {
                break;
            }
        }
    }
    let inside = within(&curve, slice);
    if !inside.contains(&1) {
        let remedy = "start nearer to the edge, or with less stretch";
        return Err(Error::no_boundary("the contour has closed up", remedy));
    }
    Ok((inside, energies, iterations))
}

/// A circle of at least half a voxel that fits on the slice.
fn check_radius(slice: &Slice, shortest: f64) -> Result<(), Error> {
    let across = (0..2).map(|a| (slice.size[a] as f64 * slice.edges[a]).powi(2)).sum::<f64>().sqrt();
    if (0.5 * shortest..=across).contains(&slice.radius) {
        return Ok(());
    }
    let problem = format!("a circle of {} mm is none on this slice", slice.radius);
    Err(ParamError::new("radius", problem, format!("give {} … {across:.1}", 0.5 * shortest)).into())
}

/// A curve that is too stiff to be solved for: one more than a sum of squares has a root, but for the rounding of numbers.
fn too_stiff([stretch, bend]: [f64; 2], apart: f64) -> Error {
    let (field, weight) = if bend > stretch { ("bend", bend) } else { ("stretch", stretch) };
    let problem = format!("{weight} makes a curve of points {apart:.2e} mm apart too stiff to move");
    ParamError::new(field, problem, "give less").into()
}

/// Stretch and bend of a closed curve as a matrix.
fn stiffness(count: usize, stretch: f64, bend: f64) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(count, count);
    for i in 0..count {
        for (differences, weight) in [(&[-1.0, 1.0][..], stretch), (&[1.0, -2.0, 1.0][..], bend)] {
            for (j, a) in differences.iter().enumerate() {
                for (k, b) in differences.iter().enumerate() {
                    matrix[((i + j) % count, (i + k) % count)] += weight * a * b;
                }
            }
        }
    }
    matrix
}

/// Squared gradient of a smoothed slice, over its greatest, and its own gradient (1 / mm).
struct Steepness {
    size: [usize; 2],
    edges: [f64; 2],
    values: Vec<f64>,
}

impl Steepness {
    fn of(slice: &Slice, scale: f64) -> Self {
        let [w, h] = slice.size;
        let known = slice.values.iter().copied().filter(|v| !v.is_nan());
        let (count, sum) = known.fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
        let filled: Vec<f64> =
            slice.values.iter().map(|v| if v.is_nan() { sum / f64::max(count, 1.0) } else { *v }).collect();
        let smooth = smoothed(&smoothed(&filled, [w, h], 0, scale), [w, h], 1, scale);
        let at = |x: usize, y: usize| smooth[x + w * y];
        let mut values = Vec::with_capacity(w * h);
        for y in 0..h {
            for x in 0..w {
                let (x0, x1) = (x.saturating_sub(1), (x + 1).min(w - 1));
                let (y0, y1) = (y.saturating_sub(1), (y + 1).min(h - 1));
                let dx = (at(x1, y) - at(x0, y)) / ((x1 - x0).max(1) as f64 * slice.edges[0]);
                let dy = (at(x, y1) - at(x, y0)) / ((y1 - y0).max(1) as f64 * slice.edges[1]);
                values.push(dx * dx + dy * dy);
            }
        }
        let greatest = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        for value in &mut values {
            *value /= greatest;
        }
        Self { size: [w, h], edges: slice.edges, values }
    }

    /// The steepness at a place (mm), and its gradient.
    fn at(&self, place: [f64; 2]) -> [f64; 3] {
        let [w, h] = self.size;
        let mut low = [0; 2];
        let mut t = [0.0; 2];
        let mut held = [false; 2];
        for a in 0..2 {
            let last = self.size[a].saturating_sub(2);
            let voxel = place[a] / self.edges[a];
            held[a] = voxel < 0.0 || voxel > self.size[a] as f64 - 1.0;
            let voxel = voxel.clamp(0.0, self.size[a] as f64 - 1.0);
            low[a] = (voxel as usize).min(last);
            t[a] = voxel - low[a] as f64;
        }
        let of = |x: usize, y: usize| self.values[(low[0] + x).min(w - 1) + w * (low[1] + y).min(h - 1)];
        let rows = [0, 1].map(|y| of(0, y) + t[0] * (of(1, y) - of(0, y)));
        let slopes = [0, 1].map(|y| of(1, y) - of(0, y));
        let along = |a: usize, v: f64| if held[a] { 0.0 } else { v / self.edges[a] };
        [
            rows[0] + t[1] * (rows[1] - rows[0]),
            along(0, slopes[0] + t[1] * (slopes[1] - slopes[0])),
            along(1, rows[1] - rows[0]),
        ]
    }
}

/// Smoothed along an axis by a Gaussian (voxels); what lies beyond is as the last.
fn smoothed(values: &[f64], [w, h]: [usize; 2], axis: usize, scale: f64) -> Vec<f64> {
    let reach = (3.0 * scale).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach).map(|d| (-0.5 * (d as f64 / scale).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    (0..w * h)
        .map(|i| {
            let at = [i % w, i / w];
            let total: f64 = (-reach..=reach)
                .zip(&weights)
                .map(|(d, weight)| {
                    let mut other = at;
                    other[axis] = at[axis].saturating_add_signed(d).min([w, h][axis] - 1);
                    weight * values[other[0] + w * other[1]]
                })
                .sum();
            total / sum
        })
        .collect()
}

/// Voxels whose middles the curve goes round an odd number of times.
fn within(curve: &Matrix2xX<f64>, slice: &Slice) -> Vec<u8> {
    let [w, h] = slice.size;
    let count = curve.ncols();
    let mut inside = vec![0_u8; w * h];
    for y in 0..h {
        let level = y as f64 * slice.edges[1];
        let mut crossings: Vec<f64> = (0..count)
            .filter_map(|i| {
                let (a, b) = (curve.column(i), curve.column((i + 1) % count));
                ((a[1] <= level) != (b[1] <= level))
                    .then(|| a[0] + (level - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            })
            .collect();
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            for x in 0..w {
                let at = x as f64 * slice.edges[0];
                if pair[0] <= at && at < pair[1] {
                    inside[x + w * y] = 1;
                }
            }
        }
    }
    inside
}
