use ivd_artefact::Kind;
use ivd_core::op::{Fill as _, Op as _, Voxelwise, object, schema_of};
use ivd_core::{Displacement, Exec};
use ivd_field::combine::{self, CombineFigures, CombineParams, SceneCombine};
use serde_json::Value;

use crate::{Error, Facts, Inputs, Slot, Stage, StageOutput};

/// Combines volumes, labels or masks by union, intersection or difference, at rest or through displacements: the command's combination,
/// of up to eight files. The first says what comes of it; operands of another kind are taken for that.
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

/// The operands in the order of their slots.
fn operands(inputs: &Inputs) -> Result<Vec<combine::Given<'_>>, Error> {
    let (values, mut operands) = (inputs.values(), Vec::new());
    for [slot, displacement] in Combine::OPERANDS {
        let field: Option<&Displacement> = inputs.value(displacement);
        if inputs.get(slot).is_some() {
            let operand = Voxelwise::fill(&values, slot);
            operands.push((operand.map_err(|failure| Error::failed("combine", failure))?, field));
        } else if field.is_some() {
            let problem = format!("{displacement}: there is no operand {slot} to deform by it");
            return Err(Error::usage("combine", problem));
        }
    }
    Ok(operands)
}

impl Stage for Combine {
    fn facts(&self) -> Facts {
        Facts {
            name: combine::STAGE.name,
            revision: SceneCombine::REVISION,
            inputs: const { &Self::SLOTS },
            output: None,
            figures: schema_of::<CombineFigures>,
        }
    }

    fn params(&self) -> Value {
        object(&self.params).into()
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let (artefact, figures) =
            combine::any(&operands(inputs)?, &self.params, exec).map_err(Error::in_stage(self.name()))?;
        Ok(StageOutput::new(artefact, &figures))
    }
}
