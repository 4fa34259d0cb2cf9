use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_deform::space::{self, Start, Step};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::SpaceSection;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Displaces voxels without a lattice, or goes on from a displacement.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Space {
    /// What is done, in its order.
    pub steps: Vec<Step>,
}

impl Space {
    /// The stage that a scene's section asks for.
    ///
    /// # Errors
    /// A step with a key that is missing, not read or out of its domain.
    pub fn from_section(section: &SpaceSection) -> Result<Self, Error> {
        Ok(Self { steps: section.steps().map_err(|e| Error::usage("space", e))? })
    }

    /// Whether it needs labels.
    pub fn knows_classes(&self) -> bool {
        self.steps.iter().any(|step| matches!(step, Step::Chain(mail) if !mail.classes.is_empty()))
    }
}

impl Stage for Space {
    fn name(&self) -> &'static str {
        "space"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const {
            &[
                Slot::required("volume", &[Kind::Volume, Kind::Labels, Kind::Mask]),
                Slot::optional("after", &[Kind::Displacement]),
                Slot::optional("labels", &[Kind::Labels]),
            ]
        }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Displacement)
    }

    fn params(&self) -> Value {
        json!({ "steps": super::json(&self.steps) })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let grid = match inputs.get("volume").expect("checked by the runner") {
            Artefact::Volume(volume) => volume.grid(),
            Artefact::Labels(labels) => labels.grid(),
            Artefact::Mask(mask) => mask.grid(),
            _ => unreachable!("the runner checked the kinds of the slots"),
        };
        let start = Start { after: inputs.displacement("after"), labels: inputs.labels("labels") };
        let made = space::displace(grid, &self.steps, &start, exec).map_err(stage_error!("space"))?;
        let metrics = json!({
            "voxels_moved": made.voxels_moved,
            "bricks_touched": made.bricks_touched,
            "bricks_total": made.bricks_total,
            "min_det_j": made.min_det_j,
            "folds": made.folds,
            "parts": made.parts,
            "short_mm": made.short_mm,
            "inverse_residual_max_voxel": made.inverse_residual_max_voxel,
            "two_sided": made.displacement.is_two_sided(),
            "voxels_vacated": made.voxels_vacated,
            "motion_mm_histogram": super::json(&made.motion_mm),
            "det_j_histogram": super::json(&made.det_j),
        });
        Ok(Product::new(Artefact::Displacement(made.displacement), metrics))
    }
}
