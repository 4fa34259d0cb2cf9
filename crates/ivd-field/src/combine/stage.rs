//! The stage as scenes see it.

use ivd_core::op::{Failure, Memory, Method, Op, Output, Place, Stage, Voxelwise, Want, method};
use ivd_core::{Artefact, Displacement, Exec, ParamError, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CombineParams, Combined, any};
use crate::lies::{Lies, OF_SCENE};

/// The stage: what comes of a scene's volume is combined with something else.
pub const STAGE: Stage = Stage {
    name: "combine",
    about: "Combines volumes, labels or masks by union, intersection or difference, at rest or through displacements.",
    selector: "",
    methods: METHODS,
    positional: &["volume", "with"],
    places: &[Place {
        from: &[("volume", "deformed"), ("volume", "volume")],
        named: &[("with", OF_SCENE)],
        ..Place::only("result")
    }],
    quiet: true,
    memory: Memory { voxel: 12, reached: 0, triangle: 0 },
};
const METHODS: &[Method] = &[method::<SceneCombine>("")];

slots! {
    /// What is combined, and what the other operand is read through.
    pub struct Inputs<'a> { volume: Voxelwise<'a>, with: Voxelwise<'a>, displacement: Option<&'a Displacement> }
}

/// A combination in a scene: the volume, deformed where it is, is the first operand.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SceneCombine {
    /// Operation and windows.
    #[serde(flatten)]
    pub combine: CombineParams,
    /// The other operand: `mask` or `labels`, those of the scene, or the file of a volume, of labels or of a mask, relative to the
    /// scene's folder.
    pub with: Option<String>,
    /// Where the other operand lies. Without it at rest where it is of the scene, else where the deformed body is.
    pub space: Option<Lies>,
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

/// The value and the figures of a combination.
pub(super) fn told<V: Output>(
    combined: Combined<V>,
    filled: impl Fn(&V) -> Option<u64>,
) -> (Artefact, CombineFigures) {
    let Combined { output, voxels_changed, voxels_total, bricks_visited, bricks_total } = combined;
    let voxels_filled = filled(&output);
    let figures =
        CombineFigures { voxels_changed, voxels_filled, voxels_total, bricks_visited, bricks_total };
    (output.into_artefact(), figures)
}

impl Op for SceneCombine {
    const REVISION: u32 = 2;
    type Inputs<'a> = Inputs<'a>;
    type Gives = (Artefact, CombineFigures);

    fn check_together(&self) -> Result<(), ParamError> {
        self.combine.check(2)
    }

    fn wants(&self, slot: &str) -> Want {
        let is_read = slot != "displacement" || Lies::or_of(self.space, self.with.as_deref()) == Lies::Rest;
        if is_read { Want::Yes } else { Want::No }
    }

    fn idle(&self) -> Option<&'static str> {
        self.with.is_none().then_some("the scene has nothing to combine with")
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Inputs { volume, with, displacement } = inputs;
        // The first operand has been deformed already, or nothing deforms it.
        Ok(any(&[(volume, None), (with, displacement)], &self.combine, exec)?)
    }
}
