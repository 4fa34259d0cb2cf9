//! Densities of components with any covariance along a piece of a row, and the sums that a step of EM needs.
//!
//! Along x, `y` and `z` stand still, so that the quadratic form has six products a voxel.

use ivd_core::{Mask, Scalar};

use super::exponential::exp;
use super::factorisation::factor;
use super::line::log_weight;
use super::mixture::{AXES, Component, Frame, INTENSITY};
use super::rows::{PIECE, Piece, Values, pieces};
use super::sums::Sums;

/// Sums that are added side by side.
const LANES: usize = 4;
/// Voxels whose sums of densities, each between 1 and K, are multiplied before the logarithm is taken.
const PRODUCT: usize = 16;

/// `log(weight · density) = constant - ½ (p - mean)ᵀ P (p - mean)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quadratic {
    constant: f64,
    mean: [f64; AXES],
    precision: [[f64; AXES]; AXES],
}

impl Quadratic {
    /// On intensity alone.
    pub(super) fn on_intensity(c: &Component) -> Self {
        let density = super::line::Density::of(c);
        let mut precision = [[0.0; AXES]; AXES];
        precision[INTENSITY][INTENSITY] = 2.0 * density.half;
        Self { constant: density.constant, mean: c.mean, precision }
    }

    /// On space and intensity.
    pub(super) fn of(c: &Component) -> Self {
        let (lower, pivots) = factor(&c.covariance, &[0.0; AXES]);
        let mut inverse = lower;
        // Inverse of the unit lower triangle, column by column.
        for column in 0..AXES {
            for row in column + 1..AXES {
                let sum: f64 = (column..row).map(|i| lower[row][i] * inverse[i][column]).sum();
                inverse[row][column] = -sum;
            }
        }
        let mut precision = [[0.0; AXES]; AXES];
        for (a, row) in precision.iter_mut().enumerate() {
            for (b, entry) in row.iter_mut().enumerate() {
                *entry = (a.max(b)..AXES).map(|i| inverse[i][a] * inverse[i][b] / pivots[i]).sum();
            }
        }
        let logs: f64 = pivots.iter().map(|p| std::f64::consts::TAU.ln() + p.ln()).sum();
        Self { constant: log_weight(c.weight) - 0.5 * logs, mean: c.mean, precision }
    }

    /// Deviations of a piece's y and z from the mean.
    fn off(&self, piece: &Piece, frame: &Frame) -> [f64; 2] {
        [1, 2].map(|a| frame.place(a, piece.at[a]) - self.mean[a])
    }

    /// Logarithms along a piece; `x` holds the places along the first axis.
    pub(super) fn logs(&self, piece: &Piece, frame: &Frame, x: &[f64], t: &[f64], out: &mut [f64]) {
        let [dy, dz] = self.off(piece, frame);
        let p = &self.precision;
        let constant =
            self.constant - 0.5 * (p[1][1] * dy * dy + 2.0 * p[1][2] * dy * dz + p[2][2] * dz * dz);
        let along = p[0][1] * dy + p[0][2] * dz;
        let of_value = p[3][1] * dy + p[3][2] * dz;
        let [xx, xi, ii] = [0.5 * p[0][0], p[0][3], 0.5 * p[3][3]];
        let [mx, mi] = [self.mean[0], self.mean[3]];
        for ((out, x), t) in out.iter_mut().zip(x).zip(t) {
            let (dx, di) = (x - mx, t - mi);
            *out = constant - (dx * (xx * dx + along) + di * (ii * di + (of_value + xi * dx)));
        }
    }
}

/// Places along the first axis.
pub(super) fn places(frame: &Frame) -> Vec<f64> {
    (0..frame.dims[0]).map(|i| frame.place(0, i)).collect()
}

/// Turns logarithms into posteriors; gives the sum of the log-likelihoods of the data.
pub(super) fn posteriors(logs: &mut [[f64; PIECE]], len: usize, values: &Values) -> f64 {
    let mut most = logs[0];
    for logs in &logs[1..] {
        for (most, log) in most.iter_mut().zip(logs).take(len) {
            *most = if *log > *most { *log } else { *most };
        }
    }
    let mut all = [0.0; PIECE];
    for logs in &mut *logs {
        for ((log, most), all) in logs.iter_mut().zip(&most).zip(&mut all).take(len) {
            *log = exp(*log - *most);
            *all += *log;
        }
    }
    let mut likelihood = 0.0;
    for (((all, most), valid), i) in all.iter_mut().zip(&mut most).zip(&values.valid).zip(0..len) {
        if !values.all_valid && *valid == 0.0 {
            (*all, *most) = (1.0, 0.0);
        }
        likelihood += *most;
        let _ = i;
    }
    likelihood += all[..len].chunks(PRODUCT).map(|all| all.iter().product::<f64>().ln()).sum::<f64>();
    for (all, valid) in all.iter_mut().zip(&values.valid).take(len) {
        *all = valid / *all;
    }
    for logs in logs {
        logs.iter_mut().zip(&all).take(len).for_each(|(share, all)| *share *= all);
    }
    likelihood
}

/// The sums over the voxels `start … end - 1`, and their log-likelihood.
pub(super) fn expect<T: Scalar>(
    voxels: &[T],
    mask: Option<&Mask>,
    frame: &Frame,
    densities: &[Quadratic],
    [start, end]: [usize; 2],
) -> (Vec<Sums>, f64) {
    let x = places(frame);
    let mut values = Values::new();
    let mut logs = vec![[0.0; PIECE]; densities.len()];
    let mut sums = vec![Sums::default(); densities.len()];
    let mut likelihood = 0.0;
    for piece in pieces(frame.dims, start, end) {
        values.fill(voxels, mask, &piece, frame);
        let x = &x[piece.at[0]..piece.at[0] + piece.len];
        for (density, logs) in densities.iter().zip(&mut logs) {
            density.logs(&piece, frame, x, &values.t, logs);
        }
        likelihood += posteriors(&mut logs, piece.len, &values);
        for ((density, shares), sums) in densities.iter().zip(&logs).zip(&mut sums) {
            add(density, shares, &piece, frame, x, &values.t, sums);
        }
    }
    (sums, likelihood)
}

fn add(
    density: &Quadratic,
    shares: &[f64],
    piece: &Piece,
    frame: &Frame,
    x: &[f64],
    t: &[f64],
    sums: &mut Sums,
) {
    let (shares, t) = (&shares[..x.len()], &t[..x.len()]);
    let [mx, mi] = [density.mean[0], density.mean[3]];
    let mut lanes = [[0.0; LANES]; 6];
    let mut one = |lane: usize, r: f64, x: f64, t: f64| {
        let (dx, di) = (x - mx, t - mi);
        let (rx, ri) = (r * dx, r * di);
        for (sum, v) in lanes.iter_mut().zip([r, rx, rx * dx, ri, ri * di, rx * di]) {
            sum[lane] += v;
        }
    };
    let whole = x.len() / LANES * LANES;
    for ((shares, x), t) in shares.chunks_exact(LANES).zip(x.chunks_exact(LANES)).zip(t.chunks_exact(LANES)) {
        for lane in 0..LANES {
            one(lane, shares[lane], x[lane], t[lane]);
        }
    }
    for i in whole..x.len() {
        one(0, shares[i], x[i], t[i]);
    }
    let [n, dx, xx, di, ii, xi] = lanes.map(|sum| (sum[0] + sum[1]) + (sum[2] + sum[3]));
    let [dy, dz] = density.off(piece, frame);
    sums.n += n;
    for (sum, v) in sums.d.iter_mut().zip([dx, n * dy, n * dz, di]) {
        *sum += v;
    }
    let rows = [
        [xx, dx * dy, dx * dz, xi],
        [0.0, n * dy * dy, n * dy * dz, di * dy],
        [0.0, 0.0, n * dz * dz, di * dz],
        [0.0, 0.0, 0.0, ii],
    ];
    for (sums, row) in sums.dd.iter_mut().zip(rows) {
        sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
    }
}
