use ivd_artefact::{Artefact, Kind};
use ivd_boundary::Params;
use ivd_core::Exec;
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{self, BoundarySection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Isolates one part.
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// Which part.
    pub params: Params,
}

impl Boundary {
    /// The stage that a scene's section asks for; `iso` stands in for `above` where no labels are used.
    pub fn from_section(section: &BoundarySection, iso: Option<f64>) -> Self {
        Self {
            params: Params {
                class: section.class.map(class_choice),
                seed: section.seed,
                fill_holes: section.fill_holes,
                above: section.above.or(iso),
            },
        }
    }
}

/// The stage crate's word for a scene's class.
pub(crate) fn class_choice(choice: scene::ClassChoice) -> ivd_boundary::ClassChoice {
    use crate::scene::ClassWord;
    match choice {
        scene::ClassChoice::Id(id) => ivd_boundary::ClassChoice::Id(id),
        scene::ClassChoice::Word(ClassWord::Densest) => ivd_boundary::ClassChoice::Densest,
        scene::ClassChoice::Word(ClassWord::Largest) => ivd_boundary::ClassChoice::Largest,
    }
}

impl Stage for Boundary {
    fn name(&self) -> &'static str {
        "boundary"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("volume", &[Kind::Volume]), Slot::optional("labels", &[Kind::Labels])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Mask)
    }

    fn params(&self) -> Value {
        super::json(&self.params)
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume = inputs.volume("volume").expect("checked by the runner");
        let labels = inputs.labels("labels");
        // Neither labels nor a value: the two classes of least inertia tell the part from its surroundings.
        let split = match (labels, self.params.above) {
            (None, None) => {
                let two = ivd_segment::KmvsParams { k: 2, ..Default::default() };
                Some(ivd_segment::kmvs(volume, None, &two, exec).map_err(stage_error!("boundary"))?.labels)
            }
            _ => None,
        };
        let part = ivd_boundary::component(volume, labels.or(split.as_ref()), &self.params, exec)
            .map_err(stage_error!("boundary"))?;
        let total = volume.grid().len() as f64;
        let metrics = json!({
            "voxels": part.voxels,
            "iterations": 0,
            "energy_first": null,
            "energy_last": null,
            "active_fraction": part.voxels as f64 / total,
            "class": part.class,
            "components": part.components,
            "filled": part.filled,
            "lower": part.lower,
            "upper": part.upper,
        });
        Ok(Product::new(Artefact::Mask(part.mask), metrics))
    }
}
