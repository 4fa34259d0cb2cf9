use ivd_artefact::{Artefact, Kind};
use ivd_core::{Displacement, Exec};
use ivd_deform::cvg::{self, CombineParams, Combined, Operand};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Combines volumes, labels or masks by union, intersection or difference, at rest or through displacements.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Combine {
    /// Operation and windows.
    pub params: CombineParams,
}

const DATA: &[Kind] = &[Kind::Volume, Kind::Labels, Kind::Mask];
const FIELD: &[Kind] = &[Kind::Displacement];

impl Combine {
    /// Slots of the operands in their order, and of what each is read through.
    pub const OPERANDS: [[&'static str; 2]; 8] = [
        ["a", "displacement_a"],
        ["b", "displacement_b"],
        ["c", "displacement_c"],
        ["d", "displacement_d"],
        ["e", "displacement_e"],
        ["f", "displacement_f"],
        ["g", "displacement_g"],
        ["h", "displacement_h"],
    ];

    /// Every operand's slot, then every displacement's; the first two operands are required.
    const SLOTS: [Slot; 16] = {
        let mut slots = [Slot::required("a", DATA); 16];
        let mut n = 0;
        while n < 8 {
            let [operand, displacement] = Self::OPERANDS[n];
            slots[n] = if n < 2 { Slot::required(operand, DATA) } else { Slot::optional(operand, DATA) };
            slots[8 + n] = Slot::optional(displacement, FIELD);
            n += 1;
        }
        slots
    };
}

/// The operands of one kind, in the order of their slots.
fn operands<V: ivd_core::Value>(inputs: &Inputs) -> Result<Vec<Operand<'_, V>>, Error> {
    let mut operands = Vec::new();
    let first = inputs.get("a").expect("checked by the runner").kind().name();
    for [slot, displacement] in Combine::OPERANDS {
        let field: Option<&Displacement> = inputs.value(displacement);
        let Some(artefact) = inputs.get(slot) else {
            if field.is_some() {
                let problem = format!("{displacement}: there is no operand {slot} to deform by it");
                return Err(Error::usage("combine", problem));
            }
            continue;
        };
        let Some(value) = V::of(artefact) else {
            let kind = artefact.kind().name();
            let problem =
                format!("a is a {first} artefact and {slot} a {kind} artefact; give operands of one kind");
            return Err(Error::usage("combine", problem));
        };
        operands.push(Operand { value, displacement: field });
    }
    Ok(operands)
}

fn product<V: ivd_core::Value>(combined: Combined<V>) -> Product {
    let metrics = json!({
        "voxels_changed": combined.voxels_changed,
        "voxels_total": combined.voxels_total,
        "bricks_visited": combined.bricks_visited,
        "bricks_total": combined.bricks_total,
    });
    Product::new(combined.output, metrics)
}

impl Stage for Combine {
    fn name(&self) -> &'static str {
        "combine"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &Self::SLOTS }
    }

    fn output(&self) -> Option<Kind> {
        None
    }

    fn params(&self) -> Value {
        super::json(&self.params)
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        match inputs.get("a").expect("checked by the runner") {
            Artefact::Volume(_) => {
                let all = operands(inputs)?;
                let combined = cvg::volumes(&all, &self.params, exec).map_err(stage_error!("combine"))?;
                Ok(product(combined))
            }
            Artefact::Labels(_) => {
                let all = operands(inputs)?;
                let combined = cvg::labels(&all, &self.params, exec).map_err(stage_error!("combine"))?;
                Ok(product(combined))
            }
            Artefact::Mask(_) => {
                let all = operands(inputs)?;
                let combined = cvg::masks(&all, &self.params, exec).map_err(stage_error!("combine"))?;
                Ok(product(combined))
            }
            _ => unreachable!("the runner checked the kinds of the slots"),
        }
    }
}
