use ivd_core::op::{Slots as _, Voxelwise, schema_of};
use ivd_core::{Exec, Grid, Labels, counted, slots};
use ivd_field::onto::{self, Onto};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::IMPORT;
use crate::{Error, Facts, Inputs, Metrics, Stage, StageOutput};

/// Puts labels or a mask onto the grid of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PutOnto;

slots! {
    /// What is put, and whose grid it is put onto.
    struct Given<'a> { drawn: Voxelwise<'a>, like: Voxelwise<'a> }
}

/// What labels or a mask come to on another grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PutOntoFigures {
    /// Voxels along x, y and z.
    #[schemars(extend("x-unit" = "voxels"))]
    pub dims: [usize; 3],
    /// Distance of voxels along x, y and z.
    #[schemars(extend("x-unit" = "mm"))]
    pub spacing: [f64; 3],
    /// Voxels with a label, or inside.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_filled: u64,
    /// Voxels of the volume's grid that lie outside of the grid of what was put: they are 0.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 2))]
    pub voxels_without_source: u64,
    /// Voxels with a label, or inside, that lie outside of the volume's grid: they are left out.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 3))]
    pub voxels_left_out: u64,
    /// Classes of which no voxel is left.
    #[schemars(extend("x-unit" = "1"))]
    #[serde(default)]
    pub classes_lost: Vec<u16>,
}

impl PutOntoFigures {
    fn of<T>(put: &Onto<T>, grid: &Grid, voxels_filled: u64) -> Self {
        Self {
            dims: grid.dims(),
            spacing: grid.spacing(),
            voxels_filled,
            voxels_without_source: put.without_source,
            voxels_left_out: put.left_out,
            classes_lost: Vec::new(),
        }
    }

    /// The same, where anything of what was given is left.
    fn some(self, what: &'static str) -> Result<Self, Error> {
        if self.voxels_filled > 0 || self.voxels_left_out == 0 {
            return Ok(self);
        }
        let its = counted(self.voxels_left_out, "voxel", "voxels");
        let problem = format!("none of its {its} lies within the volume");
        Err(Error::in_stage(IMPORT)(ivd_core::Error::Mismatch {
            what,
            problem,
            remedy: onto::NOTHING_SHARED,
        }))
    }

    /// What a person should know: that some of it had no counterpart on the other side.
    pub(super) fn remark(&self) -> Option<String> {
        let mut told = Vec::new();
        if self.voxels_without_source > 0 {
            let all: usize = self.dims.iter().product();
            told.push(counted(
                self.voxels_without_source,
                &format!("of the volume's {all} voxels lies outside of the file and has 0"),
                &format!("of the volume's {all} voxels lie outside of the file and have 0"),
            ));
        }
        if self.voxels_left_out > 0 {
            told.push(counted(
                self.voxels_left_out,
                "voxel of the file lies outside of the volume and is left out",
                "voxels of the file lie outside of the volume and are left out",
            ));
        }
        if !self.classes_lost.is_empty() {
            let lost: Vec<String> = self.classes_lost.iter().map(u16::to_string).collect();
            told.push(format!(
                "no voxel is left of class {}: outside of the volume, or too small for its voxels",
                lost.join(", ")
            ));
        }
        (!told.is_empty()).then(|| told.join("; "))
    }
}

impl Stage for PutOnto {
    fn facts(&self) -> Facts {
        Facts {
            name: IMPORT,
            revision: 2,
            inputs: Given::SLOTS,
            output: None,
            figures: schema_of::<PutOntoFigures>,
        }
    }

    fn remark(&self, figures: &Metrics) -> Result<Option<String>, Error> {
        Ok(figures.read::<PutOntoFigures>(self.name())?.remark())
    }

    fn params(&self) -> Value {
        json!({ "onto": true })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let Given { drawn, like } = inputs.take(self.name())?;
        let grid = like.grid();
        match drawn {
            Voxelwise::Volume(_) => {
                Err(Error::usage(IMPORT, "what is put onto another grid is labels or a mask, not a volume"))
            }
            Voxelwise::Labels(labels) => {
                let (labels, figures) = labels_on(labels, like, exec)?;
                Ok(StageOutput::new(labels, &figures))
            }
            Voxelwise::Mask(mask) => {
                let put = onto::mask(mask, grid, exec).map_err(Error::in_stage(IMPORT))?;
                let figures = PutOntoFigures::of(&put, grid, put.output.count()).some("mask")?;
                Ok(StageOutput::new(put.output, &figures))
            }
        }
    }
}

/// Labels on another grid, and what they come to there. On a volume's what is told of their classes is what it holds there.
pub(super) fn labels_on(
    labels: &Labels,
    like: Voxelwise<'_>,
    exec: &Exec,
) -> Result<(Labels, PutOntoFigures), Error> {
    let grid = like.grid();
    let put = onto::labels(labels, grid, exec).map_err(Error::in_stage(IMPORT))?;
    let filled = exec.run(|| put.output.ids().iter().filter(|id| **id != 0).count());
    let figures = PutOntoFigures::of(&put, grid, filled as u64).some("labels")?;
    let figures = PutOntoFigures { classes_lost: lost(labels, &put.output), ..figures };
    let labels = match like {
        Voxelwise::Volume(volume) => exec.run(|| ivd_segment::measured(&put.output, volume, exec))?,
        Voxelwise::Labels(_) | Voxelwise::Mask(_) => put.output,
    };
    Ok((labels, figures))
}

/// Classes that have voxels before and none after.
fn lost(before: &Labels, after: &Labels) -> Vec<u16> {
    let classes = before.classes().iter().zip(after.classes());
    classes
        .filter(|(before, after)| before.voxels > 0 && after.voxels == 0)
        .map(|(class, _)| class.id)
        .collect()
}
