use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_octree::Params;
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::OctreeSection;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Indexes a lattice's grid.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Octree {
    /// Leaf size.
    pub params: Params,
}

impl Octree {
    /// The stage that a scene's section asks for.
    pub fn from_section(section: &OctreeSection) -> Self {
        Self { params: Params { leaf_size: section.leaf_size } }
    }
}

impl Stage for Octree {
    fn name(&self) -> &'static str {
        "octree"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("lattice", &[Kind::Lattice])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Octree)
    }

    fn params(&self) -> Value {
        super::json(&self.params)
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let lattice = inputs.lattice("lattice").expect("checked by the runner");
        let octree = ivd_octree::build(lattice, &self.params, exec).map_err(stage_error!("octree"))?;
        let metrics = json!({
            "nodes": octree.nodes.len(),
            "leaves": octree.leaves(),
            "depth": octree.depth,
            "bytes": octree.bytes(),
        });
        Ok(Product::new(Artefact::Octree(octree), metrics))
    }
}
