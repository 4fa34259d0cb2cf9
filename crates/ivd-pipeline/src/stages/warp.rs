use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_deform::warp::{self, Order, WarpParams};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{WarpOrder, WarpSection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Resamples a volume, labels or a mask through a displacement.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Warp {
    /// Interpolation and background.
    pub params: WarpParams,
}

impl Warp {
    /// The stage that a scene's section asks for.
    pub fn from_section(section: &WarpSection) -> Self {
        let order = match section.order {
            WarpOrder::Nearest => Order::Nearest,
            WarpOrder::Linear => Order::Linear,
            WarpOrder::Cubic => Order::Cubic,
        };
        Self { params: WarpParams { order, background: section.background } }
    }
}

impl Stage for Warp {
    fn name(&self) -> &'static str {
        "warp"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const {
            &[
                Slot::required("volume", &[Kind::Volume, Kind::Labels, Kind::Mask]),
                Slot::required("displacement", &[Kind::Displacement]),
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
        let displacement = inputs.displacement("displacement").expect("checked by the runner");
        let (artefact, resampled, total) = match inputs.get("volume").expect("checked by the runner") {
            Artefact::Volume(v) => {
                let w = warp::volume(v, displacement, &self.params, exec).map_err(stage_error!("warp"))?;
                (Artefact::Volume(w.output), w.voxels_resampled, w.voxels_total)
            }
            Artefact::Labels(l) => {
                let w = warp::labels(l, displacement, &self.params, exec).map_err(stage_error!("warp"))?;
                (Artefact::Labels(w.output), w.voxels_resampled, w.voxels_total)
            }
            Artefact::Mask(m) => {
                let w = warp::mask(m, displacement, exec).map_err(stage_error!("warp"))?;
                (Artefact::Mask(w.output), w.voxels_resampled, w.voxels_total)
            }
            _ => unreachable!("the runner checked the kinds of the slots"),
        };
        Ok(Product::new(artefact, json!({ "voxels_resampled": resampled, "voxels_total": total })))
    }
}
