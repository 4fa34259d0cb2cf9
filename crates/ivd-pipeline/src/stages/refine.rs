use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_lattice::figures;
use ivd_lattice::refine::{Method, RefineParams, Target};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{RefineMethod, RefineSection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Simplifies a lattice without a new vertex.
#[derive(Debug, Clone, PartialEq)]
pub struct Refine {
    /// Method and target.
    pub params: RefineParams,
}

impl Refine {
    /// The stage that a scene's section asks for.
    ///
    /// # Errors
    /// Where more than one target is given.
    pub fn from_section(section: &RefineSection) -> Result<Self, Error> {
        let target = match (section.level, section.ratio, section.max_error) {
            (None, None, None) => Target::Level(2),
            (Some(level), None, None) => Target::Level(level),
            (None, Some(ratio), None) => Target::Ratio(ratio),
            (None, None, Some(error)) => Target::MaxError(error),
            _ => return Err(Error::usage("refine", "give one of level, ratio and max_error, not several")),
        };
        let method = match section.method {
            RefineMethod::Collapse => Method::Collapse,
        };
        let params = RefineParams {
            method,
            target,
            max_turn_degrees: section.max_turn_degrees,
            shape_weight: section.shape_weight,
            ..RefineParams::default()
        };
        Ok(Self { params })
    }
}

impl Stage for Refine {
    fn name(&self) -> &'static str {
        "refine"
    }

    fn revision(&self) -> u32 {
        3
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("lattice", &[Kind::Lattice])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Lattice)
    }

    fn params(&self) -> Value {
        super::json(&self.params)
    }

    fn accuracy_knobs(&self) -> &'static [&'static str] {
        &["level", "ratio", "max_error"]
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let lattice = inputs.lattice("lattice").expect("checked by the runner");
        let refined =
            ivd_lattice::refine::collapse(lattice, &self.params, exec).map_err(stage_error!("refine"))?;
        exec.check_cancelled()?;
        let f = exec.run(|| figures::measure(&refined.lattice));
        let metrics = json!({
            "vertices_in": refined.vertices_in,
            "vertices": f.vertices,
            "triangles": f.triangles,
            "max_error_mm": refined.max_error_mm,
            "mean_error_mm": refined.mean_error_mm,
            "boundary_edges": f.boundary_edges,
            "non_manifold_edges": f.non_manifold_edges,
            "subset": is_subset(&refined.lattice, lattice),
            "level": refined.lattice.level,
            "reached": super::json(&refined.reached),
        });
        Ok(Product::new(Artefact::Lattice(refined.lattice), metrics))
    }
}

/// Whether every vertex of `part` is one of `whole`, address and place alike. Both lists ascend by address.
fn is_subset(part: &ivd_core::Lattice, whole: &ivd_core::Lattice) -> bool {
    let mut at = 0;
    part.keys.iter().zip(&part.places).all(|(key, place)| {
        while at < whole.keys.len() && whole.keys[at] < *key {
            at += 1;
        }
        at < whole.keys.len() && whole.keys[at] == *key && whole.places[at] == *place
    })
}
