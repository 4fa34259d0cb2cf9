use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_deform::clip::{self, By, ClipParams, Clipped, Tag};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Keeps the part of a volume, of labels or of a mask that lies on given sides of planes, in boxes, and in what is tagged.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clip {
    /// Planes, boxes, class, background.
    pub params: ClipParams,
}

fn product<V: ivd_core::Value>(clipped: Clipped<V>) -> Product {
    let metrics = json!({
        "voxels_kept": clipped.voxels_kept,
        "voxels_clipped": clipped.voxels_clipped,
        "voxels_total": clipped.voxels_total,
        "bricks_visited": clipped.bricks_visited,
        "bricks_total": clipped.bricks_total,
    });
    Product::new(clipped.output, metrics)
}

impl Stage for Clip {
    fn name(&self) -> &'static str {
        "clip"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const {
            &[
                Slot::required("volume", &[Kind::Volume, Kind::Labels, Kind::Mask]),
                Slot::optional("tag", &[Kind::Mask, Kind::Labels]),
                Slot::optional("displacement", &[Kind::Displacement]),
            ]
        }
    }

    fn output(&self) -> Option<Kind> {
        None
    }

    fn params(&self) -> Value {
        super::json(&self.params)
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let tag = inputs.value("tag").map(Tag::Mask).or(inputs.value("tag").map(Tag::Labels));
        let by = By { tag, displacement: inputs.value("displacement") };
        match inputs.get("volume").expect("checked by the runner") {
            Artefact::Volume(volume) => {
                let clipped = clip::volume(volume, &self.params, &by, exec).map_err(stage_error!("clip"))?;
                Ok(product(clipped))
            }
            Artefact::Labels(labels) => {
                let clipped = clip::labels(labels, &self.params, &by, exec).map_err(stage_error!("clip"))?;
                Ok(product(clipped))
            }
            Artefact::Mask(mask) => {
                let clipped = clip::mask(mask, &self.params, &by, exec).map_err(stage_error!("clip"))?;
                Ok(product(clipped))
            }
            _ => unreachable!("the runner checked the kinds of the slots"),
        }
    }
}
