use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_segment::{KmvsParams, Segmentation, ThresholdParams};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{SegmentMethod, SegmentSection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Finds a volume's structure.
#[derive(Debug, Clone, PartialEq)]
pub enum Segment {
    /// k-means on intensity.
    Kmvs(KmvsParams),
    /// Given thresholds.
    Threshold(ThresholdParams),
}

impl Segment {
    /// The stage that a scene's section asks for.
    pub fn from_section(section: &SegmentSection) -> Self {
        match section.method {
            SegmentMethod::Kmvs => Self::Kmvs(KmvsParams { k: section.k, ..KmvsParams::default() }),
            SegmentMethod::Threshold => Self::Threshold(ThresholdParams { values: section.values.clone() }),
        }
    }
}

impl Stage for Segment {
    fn name(&self) -> &'static str {
        "segment"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("volume", &[Kind::Volume]), Slot::optional("mask", &[Kind::Mask])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Labels)
    }

    fn params(&self) -> Value {
        match self {
            Self::Kmvs(params) => json!({ "method": "kmvs", "kmvs": super::json(params) }),
            Self::Threshold(params) => json!({ "method": "threshold", "threshold": super::json(params) }),
        }
    }

    fn accuracy_knobs(&self) -> &'static [&'static str] {
        &["k"]
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume = inputs.volume("volume").expect("checked by the runner");
        let mask = inputs.mask("mask");
        let segmentation = match self {
            Self::Kmvs(params) => ivd_segment::kmvs(volume, mask, params, exec),
            Self::Threshold(params) => ivd_segment::threshold(volume, mask, params, exec),
        }
        .map_err(stage_error!("segment"))?;
        let metrics = metrics(&segmentation);
        Ok(Product::new(Artefact::Labels(segmentation.labels), metrics))
    }
}

fn metrics(s: &Segmentation) -> Value {
    let classes: Vec<Value> = s
        .labels
        .classes()
        .iter()
        .map(|c| {
            json!({ "id": c.id, "mean": c.mean, "sd": c.sd, "voxels": c.voxels, "lower": c.lower, "upper": c.upper })
        })
        .collect();
    json!({
        "k": s.k,
        "iterations": s.iterations,
        "converged": s.converged,
        "objective": s.objective,
        "gap": s.gap,
        "classes": classes,
        "visited_fraction": s.visited_fraction,
    })
}
