use std::path::PathBuf;

use ivd_artefact::Kind;
use ivd_core::op::schema_of;
use ivd_core::{Artefact, Error as CoreError, Exec, Labels};
use ivd_io::volume::ReadOptions;
use serde_json::{Value, json};

use super::{IMPORT, ImportDrawn, ImportFigures, ImportLabelsFigures, ImportMaskFigures};
use crate::{Error, Facts, Inputs, Stage, StageOutput};

/// Reads the file that a scene's volume is clipped by or combined with: a volume's, of any format, or an artefact of a volume, of labels
/// or of a mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportOperand {
    path: PathBuf,
    kind: Kind,
}

impl ImportOperand {
    /// The file in a slot, of which `kinds` tells what may fill it; a volume's is read as the first of them that it can be taken for.
    ///
    /// # Errors
    /// A file that can't be read, or an artefact of a kind that doesn't fit.
    pub fn new(path: PathBuf, kinds: &[Kind]) -> Result<Self, Error> {
        let kind = if ivd_artefact::is_artefact(&path) {
            ivd_artefact::peek(&path).map_err(Error::in_stage(IMPORT))?.kind
        } else if kinds.contains(&Kind::Volume) {
            Kind::Volume
        } else {
            Kind::Labels
        };
        if !kinds.contains(&kind) {
            let known: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
            let problem =
                format!("{}: a {} artefact; give {}", path.display(), kind.name(), known.join(" or "));
            return Err(Error::usage(IMPORT, problem));
        }
        Ok(Self { path, kind })
    }

    pub(super) fn value(&self, exec: &Exec) -> Result<Artefact, Error> {
        if ivd_artefact::is_artefact(&self.path) {
            return Ok(ivd_artefact::read(&self.path).map_err(Error::in_stage(IMPORT))?.artefact);
        }
        let volume = ivd_io::volume::read(&self.path, &ReadOptions::default(), exec)
            .map_err(Error::in_stage(IMPORT))?;
        if self.kind == Kind::Volume {
            return Ok(Artefact::Volume(volume));
        }
        let told = |problem: CoreError| {
            let problem = format!("{}: {problem}", self.path.display());
            Error::in_stage(IMPORT)(CoreError::Inconsistent { what: "labels", problem })
        };
        exec.run(|| Labels::from_volume(&volume)).map(Artefact::Labels).map_err(told)
    }
}

impl Stage for ImportOperand {
    fn facts(&self) -> Facts {
        Facts {
            name: IMPORT,
            revision: 1,
            inputs: &[],
            output: Some(self.kind),
            figures: match self.kind {
                Kind::Mask => schema_of::<ImportMaskFigures>,
                Kind::Labels => schema_of::<ImportLabelsFigures>,
                Kind::Volume
                | Kind::Transfer
                | Kind::Lattice
                | Kind::Octree
                | Kind::Motion
                | Kind::Displacement
                | Kind::Image
                | Kind::Tree => schema_of::<ImportFigures>,
            },
        }
    }

    fn params(&self) -> Value {
        json!({ "as": self.kind.name() })
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        ImportDrawn { path: self.path.clone() }.sources()
    }

    fn run(&self, _inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        match self.value(exec)? {
            Artefact::Mask(mask) => {
                let figures = ImportMaskFigures { voxels: mask.count() };
                Ok(StageOutput::new(mask, &figures))
            }
            Artefact::Labels(labels) => {
                let figures = ImportLabelsFigures::of(&labels);
                Ok(StageOutput::new(labels, &figures))
            }
            Artefact::Volume(volume) => {
                let figures = ImportFigures::of(&volume, exec)?;
                Ok(StageOutput::new(volume, &figures))
            }
            other @ (Artefact::Transfer(_)
            | Artefact::Lattice(_)
            | Artefact::Octree(_)
            | Artefact::Motion(_)
            | Artefact::Displacement(_)
            | Artefact::Image(_)
            | Artefact::Tree(_)) => {
                let problem =
                    format!("{}: it became a {} artefact", self.path.display(), other.kind().name());
                Err(Error::usage(IMPORT, problem))
            }
        }
    }
}
