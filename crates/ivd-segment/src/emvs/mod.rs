//! Expectation-maximisation volume segmentation: a mixture of normal densities, and every voxel to its likeliest component.

mod bias;
mod bins;
mod covariance;
mod exponential;
mod external;
mod factorisation;
mod features;
mod field;
mod interior;
mod labels;
mod line;
mod mixture;
mod params;
mod quadratic;
mod rows;
mod search;
mod smooth;
mod start;
mod sums;
mod tables;
#[cfg(test)]
mod tests;

use ivd_core::{Buffer, Exec, Labels, Mask, Volume};

use crate::{Error, Segmentation, segmentation, selection};
pub use bias::BiasField;
use bins::Bins;
pub use covariance::Covariance;
use labels::Scene;
use line::Found;
use mixture::Frame;
pub use mixture::Mixture;
pub use params::EmvsParams;
pub use search::BicPoint;
use search::Search;

/// What EMVS found.
#[derive(Debug, Clone, PartialEq)]
pub struct Emvs {
    /// Labels and classes. Its objective is the mean log-likelihood of a voxel, see [`Emvs::log_likelihood`]; its gap is 0,
    /// for EM finds a local maximum and knows nothing of others.
    pub segmentation: Segmentation,
    /// The components, in the order of their mean intensity; also those that are nowhere the likeliest and so have no class.
    pub mixture: Mixture,
    /// Mean over the voxels of the logarithm of the mixture's density: of the intensity (1/real unit), or of place and
    /// intensity (1/(mm³ · real unit)).
    pub log_likelihood: f64,
    /// The criterion for every number of components that was tried; empty where `k` was given.
    pub bic: Vec<BicPoint>,
    /// With `smoothing`: the variational free energy after each sweep since the external field stands, a voxel; it never rises.
    pub energies: Vec<f64>,
    /// With `bias`: the field that was taken out. Classes are described by the values as they are; the mixture and the
    /// labels are those of the values without it.
    pub bias: Option<BiasField>,
}

/// Fits a mixture of K normal densities to a volume by expectation and maximisation (Dempster, Laird & Rubin 1977), and gives
/// every voxel the component of greatest posterior probability; of equal ones that of the lower mean.
///
/// - On intensity alone the work is done on the histogram: O(N + bins · K · iterations). It is exact for 8 and 16 bit types,
///   and for others where at most 2¹⁶ values occur, evenly spread. Otherwise values are gathered in 2¹⁶ bins between robust
///   extremes, each with its exact mean and spread; the responsibilities are then those of the bin, the likelihood is a lower
///   bound, and labels are cut at the exact values where posteriors are equal.
/// - With [`Covariance::Diagonal`] and [`Covariance::Full`] the components live in space and intensity: exact, every voxel in
///   every iteration, O(N · K). Places are voxel indices times the spacing (mm): the axes of a sheared grid are measured as
///   perpendicular.
///
/// The likelihood never falls, apart from rounding and `variance_added`. The search begins at the classes of least inertia,
/// and ends in a local maximum. Where there are more than 2048 bins it begins on about a thousand coarse ones. Values share
/// one density: what rounding to 8 bits does isn't modelled, apart from the variance's floor.
///
/// With `smoothing` β > 0 labels are coupled to the neighbours' (Potts model, mean field): along axis a with
/// `β · (least spacing / spacing of a)`. On intensity alone the mixture itself is fitted to coupled voxels (Zhang, Brady & Smith
/// 2001), from the classes of least inertia on: means, variances, and in the weights' place an external field, found by the
/// coding method (Besag 1974), as the neighbours already say most of what weights say. The mixture's weights are the voxels'
/// shares then, and `max_iterations` counts only where the number of components is chosen. Components over space stay as EM left
/// them. The distributions are kept in steps of 1/255: N · K bytes. The labels are the greatest shares.
///
/// With `bias` > 0 a smooth gain is found first, on intensity alone, and divided out (see [`BiasField`]): N · 4 bytes more.
/// Real values must then be 0 where there is no signal.
///
/// A volume without data has no components, and all its labels are 0. With fewer values than `k` there are as many components
/// as values. Results are the same bytes for any number of threads, and for any storage type on intensity alone where the
/// stored values are equal. The exponential is this crate's own; the logarithm is the system's (the reference is Linux on x86-64):
/// its last digit decides about nothing but, in theory, the iteration in which the search ends.
///
/// # Errors
/// [`Error`]: a bad parameter, a mask on another grid, the memory limit, or cancelled.
pub fn emvs(volume: &Volume, mask: Option<&Mask>, params: &EmvsParams, exec: &Exec) -> Result<Emvs, Error> {
    Ok(found(volume, mask, params, false, exec)?.0)
}

/// As [`emvs`], with the posterior probability of every component of the mixture at every voxel, shape `[K][voxels]`; 0 where there
/// is no datum.
///
/// # Errors
/// Those of [`emvs`].
pub fn emvs_with_posteriors(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &EmvsParams,
    exec: &Exec,
) -> Result<(Emvs, Vec<Buffer<f32>>), Error> {
    found(volume, mask, params, true, exec)
}

fn found(
    volume: &Volume,
    mask: Option<&Mask>,
    params: &EmvsParams,
    with_posteriors: bool,
    exec: &Exec,
) -> Result<(Emvs, Vec<Buffer<f32>>), Error> {
    params.check()?;
    exec.run(|| {
        let scope = selection::of(volume, mask, params.within, exec)?;
        let mask = scope.as_deref();
        if params.bias == 0.0 {
            return fit(volume, volume, mask, params, with_posteriors, exec);
        }
        let (corrected, bias) = bias::remove(volume, mask, params, exec)?;
        let (found, posteriors) = fit(&corrected, volume, mask, params, with_posteriors, exec)?;
        Ok((Emvs { bias: Some(bias), ..found }, posteriors))
    })
}

/// The mixture of a volume, and labels with the figures of the `original`.
fn fit(
    volume: &Volume,
    original: &Volume,
    mask: Option<&Mask>,
    params: &EmvsParams,
    with_posteriors: bool,
    exec: &Exec,
) -> Result<(Emvs, Vec<Buffer<f32>>), Error> {
    let Some(bins) = Bins::of(volume, mask, exec)? else {
        return Ok((nothing(original, mask, exec)?, Vec::new()));
    };
    let frame = Frame::new(volume, &bins);
    let search = Search::new(volume, mask, &bins, &frame, params);
    let shape = params.covariance;
    let smooths = params.smoothing > 0.0 && params.smoothing_iterations > 0;
    let (mut found, bic) = if smooths && shape == Covariance::Intensity {
        search.beginning(exec)?
    } else {
        search.choose(exec)?
    };
    frame.sort(&mut found.components);
    let components = &found.components[..];
    let scene = Scene { volume, original, mask, bins: &bins, frame: &frame, shape, components };
    let outcome = if smooths {
        smoothed(&scene, &search, &found, params, with_posteriors, exec)?
    } else {
        let posteriors = if with_posteriors { scene.posteriors(exec)? } else { Vec::new() };
        Outcome { labels: scene.labels(exec)?, posteriors, energies: Vec::new(), found: found.clone() }
    };
    let Outcome { labels, posteriors, energies, found } = outcome;
    let log_likelihood = found.log_likelihood + frame.log_unit(shape);
    let found = Emvs {
        segmentation: Segmentation {
            k: labels.classes().len(),
            labels,
            iterations: found.iterations,
            converged: found.converged,
            objective: log_likelihood,
            visited_fraction: segmentation::visited(volume, mask),
            gap: 0.0,
        },
        mixture: frame.mixture(&found.components, shape),
        log_likelihood,
        bic,
        energies,
        bias: None,
    };
    Ok((found, posteriors))
}

/// What the voxels get.
struct Outcome {
    labels: Labels,
    posteriors: Vec<Buffer<f32>>,
    energies: Vec<f64>,
    found: Found,
}

/// Labels of voxels coupled to their neighbours.
fn smoothed(
    scene: &Scene,
    search: &Search,
    found: &Found,
    params: &EmvsParams,
    with_posteriors: bool,
    exec: &Exec,
) -> Result<Outcome, Error> {
    let smooth::Smoothed { field, components, energies, sweeps, converged } =
        smooth::smooth(scene, &search.space, params, exec)?;
    let posteriors = if with_posteriors { field.posteriors(exec)? } else { Vec::new() };
    let ids = field.labels(exec)?;
    drop(field);
    let labels = scene.described(ids, exec)?;
    let log_likelihood = match scene.shape {
        Covariance::Intensity => line::expect(scene.bins, &components).1,
        _ => found.log_likelihood,
    };
    let iterations = found.iterations + sweeps;
    let found = Found { components, log_likelihood, iterations, converged: found.converged && converged };
    Ok(Outcome { labels, posteriors, energies, found })
}

/// The result for a volume without data.
fn nothing(volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Result<Emvs, Error> {
    Ok(Emvs {
        segmentation: Segmentation {
            labels: labels::none(volume, exec)?,
            k: 0,
            iterations: 0,
            converged: true,
            objective: 0.0,
            visited_fraction: segmentation::visited(volume, mask),
            gap: 0.0,
        },
        mixture: Mixture::default(),
        log_likelihood: 0.0,
        bic: Vec::new(),
        energies: Vec::new(),
        bias: None,
    })
}
