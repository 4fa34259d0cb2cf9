//! The stage as scenes and commands see it.

use ivd_core::op::{Failure, Memory, Method, Op, Place, PlaceKind, Stage, Voxelwise, method};
use ivd_core::{Artefact, Displacement, Exec, Value, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{WarpParams, Warped, labels, mask, volume};

/// The stage: its method, and where it stands in a scene.
pub const STAGE: Stage = Stage {
    name: "warp",
    about: "Resamples a volume, labels or a mask through a displacement.",
    selector: "",
    methods: METHODS,
    positional: &["volume", "displacement"],
    places: &[
        Place::only("deformed"),
        Place { variant: "labels", ..carried(&[("volume", "labels")], "labels_deformed") },
        Place { variant: "mask", ..carried(&[("volume", "mask")], "mask_deformed") },
    ],
    quiet: false,
    memory: Memory { voxel: 12, reached: 0, triangle: 0 },
};
/// What a displacement does to a value that goes along with the volume, where an output asks for it: what is said of the volume's background
/// is none of its.
const fn carried(from: &'static [(&'static str, &'static str)], gives: &'static str) -> Place {
    Place { from, kind: PlaceKind::Fixed { method: &METHODS[0] }, for_outputs: true, ..Place::only(gives) }
}

const METHODS: &[Method] = &[method::<WarpParams>("")];

slots! {
    /// What is resampled, and through what.
    pub struct WarpInputs<'a> { volume: Voxelwise<'a>, displacement: &'a Displacement }
}

/// What a warp comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct WarpFigures {
    /// Voxels that were computed; all others are the input's.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_resampled: u64,
    /// Voxels of the grid.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_total: u64,
}

/// The value and the figures of a warp.
fn told<V: Value>(warped: Warped<V>) -> (Artefact, WarpFigures) {
    let Warped { output, voxels_resampled, voxels_total } = warped;
    (output.into_artefact(), WarpFigures { voxels_resampled, voxels_total })
}

impl Op for WarpParams {
    const REVISION: u32 = 3;
    type Inputs<'a> = WarpInputs<'a>;
    type Gives = (Artefact, WarpFigures);

    fn run(&self, inputs: WarpInputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let WarpInputs { volume: input, displacement } = inputs;
        Ok(match input {
            Voxelwise::Volume(input) => told(volume(input, displacement, self, exec)?),
            Voxelwise::Labels(input) => told(labels(input, displacement, self, exec)?),
            Voxelwise::Mask(input) => told(mask(input, displacement, exec)?),
        })
    }
}
