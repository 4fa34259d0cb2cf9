//! A smooth field that multiplies the intensities, as the coils of a scanner leave it (after Wells, Grimson, Kikinis & Jolesz
//! 1996, who add one to the logarithms).
//!
//! A voxel's real value is taken for `gain · (a draw from the mixture)`. In turn, the mixture is fitted to the values divided
//! by the gains, and the gains are multiplied by what is left: at every node of a coarse lattice the weighted least squares of
//! `value / gain - factor · mean` over the voxels and components, weights falling off with the distance (Gaussian). Going on
//! with what is left, instead of fitting anew, mends what the averaging flattens at the borders. This isn't EM to
//! the letter: no likelihood is promised to rise. The gains' weighted mean is 1; without that they and the means would be
//! known up to a factor only.

use ivd_core::{Error, Exec, Iteration, Mask, Scalar as _, Volume, Voxels, parallel, with_voxels};
use serde::Serialize;

use super::bins::{self, Bins};
use super::covariance::Covariance;
use super::line::Density;
use super::mixture::{Component, Frame, INTENSITY};
use super::params::EmvsParams;
use super::search::Search;

/// Rounds of mixture and gains.
const ROUNDS: u64 = 30;
/// EM iterations of a round after the first.
const ITERATIONS: u64 = 10;
/// The gains stand still where none changes by more.
const STILL: f64 = 1e-3;
/// Gains beyond these aren't a scanner's.
const LEAST_GAIN: f64 = 0.1;
/// Voxels that a node stands for along an axis, at least.
const VOXELS: f64 = 4.0;
/// Nodes an axis, at most.
const MOST_NODES: f64 = 256.0;

/// Where the largest real value lies here, values are kept in real units.
const MODEST: std::ops::RangeInclusive<f64> = 1e-20..=1e30;

/// A smooth gain: real value = gain · corrected value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BiasField {
    /// Nodes along x, y, z.
    pub dims: [usize; 3],
    /// Distance of the nodes (voxels); node 0 lies at voxel 0.
    pub step: [f64; 3],
    /// Gain at each node, x fastest; trilinear between them.
    pub gains: Vec<f64>,
}

impl BiasField {
    fn flat(volume: &Volume, scale: f64) -> Self {
        let (dims, spacing) = (volume.grid().dims(), volume.grid().spacing());
        let length = |a: usize| (dims[a] - 1) as f64;
        let step = std::array::from_fn(|a| {
            (scale / spacing[a] / 2.0).max(VOXELS).max(length(a) / (MOST_NODES - 1.0))
        });
        let nodes = std::array::from_fn(|a| (length(a) / step[a]).ceil() as usize + 1);
        Self { dims: nodes, step, gains: vec![1.0; nodes.iter().product()] }
    }

    /// Node before a voxel along an axis, and how far the voxel is from it to the next, 0…1.
    fn before(&self, axis: usize, index: usize) -> (usize, f64) {
        let at = index as f64 / self.step[axis];
        let node = (at as usize).min(self.dims[axis].saturating_sub(2));
        (node, at - node as f64)
    }

    /// The gain at a voxel.
    pub fn at(&self, voxel: [usize; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|a| self.before(a, voxel[a]));
        self.blend(y, z, x)
    }

    fn blend(&self, y: (usize, f64), z: (usize, f64), x: (usize, f64)) -> f64 {
        let [nx, ny, nz] = self.dims;
        let gain = |i: usize, j: usize, k: usize| {
            self.gains[i.min(nx - 1) + nx * (j.min(ny - 1) + ny * k.min(nz - 1))]
        };
        let along_x = |j: usize, k: usize| gain(x.0, j, k) * (1.0 - x.1) + gain(x.0 + 1, j, k) * x.1;
        let along_y = |k: usize| along_x(y.0, k) * (1.0 - y.1) + along_x(y.0 + 1, k) * y.1;
        along_y(z.0) * (1.0 - z.1) + along_y(z.0 + 1) * z.1
    }

    /// The nodes' places of every index along an axis.
    fn placed(&self, axis: usize, len: usize) -> Vec<(usize, f64)> {
        (0..len).map(|i| self.before(axis, i)).collect()
    }

    /// The volume divided by the gains, in units of `unit` (a power of two, in real units); such a number stands for `slope`
    /// times it.
    fn correct(&self, volume: &Volume, unit: f64, slope: f64, exec: &Exec) -> Result<Volume, Error> {
        let [nx, ny, nz] = volume.grid().dims();
        let [x, y, z] = [(0, nx), (1, ny), (2, nz)].map(|(a, n)| self.placed(a, n));
        let mut corrected = exec.bulk::<f32>("the corrected volume", nx * ny * nz)?;
        with_voxels!(volume.voxels(), slice => {
            parallel::try_for_each_piece_mut(&mut corrected, nx, &|row, out| {
                exec.check_cancelled()?;
                let row_of = &slice[row * nx..][..nx];
                let (y, z) = (y[row % ny], z[row / ny]);
                for ((out, v), x) in out.iter_mut().zip(row_of).zip(&x) {
                    let real = volume.real(v.to_f64());
                    // A value beyond f64 is the largest there; one that is no data stays so.
                    let real = if v.is_data() { real.clamp(f64::MIN, f64::MAX) } else { real };
                    *out = (real / unit / self.blend(y, z, *x)) as f32;
                }
                Ok::<_, Error>(())
            })
        })?;
        let voxels = Voxels::F32(corrected.into_buffer());
        Volume::with_scale(volume.grid().clone(), voxels, slope, 0.0)
    }
}

/// The unit in which corrected values fit into `f32`: 1, where the largest lie well inside it.
fn unit(volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Result<f64, Error> {
    let extremes = with_voxels!(volume.voxels(), slice => bins::extremes(slice, mask, exec))?;
    let largest = extremes.map_or(0.0, |ends| {
        ends.map(|end| volume.real(end).abs().min(f64::MAX)).into_iter().fold(0.0, f64::max)
    });
    if largest == 0.0 || MODEST.contains(&largest) {
        return Ok(1.0);
    }
    Ok(2.0_f64.powi((largest.log2() as i32).clamp(-1000, 1000)))
}

/// The field of a volume, and the volume without it.
pub(super) fn remove(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &EmvsParams,
    exec: &Exec,
) -> Result<(Volume, BiasField), Error> {
    let mut field = BiasField::flat(volume, params.bias);
    let unit = unit(volume, mask, exec)?;
    let on_intensity = params.covariance == Covariance::Intensity;
    let k = params.k.or(params.start.as_ref().map(|start| start.weights.len()));
    let mut start = params.start.clone().filter(|_| on_intensity);
    if let Some(start) = &mut start {
        start.means.iter_mut().flatten().for_each(|mean| *mean /= unit);
        start.covariances.iter_mut().flatten().for_each(|v| *v = (*v / unit / unit).max(f64::MIN_POSITIVE));
    }
    let variance_added = params.variance_added / unit / unit;
    let mut params =
        EmvsParams { k, start, variance_added, covariance: Covariance::Intensity, ..params.clone() };
    let scale = params.bias;
    for index in 1..=ROUNDS {
        // In units of their own: squares of real ones may be beyond f64.
        let corrected = field.correct(volume, unit, 1.0, exec)?;
        let Some(bins) = Bins::of(&corrected, mask, exec)? else { break };
        let frame = Frame::new(&corrected, &bins);
        let (found, _) = Search::new(&corrected, mask, &bins, &frame, &params).choose(exec)?;
        let (gains, moved) =
            fitted(volume, mask, &corrected, &bins, &frame, &found.components, &field, scale, exec)?;
        field.gains = gains;
        exec.observer().iteration(Iteration { method: "emvs bias", index, value: moved });
        if moved < STILL {
            break;
        }
        let mixture = frame.mixture(&found.components, Covariance::Intensity);
        // A component that has lost all its voxels is no start.
        let usable = mixture.weights.iter().all(|w| *w > 0.0);
        params.k = Some(mixture.weights.len());
        params.start = usable.then_some(mixture);
        params.max_iterations = params.max_iterations.min(ITERATIONS);
    }
    Ok((field.correct(volume, unit, unit, exec)?, field))
}

/// Numerator and denominator of a node's gain.
type Fit = [f64; 2];

/// Gains of least squares, and the largest change.
#[expect(clippy::too_many_arguments, reason = "one call; what it needs has no other home")]
fn fitted(
    volume: &Volume,
    mask: Option<&Mask>,
    corrected: &Volume,
    bins: &Bins,
    frame: &Frame,
    components: &[Component],
    field: &BiasField,
    scale: f64,
    exec: &Exec,
) -> Result<(Vec<f64>, f64), Error> {
    let pulls = pulls(bins, frame, components);
    let Voxels::F32(divided) = corrected.voxels() else {
        unreachable!("the corrected volume is made of f32")
    };
    let mut fits = gather(divided, mask, volume.grid().dims(), bins, &pulls, field, exec)?;
    let spacing = volume.grid().spacing();
    for axis in 0..3 {
        blur(&mut fits, field.dims, axis, scale / spacing[axis] / field.step[axis]);
    }
    let left = |[above, below]: &Fit| if *below > 0.0 { above / below } else { 1.0 };
    let mut gains: Vec<f64> = field.gains.iter().zip(&fits).map(|(gain, fit)| gain * left(fit)).collect();
    let weights: f64 = fits.iter().map(|fit| fit[1]).sum();
    let mean = gains.iter().zip(&fits).map(|(gain, fit)| gain * fit[1]).sum::<f64>() / weights;
    if !(mean.is_finite() && mean > 0.0) {
        return Ok((field.gains.clone(), 0.0));
    }
    for gain in &mut gains {
        *gain = (*gain / mean).clamp(LEAST_GAIN, 1.0 / LEAST_GAIN);
    }
    let moved = gains.iter().zip(&field.gains).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    Ok((gains, moved))
}

/// For each bin `Σ r μ / σ²` and `Σ r μ² / σ²` over the components, in units that don't matter for their quotient.
fn pulls(bins: &Bins, frame: &Frame, components: &[Component]) -> Vec<Fit> {
    let densities: Vec<Density> = components.iter().map(Density::of).collect();
    let zero = frame.centre / frame.unit;
    let pull = |t: &f64| {
        let logs: Vec<f64> = densities.iter().map(|d| d.log(*t)).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = logs.iter().map(|log| super::exponential::exp(log - most)).collect();
        let all: f64 = shares.iter().sum();
        let mut fit = [0.0; 2];
        for (share, c) in shares.iter().zip(components) {
            let (mean, r) = (c.mean[INTENSITY] + zero, share / all / c.covariance[INTENSITY][INTENSITY]);
            fit[0] += r * mean;
            fit[1] += r * mean * mean;
        }
        fit
    };
    bins.value.iter().map(pull).collect()
}

/// Sums around each node: a voxel counts for the nearest. A task takes all voxels of one layer of nodes.
fn gather(
    divided: &[f32],
    mask: Option<&Mask>,
    [nx, ny, nz]: [usize; 3],
    bins: &Bins,
    pulls: &[Fit],
    field: &BiasField,
    exec: &Exec,
) -> Result<Vec<Fit>, Error> {
    let nearest = |a: usize, n: usize| -> Vec<usize> {
        (0..n).map(|i| ((i as f64 / field.step[a]).round() as usize).min(field.dims[a] - 1)).collect()
    };
    let [x, y, z] = [nearest(0, nx), nearest(1, ny), nearest(2, nz)];
    let unit = bins.unit;
    let mut fits = vec![[0.0; 2]; field.gains.len()];
    let layer = field.dims[0] * field.dims[1];
    parallel::try_for_each_piece_mut(&mut fits, layer, &|layer, fits| {
        for row in (0..nz).filter(|k| z[*k] == layer).flat_map(|k| k * ny..(k + 1) * ny) {
            exec.check_cancelled()?;
            for (i, node) in x.iter().enumerate() {
                let at = row * nx + i;
                if divided[at].is_finite() && mask.is_none_or(|m| m.inside()[at] != 0) {
                    let [pull, weight] = pulls[bins.bin(f64::from(divided[at])) as usize];
                    let fit = &mut fits[node + field.dims[0] * y[row % ny]];
                    fit[0] += pull * (f64::from(divided[at]) / unit);
                    fit[1] += weight;
                }
            }
        }
        Ok::<_, Error>(())
    })?;
    Ok(fits)
}

/// Gaussian sums along an axis; `sigma` in nodes.
fn blur(fits: &mut [Fit], dims: [usize; 3], axis: usize, sigma: f64) {
    let (n, stride) = (dims[axis], [1, dims[0], dims[0] * dims[1]][axis]);
    let weight = |d: usize| (-0.5 * (d as f64 / sigma).powi(2)).exp();
    let weights: Vec<f64> = (0..n).map(weight).collect();
    let starts = (0..fits.len()).filter(|i| i / stride % n == 0);
    for start in starts.collect::<Vec<_>>() {
        let line: Vec<Fit> = (0..n).map(|i| fits[start + i * stride]).collect();
        for i in 0..n {
            let sum = |part: usize| (0..n).map(|j| line[j][part] * weights[i.abs_diff(j)]).sum();
            fits[start + i * stride] = [sum(0), sum(1)];
        }
    }
}
