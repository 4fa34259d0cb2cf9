use std::path::PathBuf;

use ivd_artefact::Kind;
use ivd_core::op::schema_of;
use ivd_core::{Artefact, Error as CoreError, Exec, Mask};
use ivd_io::volume::ReadOptions;
use serde_json::{Value, json};

use super::{IMPORT, ImportMaskFigures};
use crate::{Error, Facts, Inputs, Stage, StageOutput};

/// Reads a mask that was drawn: an artefact's, or what isn't 0 in a volume file of any format.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportDrawn {
    /// The file.
    pub path: PathBuf,
}

impl Stage for ImportDrawn {
    fn facts(&self) -> Facts {
        Facts {
            name: IMPORT,
            revision: 2,
            inputs: &[],
            output: Some(Kind::Mask),
            figures: schema_of::<ImportMaskFigures>,
        }
    }

    fn params(&self) -> Value {
        json!({ "drawn": true })
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        if ivd_artefact::is_artefact(&self.path) {
            return Ok(vec![self.path.clone()]);
        }
        ivd_io::volume::sources(&self.path, &ReadOptions::default()).map_err(Error::in_stage(IMPORT))
    }

    fn run(&self, _inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let told = |problem: String| {
            let problem = format!("{}: {problem}", self.path.display());
            Error::in_stage(IMPORT)(CoreError::Inconsistent { what: "mask", problem })
        };
        let mask = if ivd_artefact::is_artefact(&self.path) {
            let found = ivd_artefact::read(&self.path).map_err(Error::in_stage(IMPORT))?.artefact;
            let Artefact::Mask(mask) = found else {
                return Err(told(format!("a {} artefact; give a mask", found.kind().name())));
            };
            mask
        } else {
            let volume = ivd_io::volume::read(&self.path, &ReadOptions::default(), exec)
                .map_err(Error::in_stage(IMPORT))?;
            exec.run(|| Mask::from_volume(&volume)).map_err(|e| told(e.to_string()))?
        };
        let figures = ImportMaskFigures { voxels: mask.count() };
        Ok(StageOutput::new(mask, &figures))
    }
}
