use std::path::PathBuf;

use ivd_artefact::Kind;
use ivd_core::op::{Voxelwise, schema_of};
use ivd_core::{Exec, Labels, Value as _};
use ivd_segment::ClassFigures;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::import::{Given, facts_of_labels};
use super::onto::labels_on;
use super::{IMPORT, ImportOperand, PutOntoFigures};
use crate::{Error, Facts, Inputs, Metrics, Stage, StageOutput};

/// Reads labels that another program made of a scene's volume, and puts them onto its grid by where they lie. What is told of their classes is
/// what the volume holds there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportLabelsOf {
    file: ImportOperand,
}

/// What labels of a scan come to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LabelsOfFigures {
    /// On the scan's grid.
    #[serde(flatten)]
    pub put: PutOntoFigures,
    /// Their classes, with what the scan holds there.
    pub classes: Vec<ClassFigures>,
}

impl ImportLabelsOf {
    /// The labels of a file: those of an artefact, or the whole numbers of a volume file of any format.
    ///
    /// # Errors
    /// An artefact that can't be read, or of another kind.
    pub fn new(path: PathBuf) -> Result<Self, Error> {
        Ok(Self { file: ImportOperand::new(path, &[Kind::Labels])? })
    }
}

impl Stage for ImportLabelsOf {
    fn facts(&self) -> Facts {
        facts_of_labels(schema_of::<LabelsOfFigures>)
    }

    fn params(&self) -> Value {
        json!({ "labels": true })
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        self.file.sources()
    }

    fn remark(&self, figures: &Metrics) -> Result<Option<String>, Error> {
        Ok(figures.read::<LabelsOfFigures>(self.name())?.put.remark())
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let Given { volume } = inputs.take(self.name())?;
        let given = self.file.value(exec)?;
        let kind = given.kind().name();
        let labels = Labels::of(&given).ok_or_else(|| {
            Error::usage(IMPORT, format!("input.labels became a {kind} artefact; give labels"))
        })?;
        let (labels, put) = labels_on(labels, Voxelwise::Volume(volume), exec)?;
        let classes = labels.classes().iter().map(ClassFigures::from).collect();
        Ok(StageOutput::new(labels, &LabelsOfFigures { put, classes }))
    }
}
