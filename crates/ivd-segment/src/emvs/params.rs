//! What EMVS looks for.

use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

use super::Mixture;
use crate::scope;

/// Most components that can be asked for.
const MOST_COMPONENTS: usize = 256;
/// Most iterations that can be asked for.
const MOST_ITERATIONS: u64 = 1_000_000;

/// In what space the components live, and which covariances they may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Covariance {
    /// On intensity alone: one variance a component.
    #[default]
    Intensity,
    /// Over x, y, z (mm along the axes of the grid) and intensity, axes independent of each other: four variances. The grid's
    /// axes count as perpendicular, also those of a sheared grid.
    Diagonal,
    /// Over x, y, z (mm along the axes of the grid) and intensity, any covariance: ten numbers. Sheared axes are measured
    /// likewise.
    Full,
}

impl Covariance {
    /// Number of dimensions.
    pub(super) fn dimensions(self) -> usize {
        if self == Self::Intensity { 1 } else { 4 }
    }

    /// Free parameters of a mixture of `k` components.
    pub(super) fn free(self, k: usize) -> usize {
        let each = match self {
            Self::Intensity => 3,
            Self::Diagonal => 9,
            Self::Full => 15,
        };
        each * k - 1
    }

    /// Numbers that a covariance is written with.
    pub(super) fn numbers(self) -> usize {
        match self {
            Self::Intensity => 1,
            Self::Diagonal => 4,
            Self::Full => 16,
        }
    }
}

/// What `emvs` looks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmvsParams {
    /// Number of components, 1…256; `None`: the number of 1…`k_max` with the least Bayesian information criterion.
    pub k: Option<usize>,
    /// Most components that are tried, 1…256.
    pub k_max: usize,
    /// The components' space and shape.
    pub covariance: Covariance,
    /// Most iterations, ≥ 1.
    pub max_iterations: u64,
    /// The search ends when the mean log-likelihood of a voxel rises by less than this; 0 goes on to `max_iterations`.
    pub tolerance: f64,
    /// No variance falls below this share, 0…1, of the variance of all values (of those between their 0.1 % and 99.9 %
    /// quantiles, so that an outlier doesn't raise it), nor below a twelfth of the square of the step between stored values,
    /// the variance that rounding alone leaves, or 1 % of the variance of all values where that is less: two values far apart
    /// are two classes, not a coarse scale. Along an axis of space: nor below this share of the variance of a uniform volume
    /// (a twelfth of its squared extent), nor below that of a voxel. 0: none of these, only what keeps densities finite, 10⁻²⁰
    /// of the variance of all values and in space the square of 10⁻⁶ of the extent; the former holds for any share.
    pub variance_floor: f64,
    /// Added to every variance in every iteration, in squares of real units, and mm². For comparisons with programs that do
    /// so; the likelihood may then fall.
    pub variance_added: f64,
    /// Coupling β of neighbouring voxels, ≥ 0; 0: none. See [`emvs`](super::emvs).
    pub smoothing: f64,
    /// Most sweeps of the coupled voxels.
    pub smoothing_iterations: u64,
    /// Scale of a smooth multiplicative bias field (mm), ≥ 0; 0: none.
    pub bias: f64,
    /// Whether to give the posterior probability of every component as a map.
    pub posteriors: bool,
    /// Only voxels whose real value lies between these, both included.
    pub range: Option<[f64; 2]>,
    /// The mixture to begin with; its components count as `k`. `None`: from the classes of least inertia.
    pub start: Option<Mixture>,
}

impl Default for EmvsParams {
    fn default() -> Self {
        Self {
            k: None,
            k_max: 10,
            covariance: Covariance::Intensity,
            max_iterations: 500,
            tolerance: 1e-6,
            variance_floor: 1e-6,
            variance_added: 0.0,
            smoothing: 0.0,
            smoothing_iterations: 20,
            bias: 0.0,
            posteriors: false,
            range: None,
            start: None,
        }
    }
}

impl EmvsParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        let most = format!("use 1…{MOST_COMPONENTS}");
        if self.k.is_some_and(|k| !(1..=MOST_COMPONENTS).contains(&k)) {
            return Err(ParamError::new("k", format!("{} components", self.k.unwrap_or(0)), most));
        }
        if !(1..=MOST_COMPONENTS).contains(&self.k_max) {
            return Err(ParamError::new("k_max", format!("{} components", self.k_max), most));
        }
        for (field, rounds, least) in [
            ("max_iterations", self.max_iterations, 1),
            ("smoothing_iterations", self.smoothing_iterations, 0),
        ] {
            if !(least..=MOST_ITERATIONS).contains(&rounds) {
                let remedy = format!("use {least}…{MOST_ITERATIONS}");
                return Err(ParamError::new(field, format!("{rounds} iterations"), remedy));
            }
        }
        for (field, value, limit) in [
            ("tolerance", self.tolerance, 1e9),
            ("variance_floor", self.variance_floor, 1.0),
            ("variance_added", self.variance_added, 1e100),
            ("smoothing", self.smoothing, 1e6),
            ("bias", self.bias, 1e9),
        ] {
            if !(0.0..=limit).contains(&value) {
                return Err(ParamError::new(field, format!("{value}"), format!("use 0…{limit}")));
            }
        }
        scope::check_range(self.range)?;
        self.start.as_ref().map_or(Ok(()), |start| self.check_start(start))
    }

    fn check_start(&self, start: &Mixture) -> Result<(), ParamError> {
        let k = start.weights.len();
        let shape = [self.covariance.dimensions(), self.covariance.numbers()];
        let problem = if !(1..=MOST_COMPONENTS).contains(&k) || self.k.is_some_and(|asked| asked != k) {
            format!("{k} components where {:?} are asked for", self.k)
        } else if start.means.len() != k || start.covariances.len() != k {
            format!("{} means, {} covariances of {k}", start.means.len(), start.covariances.len())
        } else if start.means.iter().any(|m| m.len() != shape[0])
            || start.covariances.iter().any(|c| c.len() != shape[1])
        {
            format!("means are not of {} and covariances of {} numbers", shape[0], shape[1])
        } else if !start.weights.iter().all(|w| w.is_finite() && *w > 0.0)
            || !start.means.iter().chain(&start.covariances).flatten().all(|v| v.is_finite())
        {
            "a weight that isn't above 0, or a number that isn't finite".to_owned()
        } else if start.variances().iter().flatten().any(|v| *v <= 0.0) {
            "a variance that isn't above 0".to_owned()
        } else {
            return Ok(());
        };
        Err(ParamError::new("start", problem, "give a mixture as this method gives it"))
    }
}
