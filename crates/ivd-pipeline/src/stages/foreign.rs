use std::path::PathBuf;

use ivd_artefact::Kind;
use ivd_core::{Exec, Volume};
use ivd_lattice::extract::LatticeFigures;
use ivd_lattice::foreign::{ForeignParams, lattice};
use ivd_lattice::formats;
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Takes a mesh of another program for the lattice of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeignLattice {
    /// The mesh file.
    pub path: PathBuf,
    /// How it is taken.
    pub params: ForeignParams,
}

impl Stage for ForeignLattice {
    fn name(&self) -> &'static str {
        "lattice"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("volume", &[Kind::Volume])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Lattice)
    }

    fn params(&self) -> Value {
        json!({ "mesh": super::json(&self.params) })
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        Ok(vec![self.path.clone()])
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume: &Volume = inputs.value("volume").expect("checked by the runner");
        let mesh = formats::read(&self.path, exec.memory_limit.unwrap_or(u64::MAX))
            .map_err(stage_error!("lattice"))?;
        let foreign = lattice(&mesh, volume.grid(), &self.params, exec).map_err(stage_error!("lattice"))?;
        exec.check_cancelled()?;
        let mut figures = exec.run(|| LatticeFigures::of(&foreign.lattice));
        figures.vertices_in = Some(foreign.vertices_in);
        Ok(Product::new(foreign.lattice, super::json(&figures)))
    }
}
