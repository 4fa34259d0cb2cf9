//! What EMVS looks for.

use ivd_core::ParamError;
use ivd_core::op::check_fields;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::covariance::Covariance;
use super::mixture::Mixture;
use crate::Within;

/// Most components of a start.
const MOST_COMPONENTS: usize = 256;

/// A number of components, or the word for finding it: how [`EmvsParams::k`] is written.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Count {
    /// So many.
    Number(#[schemars(range(min = 1, max = 256))] usize),
    /// As many as the criterion of [`EmvsParams::k`] prefers.
    Word(Auto),
}

/// The word for it.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Auto {
    /// Found from the data.
    Auto,
}

mod count {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{Auto, Count};

    #[allow(clippy::ref_option, clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
    pub(super) fn serialize<S: Serializer>(k: &Option<usize>, to: S) -> Result<S::Ok, S::Error> {
        k.map_or(Count::Word(Auto::Auto), Count::Number).serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<usize>, D::Error> {
        Ok(match Count::deserialize(from)? {
            Count::Number(k) => Some(k),
            Count::Word(Auto::Auto) => None,
        })
    }
}

/// A mixture of normal distributions, by expectation-maximisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EmvsParams {
    /// Number of components. `auto` takes the number from 1 to `k_max` that a criterion prefers: on intensity the integrated completed
    /// likelihood of the voxels within one material, over space the Bayesian information criterion.
    #[serde(with = "count")]
    #[schemars(with = "Count", extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub k: Option<usize>,
    /// Most components that are tried where their number is found.
    #[schemars(range(min = 1, max = 256), extend("x-unit" = "1"))]
    pub k_max: usize,
    /// What the mixture describes: the components' space and shape.
    pub covariance: Covariance,
    /// Most iterations.
    #[schemars(range(min = 1, max = 1_000_000), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub max_iterations: u64,
    /// The search ends when the mean log-likelihood of a voxel rises by less than this; 0 goes on to `max_iterations`.
    #[schemars(range(min = 0.0, max = 1e9), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub tolerance: f64,
    /// No variance falls below this share of the variance of all values (of those between their 0.1 % and 99.9 %
    /// quantiles, so that an outlier doesn't raise it), nor below a twelfth of the square of the step between stored values,
    /// the variance that rounding alone leaves, or 1 % of the variance of all values where that is less: two values far apart
    /// are two classes, not a coarse scale. Along an axis of space: nor below this share of the variance of a uniform volume
    /// (a twelfth of its squared extent), nor below that of a voxel. 0: none of these, only what keeps densities finite, 10⁻²⁰
    /// of the variance of all values and in space the square of 10⁻⁶ of the extent; the former holds for any share.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub variance_floor: f64,
    /// Coupling β of neighbouring voxels (a hidden Markov random field); 0 for none.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1"))]
    pub smoothing: f64,
    /// Most sweeps of the coupled voxels.
    #[schemars(range(min = 0, max = 1_000_000), extend("x-unit" = "1"))]
    pub smoothing_iterations: u64,
    /// Scale of a smooth multiplicative bias field; 0 for none.
    #[schemars(range(min = 0.0, max = 1e9), extend("x-unit" = "mm"))]
    pub bias: f64,
    /// Which values count.
    #[serde(flatten)]
    pub within: Within,
    /// Added to every variance in every iteration, in squares of real units, and mm². For comparisons with programs that do
    /// so; the likelihood may then fall. No key of a scene.
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub variance_added: f64,
    /// The mixture to begin with; its components count as `k`. `None`: from the classes of least inertia. No key of a scene.
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub start: Option<Mixture>,
}

impl Default for EmvsParams {
    fn default() -> Self {
        Self {
            k: Some(4),
            k_max: 10,
            covariance: Covariance::Intensity,
            max_iterations: 500,
            tolerance: 1e-6,
            variance_floor: 1e-6,
            smoothing: 0.0,
            smoothing_iterations: 20,
            bias: 0.0,
            within: Within::default(),
            variance_added: 0.0,
            start: None,
        }
    }
}

impl EmvsParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        if !(0.0..=1e100).contains(&self.variance_added) {
            return Err(ParamError::new("variance_added", self.variance_added.to_string(), "use 0…1e100"));
        }
        self.within.check()?;
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
