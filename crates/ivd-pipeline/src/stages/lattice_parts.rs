use ivd_core::op::Slots as _;
use ivd_core::{Exec, Labels, Lattice, slots};
use ivd_lattice::extract::{LatticeFigures, Part, STAGE, extract_parts};
use serde_json::{Value, json};

use super::lattice_facts;
use crate::{Error, Facts, Input, Inputs, Runner, Stage, StageOutput, StageResult};

/// Labels that a stage's parameters list at most.
const LISTED: usize = 256;

/// Lattices of several labels, by priority, that are cut at once, so that what they share coincides: each with its label and a record of
/// its own, as they are asked for. The work is done once, for the first that isn't in the cache.
pub fn part_lattices<'a>(
    runner: Runner<'a>,
    labels: Input,
    ids: &'a [u16],
) -> impl Iterator<Item = Result<(u16, StageResult), Error>> + 'a {
    let inputs = Inputs::default().with("labels", labels);
    let mut cut: Option<Vec<Part>> = None;
    ids.iter().map(move |&label| {
        let part = PartLattice { ids, label };
        let mut work = || {
            let parts = match cut.take() {
                Some(parts) => parts,
                None => part.all(&inputs, runner.exec)?,
            };
            let (own, others) = parts.into_iter().partition(|part| part.id == label);
            cut = Some(others);
            product(own, runner.exec)
        };
        Ok((label, runner.run_with(&part, &inputs, false, &mut work)?))
    })
}

slots! {
    /// What they are cut from.
    struct Given<'a> { labels: &'a Labels }
}

/// The lattice of one of them.
struct PartLattice<'a> {
    ids: &'a [u16],
    label: u16,
}

impl PartLattice<'_> {
    fn all(&self, inputs: &Inputs, exec: &Exec) -> Result<Vec<Part>, Error> {
        let Given { labels } = inputs.take(STAGE.name)?;
        extract_parts(labels, self.ids, exec).map_err(Error::in_stage(STAGE.name))
    }
}

/// The part of a label, which is among those that were cut, as a product.
fn product(own: Vec<Part>, exec: &Exec) -> Result<StageOutput, Error> {
    let lattice: Lattice = own
        .into_iter()
        .next()
        .map(|part| part.lattice)
        .ok_or_else(|| Error::usage(STAGE.name, "no voxel has the label"))?;
    exec.check_cancelled()?;
    let figures = exec.run(|| LatticeFigures::of(&lattice));
    Ok(StageOutput::new(lattice, &figures))
}

impl Stage for PartLattice<'_> {
    fn facts(&self) -> Facts {
        lattice_facts(2, Given::SLOTS)
    }

    fn params(&self) -> Value {
        let Self { ids, label } = self;
        if ids.len() <= LISTED {
            return json!({ "parts": ids, "label": label });
        }
        // The list of thousands of labels would be in the record of each.
        let bytes: Vec<u8> = ids.iter().flat_map(|id| id.to_le_bytes()).collect();
        json!({ "parts": { "count": ids.len(), "hash": blake3::hash(&bytes).to_string() }, "label": label })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let own = self.all(inputs, exec)?.into_iter().filter(|part| part.id == self.label).collect();
        product(own, exec)
    }
}
