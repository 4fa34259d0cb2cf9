//! A mixture of normal densities: as it is given to the caller, and in the frame that the work is done in.

use std::cmp::Ordering;

use ivd_core::Volume;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bins::Bins;
use super::covariance::Covariance;

/// Dimensions of the frame: x, y, z, intensity. A mixture on intensity alone uses the last.
pub(super) const AXES: usize = 4;
/// Place of the intensity among the axes.
pub(super) const INTENSITY: usize = 3;

/// A mixture of normal densities, components in the order of their mean intensity.
///
/// Intensities are real values; places are in mm along the axes of the grid, from the centre of voxel 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mixture {
    /// Share of each component, sum 1; shape `[K]`.
    #[schemars(extend("x-unit" = "1"))]
    pub weights: Vec<f64>,
    /// Means: `[intensity]`, or `[x, y, z, intensity]`.
    pub means: Vec<Vec<f64>>,
    /// Covariances: `[variance]` of the intensity; or the four variances; or the 4 × 4 matrix, row by row.
    pub covariances: Vec<Vec<f64>>,
}

impl Mixture {
    /// Means of two components on intensity alone, of which the first is the likeliest on both sides of the second; of several such two those
    /// nearest to one another. What lies below the lowest mean isn't looked at: hardly any value does.
    pub fn around(&self) -> Option<[f64; 2]> {
        if self.means.iter().any(|mean| mean.len() != 1) {
            return None;
        }
        let normal = |k: usize| (self.weights[k], self.means[k][0], self.covariances[k][0]);
        let log = |k: usize, v: f64| {
            let (weight, mean, variance) = normal(k);
            weight.max(f64::MIN_POSITIVE).ln() - 0.5 * (variance.ln() + (v - mean).powi(2) / variance)
        };
        let likeliest = |v: f64| {
            (0..self.weights.len()).reduce(|best, k| if log(k, v) > log(best, v) { k } else { best })
        };
        // Where components change places, they do so within a few standard deviations of some mean.
        let mut values: Vec<f64> = (0..self.weights.len())
            .flat_map(|k| {
                let (_, mean, variance) = normal(k);
                (-12..=12).map(move |step| mean + 0.25 * f64::from(step) * variance.sqrt())
            })
            .collect();
        let lowest = self.means.iter().map(|mean| mean[0]).fold(f64::INFINITY, f64::min);
        values.retain(|v| *v >= lowest);
        values.sort_unstable_by(f64::total_cmp);
        let mut order: Vec<usize> = values.into_iter().filter_map(likeliest).collect();
        order.dedup();
        let around = (0..order.len()).filter_map(|i| {
            let before = order[..i].iter().rposition(|k| *k == order[i])?;
            Some([order[i], order[before + 1]].map(|k| self.means[k][0]))
        });
        around.min_by(|a, b| (a[0] - a[1]).abs().total_cmp(&(b[0] - b[1]).abs()))
    }

    /// The variances along the axes, of each component.
    pub(super) fn variances(&self) -> Vec<Vec<f64>> {
        let diagonal = |c: &Vec<f64>| if c.len() == 16 { vec![c[0], c[5], c[10], c[15]] } else { c.clone() };
        self.covariances.iter().map(diagonal).collect()
    }
}

/// One component, in the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Component {
    pub(super) weight: f64,
    pub(super) mean: [f64; AXES],
    pub(super) covariance: [[f64; AXES]; AXES],
}

impl Component {
    /// A component on intensity alone.
    pub(super) fn on_intensity(weight: f64, mean: f64, variance: f64) -> Self {
        let mut own = Self { weight, mean: [0.0; AXES], covariance: [[0.0; AXES]; AXES] };
        own.mean[INTENSITY] = mean;
        own.covariance[INTENSITY][INTENSITY] = variance;
        own
    }
}

/// From voxel indices and stored values to the numbers that the work is done with: near 0, of the order of 1.
///
/// A place along an axis of n voxels is `(i - (n - 1) / 2) / n`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub(super) dims: [usize; 3],
    /// Value of 0, and what 1 stands for, in stored units.
    pub(super) centre: f64,
    pub(super) unit: f64,
    /// Length of 1 along the axes (mm), and in real values.
    factors: [f64; AXES],
    slope: f64,
    intercept: f64,
    spacing: [f64; 3],
}

impl Frame {
    pub(super) fn new(volume: &Volume, bins: &Bins) -> Self {
        let (dims, spacing) = (volume.grid().dims(), volume.grid().spacing());
        let along = |a: usize| dims[a] as f64 * spacing[a];
        Self {
            dims,
            centre: bins.centre,
            unit: bins.unit,
            factors: [along(0), along(1), along(2), volume.slope() * bins.unit],
            slope: volume.slope(),
            intercept: volume.intercept(),
            spacing,
        }
    }

    /// The number of a voxel index along an axis.
    pub(super) fn place(&self, axis: usize, index: usize) -> f64 {
        (index as f64 - (self.dims[axis] as f64 - 1.0) / 2.0) / self.dims[axis] as f64
    }

    /// The number of a stored value.
    #[inline(always)]
    pub(super) fn value(&self, stored: f64) -> f64 {
        stored / self.unit - self.centre / self.unit
    }

    /// What is added to the log-density of a voxel for real units and mm.
    pub(super) fn log_unit(&self, covariance: Covariance) -> f64 {
        let used = &self.factors[AXES - covariance.dimensions()..];
        -used.iter().map(|f| f.abs().ln()).sum::<f64>()
    }

    /// A variance in real units (mm) along an axis, in the frame.
    pub(super) fn variance(&self, axis: usize, real: f64) -> f64 {
        real / self.factors[axis] / self.factors[axis]
    }

    /// Components of a mixture in real units.
    pub(super) fn components(&self, mixture: &Mixture) -> Vec<Component> {
        let total: f64 = mixture.weights.iter().sum();
        let parts = mixture.weights.iter().zip(&mixture.means).zip(&mixture.covariances);
        parts.map(|((weight, mean), covariance)| self.component(weight / total, mean, covariance)).collect()
    }

    fn component(&self, weight: f64, mean: &[f64], covariance: &[f64]) -> Component {
        let mut own = Component::on_intensity(weight, 0.0, 0.0);
        let stored = (mean[mean.len() - 1] - self.intercept) / self.slope;
        own.mean[INTENSITY] = self.value(stored);
        if mean.len() == AXES {
            for a in 0..3 {
                let middle = (self.dims[a] as f64 - 1.0) / 2.0;
                own.mean[a] = (mean[a] / self.spacing[a] - middle) / self.dims[a] as f64;
            }
        }
        for a in 0..AXES {
            for b in 0..AXES {
                let real = match covariance.len() {
                    16 => covariance[AXES * a + b],
                    4 if a == b => covariance[a],
                    1 if a == b && a == INTENSITY => covariance[0],
                    _ => 0.0,
                };
                own.covariance[a][b] = real / self.factors[a] / self.factors[b];
            }
        }
        own
    }

    /// The mixture in real units.
    pub(super) fn mixture(&self, components: &[Component], shape: Covariance) -> Mixture {
        let finite = |v: f64| v.clamp(f64::MIN, f64::MAX);
        let mut found = Mixture::default();
        for c in components {
            let intensity = self.slope * (self.centre + c.mean[INTENSITY] * self.unit) + self.intercept;
            let along = |a: usize| {
                (c.mean[a] * self.dims[a] as f64 + (self.dims[a] as f64 - 1.0) / 2.0) * self.spacing[a]
            };
            let real = |a: usize, b: usize| finite(c.covariance[a][b] * self.factors[a] * self.factors[b]);
            found.weights.push(c.weight);
            let (mean, covariance) = match shape {
                Covariance::Intensity => (vec![intensity], vec![real(INTENSITY, INTENSITY)]),
                Covariance::Diagonal => {
                    (vec![along(0), along(1), along(2), intensity], (0..AXES).map(|a| real(a, a)).collect())
                }
                Covariance::Full => (
                    vec![along(0), along(1), along(2), intensity],
                    (0..16).map(|i| real(i / AXES, i % AXES)).collect(),
                ),
            };
            found.means.push(mean.into_iter().map(finite).collect());
            found.covariances.push(covariance);
        }
        found
    }

    /// Puts components in the order of their real means; the heavier first where they are equal.
    pub(super) fn sort(&self, components: &mut [Component]) {
        components.sort_by(|a, b| self.compare(a, b));
    }

    /// The components' places in that order.
    pub(super) fn order(&self, components: &[Component]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..components.len()).collect();
        order.sort_by(|a, b| self.compare(&components[*a], &components[*b]));
        order
    }

    fn compare(&self, a: &Component, b: &Component) -> Ordering {
        let mean = |c: &Component| self.slope.signum() * c.mean[INTENSITY];
        mean(a).total_cmp(&mean(b)).then(b.weight.total_cmp(&a.weight))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_density_that_lies_around_another_is_named() {
        let mixture = |parts: &[[f64; 3]]| Mixture {
            weights: parts.iter().map(|p| p[0]).collect(),
            means: parts.iter().map(|p| vec![p[1]]).collect(),
            covariances: parts.iter().map(|p| vec![p[2] * p[2]]).collect(),
        };
        // A head in CT: padding, air, all that is left, soft tissue.
        let head = [[0.3, 25.0, 0.3], [0.2, 61.0, 5.0], [0.3, 1044.0, 703.0], [0.2, 1076.0, 18.0]];
        assert_eq!(mixture(&head).around(), Some([1044.0, 1076.0]));
        let apart = [[0.5, 20.0, 5.0], [0.3, 60.0, 8.0], [0.2, 130.0, 6.0]];
        assert_eq!(mixture(&apart).around(), None);
        // One that is nowhere the likeliest parts nothing.
        let drowned = [[0.9, 20.0, 10.0], [1e-9, 21.0, 9.0]];
        assert_eq!(mixture(&drowned).around(), None);
        assert_eq!(Mixture::default().around(), None);
    }
}
