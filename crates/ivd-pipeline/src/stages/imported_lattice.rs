use std::path::PathBuf;

use ivd_core::op::{Slots as _, object};
use ivd_core::{Exec, Volume, slots};
use ivd_io::mesh;
use ivd_lattice::extract::{LatticeFigures, STAGE};
use ivd_lattice::import::{ImportParams, lattice};
use serde_json::{Value, json};

use super::lattice_facts;
use crate::{Error, Facts, Inputs, Stage, StageOutput};

/// Takes a mesh of another program for the lattice of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedLattice {
    /// The mesh file.
    pub path: PathBuf,
    /// How it is taken.
    pub params: ImportParams,
}

slots! {
    /// What it becomes the lattice of.
    struct Given<'a> { volume: &'a Volume }
}

impl Stage for ImportedLattice {
    fn facts(&self) -> Facts {
        lattice_facts(2, Given::SLOTS)
    }

    fn params(&self) -> Value {
        json!({ "mesh": object(&self.params) })
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        Ok(vec![self.path.clone()])
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let Given { volume } = inputs.take(self.name())?;
        let mesh = mesh::read(&self.path, exec.memory_limit.unwrap_or(u64::MAX))
            .map_err(Error::in_stage(STAGE.name))?;
        let imported =
            lattice(&mesh, volume.grid(), &self.params, exec).map_err(Error::in_stage(STAGE.name))?;
        exec.check_cancelled()?;
        let mut figures = exec.run(|| LatticeFigures::of(&imported.lattice));
        figures.vertices_in = Some(imported.vertices_in);
        Ok(StageOutput::new(imported.lattice, &figures))
    }
}
