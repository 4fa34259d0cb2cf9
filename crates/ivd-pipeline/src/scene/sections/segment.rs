use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How structure is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum SegmentMethod {
    /// k-means: on intensity globally optimal, with `spatial_weight` on position and intensity.
    #[default]
    #[serde(rename = "kmvs")]
    Kmvs,
    /// A mixture of normal distributions, by expectation-maximisation.
    #[serde(rename = "emvs")]
    Emvs,
    /// Mean shift: the modes of the density.
    #[serde(rename = "msvs")]
    Msvs,
    /// A tree of merged regions, cut.
    #[serde(rename = "hvs")]
    Hvs,
    /// Mean shift proposes classes, k-means keeps those that count.
    #[serde(rename = "msvs+kmvs")]
    MsvsKmvs,
    /// Given thresholds.
    #[serde(rename = "threshold")]
    Threshold,
}

/// A number of classes, or the word for finding it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ClassCount {
    /// So many.
    Number(usize),
    /// As many as the Bayesian information criterion asks for.
    Word(AutoWord),
}

/// The word for [`ClassCount`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AutoWord {
    /// Found from the data.
    Auto,
}

impl std::str::FromStr for ClassCount {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Word(AutoWord::Auto)),
            _ => {
                text.parse().map(Self::Number).map_err(|_| format!("`{text}`: a number of classes, or auto"))
            }
        }
    }
}

/// What a mixture of `emvs` describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CovarianceChoice {
    /// Intensity alone.
    #[default]
    Intensity,
    /// Position and intensity, independent of each other.
    Diagonal,
    /// Position and intensity together.
    Full,
}

/// The window of mean shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum KernelChoice {
    /// Normal weights.
    #[default]
    Gaussian,
    /// Equal weights.
    Flat,
}

/// How regions of `hvs` come together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LinkageChoice {
    /// Where the sum of squares grows least.
    #[default]
    Ward,
    /// Where the smallest step between neighbours is.
    Single,
}

/// Which merges of a tree count most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RankingChoice {
    /// Those that separate parts of size and contrast.
    #[default]
    Persistence,
    /// The highest.
    Height,
    /// Those of the largest parts.
    Area,
}

/// The order of class ids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ClassOrder {
    /// By mean value, the lowest first.
    #[default]
    Mean,
    /// By size, the largest first.
    Size,
}

/// `[segment]`. A key says which methods read it; the others leave it alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentSection {
    /// Method.
    pub method: SegmentMethod,
    /// Number of classes of `kmvs`, `emvs` and `hvs`; "auto" for `emvs`: found by the Bayesian information criterion.
    pub k: ClassCount,
    /// Most classes that are tried or proposed where the number is found (`emvs`, `msvs`, `msvs+kmvs`); the method's default
    /// where nothing is said.
    pub k_max: Option<usize>,
    /// Fewest classes that `msvs+kmvs` looks at, 1…1024; where fewer are proposed, that many are kept.
    pub k_min: Option<usize>,
    /// Ascending thresholds of `threshold`, in real values.
    pub values: Vec<f64>,
    /// Only voxels whose real value lies between these, both included (all methods but `threshold`).
    pub range: Option<[f64; 2]>,
    /// What a millimetre counts beside the value, for `kmvs` (real units/mm); 0 for intensity alone.
    pub spatial_weight: f64,
    /// Seed of the start centroids of `kmvs` with a spatial weight.
    pub seed: Option<u64>,
    /// Most iterations of `emvs`, and of `kmvs` with a spatial weight.
    pub max_iterations: Option<u64>,
    /// Change below which `emvs` (mean log-likelihood) and `kmvs` with a spatial weight (share of the inertia) stop.
    pub tolerance: Option<f64>,
    /// What the mixture of `emvs` describes.
    pub covariance: CovarianceChoice,
    /// Coupling of neighbouring voxels in `emvs` (a hidden Markov random field); 0 for none.
    pub smoothing: f64,
    /// Most sweeps of the coupled voxels of `emvs`.
    pub smoothing_iterations: Option<u64>,
    /// No variance of `emvs` falls below this share of that of all values.
    pub variance_floor: Option<f64>,
    /// Scale of a smooth bias field that `emvs` estimates (mm); 0 for none.
    pub bias: f64,
    /// Window of mean shift.
    pub kernel: KernelChoice,
    /// Window of mean shift in value (real units); found from the data where nothing is said.
    pub range_bandwidth: Option<f64>,
    /// Window of mean shift in space (mm); 0 for intensity alone.
    pub spatial_bandwidth: Option<f64>,
    /// Modes of mean shift that stand out less than this from their surroundings, 0…1, are merged.
    pub persistence: Option<f64>,
    /// Cells of mean shift along a window: finer is closer to the exact shift, and slower.
    pub cells_per_bandwidth: Option<f64>,
    /// How regions of `hvs` come together.
    pub linkage: LinkageChoice,
    /// Neighbours of `hvs` that differ by no more are one region from the start (real units).
    pub alpha: Option<f64>,
    /// Most regions that `hvs` by Ward starts from.
    pub max_regions: Option<usize>,
    /// Cut of the tree of `hvs` at a height instead of a number of classes (real units; by Ward real units²).
    pub height: Option<f64>,
    /// Cut of the tree of `hvs` at a level, 0…4, instead of a number of classes.
    pub level: Option<u32>,
    /// Which merges of the tree of `hvs` count most.
    pub ranking: RankingChoice,
    /// Connected parts of fewer voxels are given to their surroundings.
    pub smallest: u64,
    /// The order of class ids.
    pub order: ClassOrder,
}

impl Default for SegmentSection {
    fn default() -> Self {
        Self {
            method: SegmentMethod::default(),
            k: ClassCount::Number(4),
            k_max: None,
            k_min: None,
            values: Vec::new(),
            range: None,
            spatial_weight: 0.0,
            seed: None,
            max_iterations: None,
            tolerance: None,
            covariance: CovarianceChoice::default(),
            smoothing: 0.0,
            smoothing_iterations: None,
            variance_floor: None,
            bias: 0.0,
            kernel: KernelChoice::default(),
            range_bandwidth: None,
            spatial_bandwidth: None,
            persistence: None,
            cells_per_bandwidth: None,
            linkage: LinkageChoice::default(),
            alpha: None,
            max_regions: None,
            height: None,
            level: None,
            ranking: RankingChoice::default(),
            smallest: 0,
            order: ClassOrder::default(),
        }
    }
}
