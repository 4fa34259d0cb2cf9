//! The ways to segment, with the parameters of each.

use ivd_artefact::Artefact;
use ivd_core::{Exec, Volume, Voxels};
use ivd_segment::{
    ChainParams, Covariance, Cut, CutParams, EmvsParams, HvsParams, Kernel, KmvsParams, Linkage, MsvsParams,
    Ranking, Segmentation, ThresholdParams,
};
use serde_json::{Value, json};

use super::{keys, metrics};
use crate::error::stage_error;
use crate::scene::{
    ClassCount, CovarianceChoice, KernelChoice, LinkageChoice, RankingChoice, SegmentMethod, SegmentSection,
};
use crate::{Error, Inputs, Metrics};

/// A way to segment.
#[derive(Debug, Clone, PartialEq)]
pub enum Method {
    /// k-means.
    Kmvs(KmvsParams),
    /// A mixture of normal distributions.
    Emvs(EmvsParams),
    /// Mean shift.
    Msvs(MsvsParams),
    /// A tree of regions and a cut of it.
    Hvs(HvsParams, CutParams),
    /// Mean shift, then k-means.
    MsvsKmvs(ChainParams),
    /// Given thresholds.
    Threshold(ThresholdParams),
    /// A cut of a tree that is there.
    Cut(CutParams),
}

/// A probability a voxel for each component of a mixture.
pub type Posteriors = Vec<Volume>;

impl Method {
    pub(super) fn from_section(section: &SegmentSection) -> Result<Self, Error> {
        keys::check(section)?;
        Ok(match section.method {
            SegmentMethod::Kmvs => Self::Kmvs(kmvs(section)?),
            SegmentMethod::Emvs => Self::Emvs(emvs(section)),
            SegmentMethod::Msvs => Self::Msvs(msvs(section)),
            SegmentMethod::Hvs => Self::Hvs(hvs(section), cut(section)?),
            SegmentMethod::MsvsKmvs => Self::MsvsKmvs(chain(section)),
            SegmentMethod::Threshold => Self::Threshold(ThresholdParams { values: section.values.clone() }),
        })
    }

    pub(super) fn params(&self) -> Value {
        match self {
            Self::Kmvs(params) => json!({ "method": "kmvs", "kmvs": params }),
            Self::Emvs(params) => json!({ "method": "emvs", "emvs": params }),
            Self::Msvs(params) => json!({ "method": "msvs", "msvs": params }),
            Self::Hvs(tree, cut) => json!({ "method": "hvs", "tree": tree, "cut": cut }),
            Self::MsvsKmvs(params) => json!({ "method": "msvs+kmvs", "chain": params }),
            Self::Threshold(params) => json!({ "method": "threshold", "threshold": params }),
            Self::Cut(params) => json!({ "method": "hvs", "cut": params }),
        }
    }

    /// The segmentation, and figures that this method alone has.
    pub(super) fn run(
        &self,
        inputs: &Inputs,
        exec: &Exec,
        posteriors: Option<&mut Posteriors>,
    ) -> Result<(Segmentation, Metrics), Error> {
        if let Self::Cut(params) = self {
            let Some(Artefact::Tree(tree)) = inputs.get("tree") else {
                unreachable!("checked by the runner")
            };
            let found = ivd_segment::cut(tree, params, exec).map_err(stage_error!("segment"))?;
            return Ok((found, metrics::cut(tree, params, exec)));
        }
        let volume = inputs.volume("volume").expect("checked by the runner");
        let mask = inputs.mask("mask");
        match self {
            Self::Kmvs(params) if params.spatial_weight > 0.0 => {
                let found =
                    ivd_segment::kmvs_spatial(volume, mask, params, exec).map_err(stage_error!("segment"))?;
                let own = metrics::spatial(&found);
                Ok((found.segmentation, own))
            }
            Self::Kmvs(params) => Ok((
                ivd_segment::kmvs(volume, mask, params, exec).map_err(stage_error!("segment"))?,
                Metrics::default(),
            )),
            Self::Emvs(params) => {
                let params = EmvsParams { posteriors: posteriors.is_some(), ..params.clone() };
                let found =
                    ivd_segment::emvs(volume, mask, &params, exec).map_err(stage_error!("segment"))?;
                if let Some(kept) = posteriors {
                    *kept = found
                        .posteriors
                        .iter()
                        .map(|map| Volume::new(volume.grid().clone(), Voxels::F32(map.clone())))
                        .collect::<Result<_, _>>()
                        .map_err(ivd_segment::Error::from)
                        .map_err(stage_error!("segment"))?;
                }
                let own = metrics::mixture(&found);
                Ok((found.segmentation, own))
            }
            Self::Msvs(params) => {
                let found = ivd_segment::msvs(volume, mask, params, exec).map_err(stage_error!("segment"))?;
                let own = metrics::modes(&found);
                Ok((found.segmentation, own))
            }
            Self::MsvsKmvs(params) => {
                let found =
                    ivd_segment::msvs_kmvs(volume, mask, params, exec).map_err(stage_error!("segment"))?;
                let own = metrics::chain(&found);
                Ok((found.segmentation, own))
            }
            Self::Hvs(tree, params) => {
                let tree =
                    ivd_segment::hvs_tree(volume, mask, tree, exec).map_err(stage_error!("segment"))?;
                let found = ivd_segment::cut(&tree.tree, params, exec).map_err(stage_error!("segment"))?;
                Ok((found, metrics::cut(&tree.tree, params, exec)))
            }
            Self::Threshold(params) => Ok((
                ivd_segment::threshold(volume, mask, params, exec).map_err(stage_error!("segment"))?,
                Metrics::default(),
            )),
            Self::Cut(_) => unreachable!("done above"),
        }
    }
}

fn number(section: &SegmentSection, method: &str) -> Result<usize, Error> {
    match section.k {
        ClassCount::Number(k) => Ok(k),
        ClassCount::Word(_) => Err(Error::usage(
            "segment",
            format!("k = \"auto\": {method} needs a number; emvs finds it, and so does msvs+kmvs"),
        )),
    }
}

fn kmvs(section: &SegmentSection) -> Result<KmvsParams, Error> {
    let base = KmvsParams::default();
    Ok(KmvsParams {
        k: number(section, "kmvs")?,
        range: section.range,
        spatial_weight: section.spatial_weight,
        seed: section.seed.unwrap_or(base.seed),
        max_iterations: section.max_iterations.unwrap_or(base.max_iterations),
        tolerance: section.tolerance.unwrap_or(base.tolerance),
        start: None,
    })
}

fn emvs(section: &SegmentSection) -> EmvsParams {
    let base = EmvsParams::default();
    EmvsParams {
        k: match section.k {
            ClassCount::Number(k) => Some(k),
            ClassCount::Word(_) => None,
        },
        k_max: section.k_max.unwrap_or(base.k_max),
        covariance: match section.covariance {
            CovarianceChoice::Intensity => Covariance::Intensity,
            CovarianceChoice::Diagonal => Covariance::Diagonal,
            CovarianceChoice::Full => Covariance::Full,
        },
        max_iterations: section.max_iterations.unwrap_or(base.max_iterations),
        tolerance: section.tolerance.unwrap_or(base.tolerance),
        variance_floor: section.variance_floor.unwrap_or(base.variance_floor),
        smoothing: section.smoothing,
        smoothing_iterations: section.smoothing_iterations.unwrap_or(base.smoothing_iterations),
        bias: section.bias,
        range: section.range,
        ..base
    }
}

fn msvs(section: &SegmentSection) -> MsvsParams {
    let base = MsvsParams::default();
    MsvsParams {
        range_bandwidth: section.range_bandwidth.unwrap_or(base.range_bandwidth),
        spatial_bandwidth: section.spatial_bandwidth.unwrap_or(base.spatial_bandwidth),
        kernel: match section.kernel {
            KernelChoice::Gaussian => Kernel::Gaussian,
            KernelChoice::Flat => Kernel::Flat,
        },
        persistence: section.persistence.unwrap_or(base.persistence),
        k_max: section.k_max.unwrap_or(base.k_max),
        cells_per_bandwidth: section.cells_per_bandwidth.unwrap_or(base.cells_per_bandwidth),
        range: section.range,
    }
}

fn chain(section: &SegmentSection) -> ChainParams {
    let base = ChainParams::default();
    ChainParams { msvs: msvs(section), k_min: section.k_min.unwrap_or(base.k_min) }
}

pub(super) fn hvs(section: &SegmentSection) -> HvsParams {
    let base = HvsParams::default();
    HvsParams {
        linkage: match section.linkage {
            LinkageChoice::Ward => Linkage::Ward,
            LinkageChoice::Single => Linkage::Single,
        },
        alpha: section.alpha.or(base.alpha),
        max_regions: section.max_regions.unwrap_or(base.max_regions),
        range: section.range,
    }
}

pub(super) fn cut(section: &SegmentSection) -> Result<CutParams, Error> {
    keys::check(section)?;
    let cut = match (section.height, section.level) {
        (Some(_), Some(_)) => {
            return Err(Error::usage("segment", "height and level both say where the tree is cut; give one"));
        }
        (Some(height), None) => Cut::Height(height),
        (None, Some(level)) => Cut::Level(level),
        (None, None) => Cut::Classes(number(section, "hvs")?),
    };
    let order = match section.ranking {
        RankingChoice::Persistence => Ranking::Persistence,
        RankingChoice::Height => Ranking::Height,
        RankingChoice::Area => Ranking::Area,
    };
    Ok(CutParams { cut, order, ..CutParams::default() })
}
