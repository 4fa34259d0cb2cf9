use ivd_core::{Exec, Mask, Volume};
use serde::Serialize;

use super::bins::Bins;
use super::covariance::Covariance;
use super::features::Space;
use super::interior;
use super::line::{self, Found, Limits};
use super::mixture::{Component, Frame, INTENSITY, Mixture};
use super::params::EmvsParams;
use super::start;
use crate::Error;

/// How well a number of components explains the data: on intensity, the voxels amid one material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BicPoint {
    /// Number of components.
    pub k: usize,
    /// Mean log-likelihood of a voxel.
    pub log_likelihood: f64,
    /// Bayesian information criterion (Schwarz 1978), `p ln N - 2 N log_likelihood` for `p` free parameters: less is better.
    pub bic: f64,
    /// On intensity: integrated completed likelihood (Biernacki, Celeux & Govaert 2000), `bic + 2 N entropy` with the mean entropy of a
    /// voxel's posteriors: less is better.
    pub icl: Option<f64>,
}

impl BicPoint {
    /// What the number of components is chosen by: less is better.
    pub fn criterion(&self) -> f64 {
        self.icl.unwrap_or(self.bic)
    }
}

/// A search for a mixture: over intensity, or over space and intensity.
pub(super) struct Search<'a> {
    params: &'a EmvsParams,
    bins: &'a Bins,
    coarse: Option<Bins>,
    pub(super) space: Space<'a>,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        volume: &'a Volume,
        mask: Option<&'a Mask>,
        bins: &'a Bins,
        frame: &'a Frame,
        params: &'a EmvsParams,
    ) -> Self {
        let share = params.variance_floor;
        // A voxel has an extent, as a stored value has a step: (1 / n)² / 12 of the axis.
        let place = |a: usize| {
            let n = frame.dims[a] as f64;
            if share == 0.0 { 1e-12 } else { (share / 12.0).max(1.0 / (12.0 * n * n)) }
        };
        let limits = Limits {
            iterations: params.max_iterations,
            tolerance: params.tolerance,
            floor: [place(0), place(1), place(2), start::floor(bins, share)],
            added: std::array::from_fn(|a| frame.variance(a, params.variance_added)),
        };
        let space = Space { volume, mask, bins, frame, shape: params.covariance, limits };
        Self { params, bins, coarse: bins.coarse(), space }
    }

    /// The mixture asked for, or that of the best number of components, and the criterion of each number.
    pub(super) fn choose(&self, exec: &Exec) -> Result<(Found, Vec<BicPoint>), Error> {
        if let Some(start) = &self.params.start {
            return Ok((self.from(self.space.frame.components(start), exec)?, Vec::new()));
        }
        if let Some(k) = self.params.k {
            return Ok((self.with(k, exec)?, Vec::new()));
        }
        if self.params.covariance != Covariance::Intensity {
            return self.best(exec);
        }
        let (mixture, curve) = self.amid(exec)?;
        Ok((self.from(self.space.frame.components(&mixture), exec)?, curve))
    }

    /// The best mixture on intensity of the voxels that lie amid one material, and the criterion of each number of components.
    fn amid(&self, exec: &Exec) -> Result<(Mixture, Vec<BicPoint>), Error> {
        let Space { volume, mask, .. } = self.space;
        let inner = interior::amid(volume, mask, exec)?;
        let bins = Bins::of(volume, Some(&inner), exec)?.expect("of a volume's values the least steep stay");
        let frame = Frame::new(volume, &bins);
        let (found, curve) = Search::new(volume, Some(&inner), &bins, &frame, self.params).best(exec)?;
        Ok((frame.mixture(&found.components, self.params.covariance), curve))
    }

    /// The best of the numbers of components, and the criterion of each.
    fn best(&self, exec: &Exec) -> Result<(Found, Vec<BicPoint>), Error> {
        let mut best: Option<(Found, f64)> = None;
        let mut curve: Vec<BicPoint> = Vec::new();
        for k in 1..=self.params.k_max {
            let found = self.with(k, exec)?;
            // Fewer values than components: the curve ends.
            if found.components.len() < k {
                break;
            }
            let point = self.point(k, &found);
            curve.push(point);
            if best.as_ref().is_none_or(|(_, least)| point.criterion() < *least) {
                best = Some((found, point.criterion()));
            }
        }
        let (found, _) = best.expect("one component is always found");
        Ok((found, curve))
    }

    fn point(&self, k: usize, found: &Found) -> BicPoint {
        let shape = self.params.covariance;
        let log_likelihood = found.log_likelihood + self.space.frame.log_unit(shape);
        let bic = start::criterion(log_likelihood, self.bins.total, shape.free(k));
        let icl = (shape == Covariance::Intensity)
            .then(|| bic + 2.0 * self.bins.total * line::entropy(self.bins, &found.components));
        BicPoint { k, log_likelihood, bic, icl }
    }

    /// Where voxels coupled on intensity begin: at the mixture given, or at the classes of least inertia, as many as are asked
    /// for or as the criterion prefers. Plain EM's mixture is another optimum, one in which noise has components of its own.
    pub(super) fn beginning(&self, exec: &Exec) -> Result<(Found, Vec<BicPoint>), Error> {
        let (k, iterations, bic) = match (&self.params.start, self.params.k) {
            (None, None) => {
                let (mixture, curve) = self.amid(exec)?;
                (mixture.weights.len(), 0, curve)
            }
            (_, k) => (k.unwrap_or(0), 0, Vec::new()),
        };
        let mut components = match &self.params.start {
            Some(start) => self.space.frame.components(start),
            None => self.classes(k),
        };
        for c in &mut components {
            let variance = &mut c.covariance[INTENSITY][INTENSITY];
            *variance = variance.max(self.space.limits.floor[INTENSITY]);
        }
        let (_, log_likelihood) = line::expect(self.bins, &components);
        Ok((Found { components, log_likelihood, iterations, converged: true }, bic))
    }

    fn classes(&self, k: usize) -> Vec<Component> {
        let floor = self.space.limits.floor[INTENSITY];
        start::classes(self.coarse.as_ref().unwrap_or(self.bins), k, floor)
    }

    /// From the classes of least inertia.
    pub(super) fn with(&self, k: usize, exec: &Exec) -> Result<Found, Error> {
        let classes = self.classes(k);
        if self.params.covariance == Covariance::Intensity {
            let coarse = self.coarse.as_ref();
            return line::search_from_coarse(self.bins, coarse, classes, &self.space.limits, exec);
        }
        let placed = self.space.placed(&classes, exec)?;
        self.from(placed, exec)
    }

    pub(super) fn from(&self, components: Vec<Component>, exec: &Exec) -> Result<Found, Error> {
        Ok(match self.params.covariance {
            Covariance::Intensity => line::search(self.bins, components, &self.space.limits, exec)?,
            _ => self.space.search(components, exec)?,
        })
    }
}
