//! What segmentations tell of themselves.

use ivd_core::Class;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    BicPoint, Chain, ChainPoint, Dendrogram, Emvs, EmvsParams, Hvs, Mixture, Mode, Msvs, Segmentation,
    SpatialKmvs,
};

/// Longer lists of modes aren't read.
const MOST_MODES: usize = 64;
/// More leaves can't be drawn.
pub(crate) const MOST_LEAVES: usize = 32;

/// Figures of a segmentation, and those that its method alone has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures<O> {
    /// Those that every method has.
    #[serde(flatten)]
    pub common: CommonFigures,
    /// Those that its method alone has.
    #[serde(flatten)]
    pub own: O,
}

/// Figures that every method has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CommonFigures {
    /// Number of classes.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub k: usize,
    /// Rounds of an iterative method; 1 for one without iterations.
    #[schemars(extend("x-unit" = "1"))]
    pub iterations: u64,
    /// Whether the method reached what it promises.
    pub converged: bool,
    /// What the method makes least or, for a mixture, greatest: the inertia, or the mean log-likelihood of a voxel (of no unit).
    #[schemars(extend("x-unit" = "real units²"))]
    pub objective: f64,
    /// Proven bound of what the objective lies above the global optimum.
    #[schemars(extend("x-unit" = "real units²"))]
    pub gap: f64,
    /// The classes, in the order of their means.
    pub classes: Vec<ClassFigures>,
    /// Voxels looked at, as a fraction of the volume, 0…1.
    #[schemars(extend("x-unit" = "1"))]
    pub visited_fraction: f64,
}

/// A class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClassFigures {
    /// Its label.
    #[schemars(extend("x-unit" = "1"))]
    pub id: u16,
    /// Mean of its voxels.
    #[schemars(extend("x-unit" = "real units"))]
    pub mean: f64,
    /// Standard deviation of its voxels.
    #[schemars(extend("x-unit" = "real units"))]
    pub sd: f64,
    /// Number of its voxels.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels: u64,
    /// Crossing with the class below, where there is one.
    #[schemars(extend("x-unit" = "real units"))]
    pub lower: Option<f64>,
    /// Crossing with the class above, where there is one.
    #[schemars(extend("x-unit" = "real units"))]
    pub upper: Option<f64>,
}

impl From<&Class> for ClassFigures {
    fn from(class: &Class) -> Self {
        let Class { id, mean, sd, voxels, lower, upper, .. } = *class;
        Self { id, mean, sd, voxels, lower, upper }
    }
}

impl<O> Figures<O> {
    pub(crate) fn of(found: &Segmentation, own: O) -> Self {
        let common = CommonFigures {
            k: found.k,
            iterations: found.iterations,
            converged: found.converged,
            objective: found.objective,
            gap: found.gap,
            classes: found.labels.classes().iter().map(ClassFigures::from).collect(),
            visited_fraction: found.visited_fraction,
        };
        Self { common, own }
    }
}

/// No figures but those that every method has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct NoFigures {}

/// Of k-means with a spatial weight; without one there are none.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct SpatialFigures {
    /// The centroids: place (mm from the first voxel along the grid's axes) and value (real units).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm, real units"))]
    pub centroids: Option<Vec<[f64; 4]>>,
    /// Empty clusters that began anew.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1"))]
    pub reseeded: Option<u64>,
    /// Voxels with two nearest centroids.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "voxels"))]
    pub ties: Option<u64>,
}

impl From<&SpatialKmvs> for SpatialFigures {
    fn from(found: &SpatialKmvs) -> Self {
        Self {
            centroids: Some(found.centroids.clone()),
            reseeded: Some(found.reseeded),
            ties: Some(found.ties),
        }
    }
}

/// Of a mixture, with the curve that its number of components was read from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MixtureFigures {
    /// Mean over the voxels of the logarithm of the mixture's density.
    #[schemars(extend("x-unit" = "1"))]
    pub log_likelihood: f64,
    /// The components.
    pub mixture: Mixture,
    /// Every number of components that was tried.
    pub curve: Vec<MixturePoint>,
    /// Whether the best number of components is the most that was tried, `k_max`: more might be better still.
    #[serde(default)]
    pub at_limit: bool,
}

/// How well a number of components explains the data.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MixturePoint {
    /// Number of components.
    #[schemars(extend("x-unit" = "1"))]
    pub k: usize,
    /// Mean log-likelihood of a voxel.
    #[schemars(extend("x-unit" = "1"))]
    pub objective: f64,
    /// Bayesian information criterion: less is better.
    #[schemars(extend("x-unit" = "1"))]
    pub bic: f64,
    /// Integrated completed likelihood, which the number is chosen by where it is known: less is better.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1"))]
    pub icl: Option<f64>,
}

impl MixtureFigures {
    /// Those of a mixture that was found with some parameters.
    pub(crate) fn of(found: &Emvs, params: &EmvsParams) -> Self {
        let best =
            found.bic.iter().min_by(|a, b| a.criterion().total_cmp(&b.criterion())).map(|point| point.k);
        let point =
            |p: &BicPoint| MixturePoint { k: p.k, objective: p.log_likelihood, bic: p.bic, icl: p.icl };
        Self {
            log_likelihood: found.log_likelihood,
            mixture: found.mixture.clone(),
            curve: found.bic.iter().map(point).collect(),
            at_limit: best.is_some_and(|k| k > 1 && k == params.k_max),
        }
    }
}

/// Of the modes of the density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModesFigures {
    /// Modes that persist, before `k_max` cuts them down.
    #[schemars(extend("x-unit" = "1"))]
    pub k_proposed: usize,
    /// Window in value, given or found.
    #[schemars(extend("x-unit" = "real units"))]
    pub range_bandwidth: f64,
    /// Window in space; 0 where space doesn't count.
    #[schemars(extend("x-unit" = "mm"))]
    pub spatial_bandwidth: f64,
    /// Cells of the grid.
    #[schemars(extend("x-unit" = "1"))]
    pub cells: u64,
    /// The foremost modes.
    pub modes: Vec<Mode>,
}

impl From<&Msvs> for ModesFigures {
    fn from(found: &Msvs) -> Self {
        Self {
            k_proposed: found.k_proposed,
            range_bandwidth: found.range_bandwidth,
            spatial_bandwidth: found.spatial_bandwidth,
            cells: found.cells,
            modes: found.modes.iter().take(MOST_MODES).cloned().collect(),
        }
    }
}

/// Of what was proposed and what was kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProposalFigures {
    /// Modes that mean shift proposes.
    #[schemars(extend("x-unit" = "1"))]
    pub k_proposed: usize,
    /// Classes that were kept.
    #[schemars(extend("x-unit" = "1"))]
    pub k_kept: usize,
    /// Every number of classes that was looked at.
    pub curve: Vec<ChainPoint>,
    /// Window in value, given or found.
    #[schemars(extend("x-unit" = "real units"))]
    pub range_bandwidth: f64,
    /// Time of mean shift.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s", "x-time" = true))]
    pub msvs_s: f64,
    /// Time of the curve, and of k-means with the number that was kept.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s", "x-time" = true))]
    pub kmvs_s: f64,
}

impl From<&Chain> for ProposalFigures {
    fn from(found: &Chain) -> Self {
        Self {
            k_proposed: found.k_proposed,
            k_kept: found.k_kept,
            curve: found.curve.clone(),
            range_bandwidth: found.range_bandwidth,
            msvs_s: found.times.msvs.as_secs_f64(),
            kmvs_s: found.times.kmvs.as_secs_f64(),
        }
    }
}

/// Of a cut: the regions that the tree has, and how the classes come together, as far as a picture can show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CutFigures {
    /// Leaves of the tree.
    #[schemars(extend("x-unit" = "1"))]
    pub regions: usize,
    /// How the classes come together, where they are few enough to be drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dendrogram: Option<Dendrogram>,
}

/// Of a tree.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TreeFigures {
    /// Leaves and merges.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub nodes: usize,
    /// Leaves of the tree.
    #[schemars(extend("x-unit" = "1"))]
    pub regions: usize,
    /// The sum of squared deviations within the leaves as a share of that of all voxels, 0…1: what no cut can resolve.
    #[schemars(extend("x-unit" = "1"))]
    pub excess: f64,
    /// Merges that were cheaper than one before them.
    #[schemars(extend("x-unit" = "1"))]
    pub inversions: u64,
    /// The lowest and the highest height, where there is a merge; by Ward's criterion in squares of real units.
    #[schemars(extend("x-unit" = "real units"))]
    pub heights: Option<[f64; 2]>,
    /// Size in memory.
    #[schemars(extend("x-unit" = "bytes"))]
    pub bytes: u64,
}

impl From<&Hvs> for TreeFigures {
    fn from(found: &Hvs) -> Self {
        Self {
            nodes: found.tree.nodes(),
            regions: found.regions,
            excess: found.excess,
            inversions: found.inversions,
            heights: found.tree.height_range(),
            bytes: found.tree.bytes(),
        }
    }
}

/// What a method alone tells, whichever it was.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
#[allow(missing_docs, reason = "the variants are the types")]
pub enum AnyFigures {
    Mixture(MixtureFigures),
    Proposal(ProposalFigures),
    Modes(ModesFigures),
    Cut(CutFigures),
    Others(NoFigures),
}

impl AnyFigures {
    /// Classes that were proposed, before some of them were kept.
    pub fn proposed(&self) -> Option<usize> {
        match self {
            Self::Proposal(found) => Some(found.k_proposed),
            Self::Modes(found) => Some(found.k_proposed),
            Self::Mixture(_) | Self::Cut(_) | Self::Others(_) => None,
        }
    }

    /// Leaves of the tree that was cut.
    pub fn regions(&self) -> Option<usize> {
        if let Self::Cut(found) = self { Some(found.regions) } else { None }
    }

    /// How the classes come together.
    pub fn dendrogram(&self) -> Option<&Dendrogram> {
        if let Self::Cut(found) = self { found.dendrogram.as_ref() } else { None }
    }

    /// The criterion for every number of classes that was looked at: less is better.
    pub fn criterion(&self) -> Vec<(usize, f64)> {
        match self {
            Self::Mixture(found) => {
                found.curve.iter().map(|point| (point.k, point.icl.unwrap_or(point.bic))).collect()
            }
            Self::Proposal(found) => found.curve.iter().map(|point| (point.k, point.bic)).collect(),
            Self::Modes(_) | Self::Cut(_) | Self::Others(_) => Vec::new(),
        }
    }
}
