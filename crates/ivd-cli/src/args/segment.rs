//! What `ivd segment` takes.

use std::path::PathBuf;

use clap::Args;
use ivd_pipeline::scene::ClassCount;

use super::Output;
use crate::parse;

/// Arguments of `ivd segment`. Each parameter has the name of its key in a scene's `[segment]`.
#[derive(Debug, Args)]
pub(crate) struct SegmentArgs {
    /// Volume artefact or file; left out with --from-tree.
    #[arg(required_unless_present = "from_tree", conflicts_with = "from_tree")]
    pub(crate) volume: Option<PathBuf>,
    /// Only these voxels (a mask artefact).
    #[arg(long, conflicts_with = "from_tree")]
    pub(crate) mask: Option<PathBuf>,
    /// Cut this tree (artefact) instead of segmenting a volume.
    #[arg(long, value_name = "TREE")]
    pub(crate) from_tree: Option<PathBuf>,
    /// Keep the tree of hvs (artefact).
    #[arg(long, value_name = "TREE", conflicts_with = "from_tree")]
    pub(crate) tree_out: Option<PathBuf>,
    /// Keep the posterior maps of emvs: a volume artefact a class, `PREFIX-1.ivd` and so on.
    #[arg(long, value_name = "PREFIX", conflicts_with = "from_tree")]
    pub(crate) posteriors_out: Option<PathBuf>,
    /// kmvs, emvs, msvs, hvs, msvs+kmvs or threshold.
    #[arg(long, value_name = "METHOD")]
    pub(crate) method: Option<String>,
    /// Number of classes of kmvs, emvs and hvs; `auto` for emvs.
    #[arg(long, value_name = "N|auto")]
    pub(crate) k: Option<ClassCount>,
    /// Most classes tried or proposed where the number is found.
    #[arg(long, value_name = "N")]
    pub(crate) k_max: Option<u32>,
    /// msvs+kmvs: fewest classes looked at.
    #[arg(long, value_name = "N")]
    pub(crate) k_min: Option<u32>,
    /// Ascending thresholds of `--method threshold`, comma-separated.
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) values: Option<Vec<f64>>,
    /// Only voxels whose value lies between these, both included.
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse::interval, allow_hyphen_values = true)]
    pub(crate) range: Option<[f64; 2]>,
    /// kmvs: what a millimetre counts beside the value (real units/mm).
    #[arg(long, value_name = "WEIGHT")]
    pub(crate) spatial_weight: Option<f64>,
    /// kmvs with a spatial weight: seed of the start centroids.
    #[arg(long)]
    pub(crate) seed: Option<u32>,
    /// emvs, and kmvs with a spatial weight: most iterations.
    #[arg(long, value_name = "N")]
    pub(crate) max_iterations: Option<u32>,
    /// emvs, and kmvs with a spatial weight: the change that ends the iterations.
    #[arg(long, value_name = "CHANGE")]
    pub(crate) tolerance: Option<f64>,
    /// emvs: intensity, diagonal or full.
    #[arg(long, value_name = "KIND")]
    pub(crate) covariance: Option<String>,
    /// emvs: coupling of neighbouring voxels.
    #[arg(long, value_name = "COUPLING")]
    pub(crate) smoothing: Option<f64>,
    /// emvs: scale of a smooth bias field (mm).
    #[arg(long, value_name = "MM")]
    pub(crate) bias: Option<f64>,
    /// msvs: gaussian or flat.
    #[arg(long)]
    pub(crate) kernel: Option<String>,
    /// msvs: window in value (real units).
    #[arg(long, value_name = "WIDTH")]
    pub(crate) range_bandwidth: Option<f64>,
    /// msvs: window in space (mm).
    #[arg(long, value_name = "MM")]
    pub(crate) spatial_bandwidth: Option<f64>,
    /// msvs: modes that stand out less are merged, 0…1.
    #[arg(long, value_name = "SHARE")]
    pub(crate) persistence: Option<f64>,
    /// hvs: ward or single.
    #[arg(long)]
    pub(crate) linkage: Option<String>,
    /// hvs: neighbours that differ by no more are one region from the start (real units).
    #[arg(long, value_name = "STEP")]
    pub(crate) alpha: Option<f64>,
    /// hvs by ward: most regions to start from.
    #[arg(long, value_name = "N")]
    pub(crate) max_regions: Option<u32>,
    /// hvs: cut at a height instead of a number of classes.
    #[arg(long, conflicts_with_all = ["k", "level"])]
    pub(crate) height: Option<f64>,
    /// hvs: cut at a level, 0…4, instead of a number of classes.
    #[arg(long, conflicts_with = "k")]
    pub(crate) level: Option<u32>,
    /// hvs: which merges count most: persistence, height or area.
    #[arg(long)]
    pub(crate) ranking: Option<String>,
    /// Connected parts of fewer voxels are given to their surroundings.
    #[arg(long, value_name = "VOXELS")]
    pub(crate) smallest: Option<u32>,
    /// The order of class ids: mean (lowest first) or size (largest first).
    #[arg(long)]
    pub(crate) order: Option<String>,
    #[command(flatten)]
    pub(crate) output: Output,
}
