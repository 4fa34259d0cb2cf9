//! Sweeps over the voxels' distributions, and the mixture that is fitted to them.
//!
//! Beside the couplings acts an external field, see [`super::external`]. It is found anew before each sweep until it stands
//! still, or half of the sweeps are done; from then on the energy falls.

use ivd_core::{Error, Exec, Iteration};

use super::covariance::Covariance;
use super::external;
use super::features::Space;
use super::field::Field;
use super::labels::Scene;
use super::line::Sums;
use super::mixture::Component;
use super::params::EmvsParams;

/// The external field stands where no logarithm changes by more.
const STANDS: f64 = 1e-3;

/// What became of the mixture.
pub(super) struct Smoothed {
    pub(super) field: Field,
    pub(super) components: Vec<Component>,
    /// Free energy after each sweep since the external field stands, a voxel.
    pub(super) energies: Vec<f64>,
    pub(super) sweeps: u64,
    pub(super) converged: bool,
}

/// Sweeps until the energy stands still. On intensity alone the weights make way for an external field, means and variances are
/// renewed after each sweep, and the weights are the voxels' shares in the end; components over space stay as they are.
pub(super) fn smooth(
    scene: &Scene,
    space: &Space,
    params: &EmvsParams,
    exec: &Exec,
) -> Result<Smoothed, Error> {
    let mut components = scene.components.to_vec();
    let mut field = Field::new(scene, exec)?;
    let spacing = scene.volume.grid().spacing();
    let least = spacing.iter().copied().fold(f64::INFINITY, f64::min);
    let couplings = spacing.map(|s| params.smoothing * least / s);
    let mut energies: Vec<f64> = Vec::new();
    let (mut sweeps, mut converged) = (0, false);
    for colour in 0..2 {
        field.renew(scene, &components, colour, None, exec)?;
    }
    let on_intensity = scene.shape == Covariance::Intensity;
    let mut shares: Vec<f64> = components.iter().map(|c| c.weight).collect();
    let mut stands = !on_intensity;
    while !converged && sweeps < params.smoothing_iterations {
        sweeps += 1;
        if !stands {
            let weights: Vec<f64> = components.iter().map(|c| c.weight).collect();
            let external = external::field(&weights, &field, couplings, exec)?;
            let change = |(new, old): (&f64, &f64)| (new / old).ln().abs();
            let moved = external.iter().zip(&weights).filter(|(_, old)| **old > 0.0).map(change);
            stands = moved.fold(0.0, f64::max) <= STANDS || 2 * sweeps > params.smoothing_iterations;
            components.iter_mut().zip(external).for_each(|(c, weight)| c.weight = weight);
            energies.clear();
        }
        let mut red = field.renew(scene, &components, 0, Some(couplings), exec)?;
        let black = field.renew(scene, &components, 1, Some(couplings), exec)?;
        // A pair of neighbours counts once: with its black voxel.
        let energy = (red.alone + black.coupled) / scene.bins.total;
        exec.observer().iteration(Iteration { method: "emvs smoothing", index: sweeps, value: energy });
        let last = energies.last().copied();
        energies.push(energy);
        converged = stands && last.is_some_and(|last| last - energy < params.tolerance);
        red.join(&black);
        if on_intensity {
            // Above 0, so that the mixture can be begun with again.
            let share = |sums: &Sums| (sums.n / scene.bins.total).max(f64::MIN_POSITIVE);
            shares.iter_mut().zip(&red.sums).for_each(|(own, sums)| *own = share(sums));
            if !converged && sweeps < params.smoothing_iterations {
                maximise(&mut components, &red.sums, space);
            }
        }
    }
    components.iter_mut().zip(shares).for_each(|(c, share)| c.weight = share);
    field.order = scene.frame.order(&components);
    let components = field.order.iter().map(|k| components[*k]).collect();
    Ok(Smoothed { field, components, energies, sweeps, converged })
}

/// Means and variances of greatest expected likelihood, the weights as they are.
fn maximise(components: &mut [Component], sums: &[Sums], space: &Space) {
    let weights: Vec<f64> = components.iter().map(|c| c.weight).collect();
    super::line::maximise(components, sums, space.bins.total, &space.limits);
    components.iter_mut().zip(weights).for_each(|(c, weight)| c.weight = weight);
}
