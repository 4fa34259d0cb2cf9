use ivd_core::op::{Amount, Failure, Memory, Method, Op, Place, Stage, method};
use ivd_core::{Exec, Lattice, Octree, ParamError, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Params;

/// The stage as scenes and commands see it.
pub const STAGE: Stage = Stage {
    name: "octree",
    about: "Indexes a lattice's grid.",
    selector: "",
    methods: METHODS,
    positional: &["lattice"],
    places: &[Place {
        for_readers: true,
        unread: "the map looks for no nearest lattice point",
        amount: Amount::VoxelsInReach,
        ..Place::only("octree")
    }],
    quiet: false,
    memory: Memory { voxel: 1, reached: 0, triangle: 60 },
};
const METHODS: &[Method] = &[method::<Params>("")];

slots! {
    /// What an octree is built over.
    pub struct Inputs<'a> { lattice: &'a Lattice }
}

/// What an octree comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Nodes, leaves among them.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub nodes: usize,
    /// Nodes without children.
    #[schemars(extend("x-unit" = "1"))]
    pub leaves: usize,
    /// Halvings from the root to the smallest leaf.
    #[schemars(extend("x-unit" = "1"))]
    pub depth: u8,
    /// Size in memory.
    #[schemars(extend("x-unit" = "bytes"))]
    pub bytes: u64,
}

impl Op for Params {
    const REVISION: u32 = 1;
    type Inputs<'a> = Inputs<'a>;
    type Gives = (Octree, Figures);

    fn check_together(&self) -> Result<(), ParamError> {
        if self.leaf_size.is_power_of_two() {
            return Ok(());
        }
        Err(ParamError::new(
            "leaf_size",
            format!("{} voxels", self.leaf_size),
            "use 1, 2, 4, 8, 16, 32 or 64",
        ))
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let octree = crate::build(inputs.lattice, self, exec)?;
        let figures = Figures {
            nodes: octree.nodes().len(),
            leaves: octree.leaves(),
            depth: octree.depth(),
            bytes: octree.bytes(),
        };
        Ok((octree, figures))
    }
}
