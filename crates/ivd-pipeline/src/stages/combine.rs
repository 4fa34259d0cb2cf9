use ivd_artefact::Kind;
use ivd_core::op::{Fill as _, Output, Voxelwise, object, schema_of};
use ivd_core::{Displacement, Exec};
use ivd_field::combine::{self, CombineParams, Combined, Operand};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Error, Facts, Inputs, Slot, Stage, StageOutput};

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

/// What a combination comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CombineFigures {
    /// Voxels whose stored value isn't the first operand's (as it is deformed).
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_changed: u64,
    /// Voxels of the grid.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_total: u64,
    /// Bricks (8³ voxels) that were looked at voxel by voxel.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_visited: u64,
    /// Bricks of the grid.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_total: u64,
}

/// The operands, all of the first one's kind, in the order of their slots.
fn operands<V: ivd_core::Value>(inputs: &Inputs) -> Result<Vec<Operand<'_, V>>, Error> {
    let mut operands = Vec::new();
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
            let (first, kind) = (V::KIND.name(), artefact.kind().name());
            let problem =
                format!("a is a {first} artefact and {slot} a {kind} artefact; give operands of one kind");
            return Err(Error::usage("combine", problem));
        };
        operands.push(Operand { value, displacement: field });
    }
    Ok(operands)
}

fn product<V: Output>(combined: Combined<V>) -> StageOutput {
    let Combined { output, voxels_changed, voxels_total, bricks_visited, bricks_total } = combined;
    StageOutput::new(output, &CombineFigures { voxels_changed, voxels_total, bricks_visited, bricks_total })
}

impl Stage for Combine {
    fn facts(&self) -> Facts {
        Facts {
            name: "combine",
            revision: 1,
            inputs: const { &Self::SLOTS },
            output: None,
            figures: schema_of::<CombineFigures>,
        }
    }

    fn params(&self) -> Value {
        object(&self.params).into()
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let [first, _] = Self::OPERANDS[0];
        let first = Voxelwise::fill(&inputs.values(), first);
        match first.map_err(|failure| Error::failed(self.name(), failure))? {
            Voxelwise::Volume(_) => combine::volumes(&operands(inputs)?, &self.params, exec).map(product),
            Voxelwise::Labels(_) => combine::labels(&operands(inputs)?, &self.params, exec).map(product),
            Voxelwise::Mask(_) => combine::masks(&operands(inputs)?, &self.params, exec).map(product),
        }
        .map_err(Error::in_stage(self.name()))
    }
}
