use ivd_core::op::{Output, Slots as _, Voxelwise, object, schema_of};
use ivd_core::{Displacement, Exec, slots};
use ivd_field::clip::{self, By, ClipParams, Clipped, Tag};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::combine::labelled;
use crate::{Error, Facts, Inputs, Stage, StageOutput};

/// Keeps the part of a volume, of labels or of a mask that lies on given sides of planes, in boxes, and in what is tagged.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clip {
    /// Planes, boxes, class, background.
    pub params: ClipParams,
}

slots! {
    /// What is clipped, and by what beside planes and boxes.
    struct Given<'a> { volume: Voxelwise<'a>, tag: Option<Tag<'a>>, displacement: Option<&'a Displacement> }
}

/// What a clip comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ClipFigures {
    /// Voxels as they were.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_kept: u64,
    /// Voxels of the result with a label or inside of the mask; not told of a volume.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 2))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub voxels_filled: Option<u64>,
    /// Voxels that became background.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_clipped: u64,
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

fn product<V: Output>(clipped: Clipped<V>, filled: impl Fn(&V) -> Option<u64>) -> StageOutput {
    let Clipped { output, voxels_kept, voxels_clipped, voxels_total, bricks_visited, bricks_total } = clipped;
    let voxels_filled = filled(&output);
    let figures = ClipFigures {
        voxels_kept,
        voxels_filled,
        voxels_clipped,
        voxels_total,
        bricks_visited,
        bricks_total,
    };
    StageOutput::new(output, &figures)
}

impl Stage for Clip {
    fn facts(&self) -> Facts {
        Facts {
            name: "clip",
            revision: 2,
            inputs: Given::SLOTS,
            output: None,
            figures: schema_of::<ClipFigures>,
        }
    }

    fn params(&self) -> Value {
        object(&self.params).into()
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let Given { volume, tag, displacement } = inputs.take(self.name())?;
        let (params, by) = (&self.params, &By { tag, displacement });
        match volume {
            Voxelwise::Volume(volume) => clip::volume(volume, params, by, exec).map(|v| product(v, |_| None)),
            Voxelwise::Labels(labels) => {
                clip::labels(labels, params, by, exec).map(|l| product(l, |l| Some(labelled(l))))
            }
            Voxelwise::Mask(mask) => {
                clip::mask(mask, params, by, exec).map(|m| product(m, |m| Some(m.count())))
            }
        }
        .map_err(Error::in_stage(self.name()))
    }
}
