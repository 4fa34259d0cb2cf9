use std::borrow::Cow;
use std::cell::Cell;

use ivd_artefact::{Artefact, Kind};
use ivd_core::op::{Fill as _, Output, Voxelwise, object, schema_of};
use ivd_core::{Class, Displacement, Exec, Labels, Mask, Value as _, Volume};
use ivd_field::combine::{self, CombineParams, Combined, Operand};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Error, Facts, Inputs, Slot, Stage, StageOutput, mask_volume};

/// Combines volumes, labels or masks by union, intersection or difference, at rest or through displacements. The first says what comes of
/// it; operands of another kind are taken for that.
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
    /// Voxels of the result with a label or inside of the mask; not told of a volume.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 2))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub voxels_filled: Option<u64>,
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

/// Voxels that have a label.
pub(super) fn labelled(labels: &Labels) -> u64 {
    labels.ids().iter().filter(|id| **id != 0).count() as u64
}

/// An operand's value, its own or what it is taken for, and what it is read through.
type Taken<'a, V> = (Cow<'a, V>, Option<&'a Displacement>);

/// The operands in the order of their slots, taken for the first one's kind by `take`.
fn operands<V: ivd_core::Value + Clone>(
    inputs: &Inputs,
    take: impl Fn(&Artefact) -> Result<V, Error>,
) -> Result<Vec<Taken<'_, V>>, Error> {
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
        let value =
            V::of(artefact).map_or_else(|| take(artefact).map(Cow::Owned), |own| Ok(Cow::Borrowed(own)))?;
        operands.push((value, field));
    }
    Ok(operands)
}

fn borrowed<'a, V: Clone>(operands: &'a [Taken<'a, V>]) -> Vec<Operand<'a, V>> {
    operands
        .iter()
        .map(|(value, displacement)| Operand { value: &**value, displacement: *displacement })
        .collect()
}

/// What an operand is as a mask: where it has a label, or a value that isn't 0.
fn as_mask(artefact: &Artefact) -> Result<Mask, Error> {
    if let Some(mask) = Mask::of(artefact) {
        return Ok(mask.clone());
    }
    if let Some(labels) = Labels::of(artefact) {
        let inside: Vec<u8> = labels.ids().iter().map(|id| u8::from(*id != 0)).collect();
        return Ok(Mask::new(labels.grid().clone(), inside.into())?);
    }
    let volume = Volume::of(artefact).ok_or_else(|| of_no_use(artefact))?;
    Ok(Mask::from_volume(volume)?)
}

/// The highest id of the labels among the operands, where a mask needs one above it; else 0.
fn highest_id(inputs: &Inputs) -> Result<u16, Error> {
    let mut highest = 0;
    if Combine::OPERANDS.iter().all(|[slot, _]| inputs.value::<Mask>(slot).is_none()) {
        return Ok(highest);
    }
    let of = |labels: &Labels| labels.classes().iter().map(|class| class.id).max().unwrap_or(0);
    for artefact in Combine::OPERANDS.iter().filter_map(|[slot, _]| inputs.get(slot)) {
        if let Some(labels) = Labels::of(artefact) {
            highest = highest.max(of(labels));
        } else if let Some(volume) = Volume::of(artefact) {
            highest = highest.max(of(&Labels::from_volume(volume)?));
        }
    }
    Ok(highest)
}

/// What an operand is as labels: a mask is one class, with the next id after the last one, which no labels have.
fn as_labels(artefact: &Artefact, last: &Cell<u16>) -> Result<Labels, Error> {
    if let Some(volume) = Volume::of(artefact) {
        return Ok(Labels::from_volume(volume)?);
    }
    let mask = Mask::of(artefact).ok_or_else(|| of_no_use(artefact))?;
    let id = last.get().checked_add(1).inspect(|id| last.set(*id)).ok_or_else(|| {
        let problem = "the labels have class 65535: there is no id left for the mask; renumber them";
        Error::usage("combine", problem)
    })?;
    let labels: Vec<u16> = mask.inside().iter().map(|inside| if *inside != 0 { id } else { 0 }).collect();
    let (mean, voxels) = (f64::from(id), mask.count());
    let class = Class { id, name: None, mean, sd: 0.0, voxels, lower: None, upper: None };
    let classes = if voxels == 0 { Vec::new() } else { vec![class] };
    Ok(Labels::new(mask.grid().clone(), labels.into(), classes)?)
}

/// What an operand is as a volume: 1 inside of a mask, or where there is a label, and 0 elsewhere.
fn as_volume(artefact: &Artefact) -> Result<Volume, Error> {
    mask_volume(&as_mask(artefact)?)
}

fn of_no_use(artefact: &Artefact) -> Error {
    let kind = artefact.kind().name();
    Error::usage("combine", format!("an operand is a {kind} artefact; give volumes, labels or masks"))
}

impl Combine {
    /// The parameters, with windows of 0 to 1 for what stands among volumes and is none.
    fn among_volumes(&self, inputs: &Inputs, exec: &Exec) -> CombineParams {
        let artefacts: Vec<&Artefact> =
            Self::OPERANDS.iter().filter_map(|[slot, _]| inputs.get(slot)).collect();
        let given = &self.params.windows;
        if artefacts.iter().all(|artefact| Volume::of(artefact).is_some()) || given.len() > 1 {
            return self.params.clone();
        }
        let window = |artefact: &&Artefact| match Volume::of(artefact) {
            None => [0.0, 1.0],
            Some(volume) => {
                let own = || exec.run(|| volume.range()).unwrap_or([0.0, 1.0]);
                given.first().copied().unwrap_or_else(own)
            }
        };
        CombineParams { windows: artefacts.iter().map(window).collect(), ..self.params.clone() }
    }
}

fn product<V: Output>(combined: Combined<V>, filled: impl Fn(&V) -> Option<u64>) -> StageOutput {
    let Combined { output, voxels_changed, voxels_total, bricks_visited, bricks_total } = combined;
    let voxels_filled = filled(&output);
    let figures =
        CombineFigures { voxels_changed, voxels_filled, voxels_total, bricks_visited, bricks_total };
    StageOutput::new(output, &figures)
}

impl Stage for Combine {
    fn facts(&self) -> Facts {
        Facts {
            name: "combine",
            revision: 2,
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
            Voxelwise::Volume(_) => {
                let all = operands(inputs, as_volume)?;
                let params = self.among_volumes(inputs, exec);
                combine::volumes(&borrowed(&all), &params, exec).map(|v| product(v, |_| None))
            }
            Voxelwise::Labels(_) => {
                let last = Cell::new(highest_id(inputs)?);
                let all = operands(inputs, |artefact| as_labels(artefact, &last))?;
                combine::labels(&borrowed(&all), &self.params, exec)
                    .map(|l| product(l, |l| Some(labelled(l))))
            }
            Voxelwise::Mask(_) => {
                let all = operands(inputs, as_mask)?;
                combine::masks(&borrowed(&all), &self.params, exec).map(|m| product(m, |m| Some(m.count())))
            }
        }
        .map_err(Error::in_stage(self.name()))
    }
}
