use ivd_core::op::{Slots as _, object, schema_of};
use ivd_core::{Exec, op};
use ivd_field::clip::{self, By, ClipFigures, ClipParams, Given};
use serde_json::Value;

use crate::{Error, Facts, Inputs, Metrics, Stage, StageOutput};

/// Keeps the part of a volume, of labels or of a mask that lies on given sides of planes, in boxes, and in what is tagged: the command's
/// clip, whose inputs are files.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clip {
    /// Planes, boxes, class, background.
    pub params: ClipParams,
}

impl Stage for Clip {
    fn facts(&self) -> Facts {
        Facts {
            name: clip::STAGE.name,
            revision: <clip::SceneClip as op::Op>::REVISION,
            inputs: Given::SLOTS,
            output: None,
            figures: schema_of::<ClipFigures>,
        }
    }

    fn remark(&self, figures: &Metrics) -> Result<Option<String>, Error> {
        Ok(figures.read::<ClipFigures>(self.name())?.remark())
    }

    fn params(&self) -> Value {
        object(&self.params).into()
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let Given { volume, tag, displacement } = inputs.take(self.name())?;
        let (artefact, figures) = clip::any(volume, &self.params, &By { tag, displacement }, exec)
            .map_err(Error::in_stage(self.name()))?;
        Ok(StageOutput::new(artefact, &figures))
    }
}
