use ivd_artefact::{Artefact, Kind};
use ivd_atf::Params;
use ivd_core::Exec;
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::AtfSection;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Colours a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Atf {
    /// Resolution and opacity.
    pub params: Params,
    /// The isovalue that splits a volume without labels.
    pub iso: Option<f64>,
}

impl Atf {
    /// The stage that a scene's section asks for.
    pub fn from_section(section: &AtfSection, iso: Option<f64>) -> Self {
        let params = Params {
            resolution: section.resolution,
            max_opacity: section.max_opacity,
            min_opacity: section.min_opacity,
            size_exponent: section.size_exponent,
            softness: section.softness,
        };
        Self { params, iso }
    }
}

impl Stage for Atf {
    fn name(&self) -> &'static str {
        "atf"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("volume", &[Kind::Volume]), Slot::optional("labels", &[Kind::Labels])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Transfer)
    }

    fn params(&self) -> Value {
        json!({ "atf": super::json(&self.params), "iso": self.iso })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume = inputs.volume("volume").expect("checked by the runner");
        let built = match (inputs.labels("labels"), self.iso) {
            (Some(labels), _) => ivd_atf::transfer(volume, labels, &self.params, exec),
            (None, Some(iso)) => ivd_atf::from_isovalue(volume, iso, &self.params, exec),
            (None, None) => {
                return Err(Error::usage("atf", "needs labels, or an isovalue to split the volume at"));
            }
        }
        .map_err(stage_error!("atf"))?;
        let metrics = json!({ "entries": built.entries, "opacity_range": built.opacity_range });
        Ok(Product::new(Artefact::Transfer(built.transfer), metrics))
    }
}
