use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use ivd_artefact::{Artefact, Kind};
use ivd_core::{BRICK, BrickIndex, ElementKey, Exec, Lattice};
use ivd_lattice::extract::{Part, extract_parts};
use ivd_lattice::figures;
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Labels that a stage's parameters list at most.
const LISTED: usize = 256;

/// The lattice of one of several labels that are cut at once, so that what they share coincides.
///
/// The stages of one set share their work: the first that runs cuts for all.
#[derive(Debug, Clone)]
pub struct PartLattice {
    ids: Arc<Vec<u16>>,
    label: u16,
    cut: Arc<Mutex<Vec<Part>>>,
}

impl PartLattice {
    /// A stage for each label, by priority.
    pub fn all(ids: &[u16]) -> Vec<Self> {
        let (shared, cut) = (Arc::new(ids.to_vec()), Arc::default());
        ids.iter().map(|&label| Self { ids: Arc::clone(&shared), label, cut: Arc::clone(&cut) }).collect()
    }

    /// The label.
    pub fn label(&self) -> u16 {
        self.label
    }
}

impl Stage for PartLattice {
    fn name(&self) -> &'static str {
        "lattice"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("labels", &[Kind::Labels])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Lattice)
    }

    fn params(&self) -> Value {
        let (ids, label) = (&*self.ids, self.label);
        if ids.len() <= LISTED {
            return json!({ "parts": ids, "label": label });
        }
        // The list of thousands of labels would be in the record of each.
        let bytes: Vec<u8> = ids.iter().flat_map(|id| id.to_le_bytes()).collect();
        json!({ "parts": { "count": ids.len(), "hash": blake3::hash(&bytes).to_string() }, "label": label })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let labels = inputs.labels("labels").expect("checked by the runner");
        let mut cut = self.cut.lock().unwrap_or_else(PoisonError::into_inner);
        if !cut.iter().any(|part| part.id == self.label) {
            *cut = extract_parts(labels, &self.ids, exec).map_err(stage_error!("lattice"))?;
        }
        let at = cut.iter().position(|part| part.id == self.label).expect("each label has its part");
        let lattice = cut.swap_remove(at).lattice;
        drop(cut);
        exec.check_cancelled()?;
        let f = exec.run(|| figures::measure(&lattice));
        let (active, total) = bricks(&lattice);
        let metrics = super::lattice::metrics(&f, active, total);
        Ok(Product::new(Artefact::Lattice(lattice), metrics))
    }
}

/// Bricks that hold vertices of a lattice, the border layer's among those next to it, and bricks of its grid.
pub(super) fn bricks(lattice: &Lattice) -> (u64, u64) {
    let dims = lattice.grid.dims();
    let brick = |key: &ElementKey| {
        let voxel = key.voxel(dims);
        let within: [usize; 3] = std::array::from_fn(|a| voxel[a].clamp(0, dims[a] as i64 - 1) as usize);
        within.map(|v| v / BRICK)
    };
    let active: BTreeSet<[usize; 3]> = lattice.keys.iter().map(brick).collect();
    (active.len() as u64, BrickIndex::dims_for(dims).map(|n| n as u64).iter().product())
}
