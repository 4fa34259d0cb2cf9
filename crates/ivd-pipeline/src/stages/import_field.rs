use std::path::PathBuf;

use ivd_artefact::Kind;
use ivd_core::op::{Slots as _, schema_of};
use ivd_core::{Exec, Volume, slots};
use ivd_field::given::{self, Leads};
use ivd_io::volume::{FieldDirection, GivenField, ReadOptions, read_field};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::IMPORT;
use crate::{Error, Facts, Inputs, Stage, StageOutput};

/// Reads a displacement field of another program, and certifies it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportField {
    /// The file.
    pub path: PathBuf,
    /// Which way it leads; without it what the file says.
    pub direction: Option<FieldDirection>,
}

slots! {
    /// The volume onto whose grid the field is put; without it the field stays on its own.
    struct Onto<'a> { volume: Option<&'a Volume> }
}

/// What an imported field comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportFieldFigures {
    /// Which way it leads: forward, from rest to deformed, or inverse.
    pub direction: String,
    /// Voxels whose vector, of the way that it leads, isn't 0.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_moved: u64,
    /// Length of the longest of them.
    #[schemars(extend("x-unit" = "mm", "x-headline" = 2))]
    pub largest_mm: f64,
    /// Smallest proven lower bound of det ∇φ of the forward field, at most 1.
    #[schemars(extend("x-unit" = "1"))]
    pub min_det_j: f64,
    /// Cells that fold: 0, or it would be refused.
    #[schemars(extend("x-unit" = "1"))]
    pub folds: u64,
    /// Largest residual of the inverse that was found.
    #[schemars(extend("x-unit" = "voxels"))]
    pub inverse_residual_max_voxel: f64,
}

impl Stage for ImportField {
    fn facts(&self) -> Facts {
        Facts {
            name: IMPORT,
            revision: 3,
            inputs: Onto::SLOTS,
            output: Some(Kind::Displacement),
            figures: schema_of::<ImportFieldFigures>,
        }
    }

    fn params(&self) -> Value {
        json!({ "displacement": self.direction.map(FieldDirection::name) })
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        ivd_io::volume::sources(&self.path, &ReadOptions::default()).map_err(Error::in_stage(IMPORT))
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let GivenField { grid, vectors, direction: said } =
            read_field(&self.path, exec).map_err(Error::in_stage(IMPORT))?;
        let direction = match (self.direction, said) {
            (Some(asked), Some(said)) if asked != said => {
                let problem = format!(
                    "{}: the file says that it leads {}, not {}; leave --displacement's word out",
                    self.path.display(),
                    said.name(),
                    asked.name()
                );
                return Err(Error::usage(IMPORT, problem));
            }
            (Some(direction), _) | (None, Some(direction)) => direction,
            (None, None) => {
                let problem = format!(
                    "{}: it doesn't say which way it leads; give --displacement=inverse (from the deformed to the rest, as ITK, ANTs and 3D \
                     Slicer resample) or --displacement=forward",
                    self.path.display()
                );
                return Err(Error::usage(IMPORT, problem));
            }
        };
        let Onto { volume } = inputs.take(self.name())?;
        let (grid, vectors) = match volume.map(Volume::grid).filter(|onto| !onto.matches(&grid)) {
            Some(onto) => {
                let put = exec.run(|| given::resampled(&vectors, &grid, onto, exec));
                (onto.clone(), put.map_err(Error::in_stage(IMPORT))?)
            }
            None => (grid, vectors),
        };
        let leads = match direction {
            FieldDirection::Forward => Leads::Forward,
            FieldDirection::Inverse => Leads::Inverse,
        };
        let made = given::displacement(grid, vectors, leads, exec).map_err(Error::in_stage(IMPORT))?;
        let displacement = made.displacement;
        let given = match direction {
            FieldDirection::Forward => displacement.forward(),
            FieldDirection::Inverse => displacement.inverse(),
        };
        let moving = given.vectors().iter().filter(|vector| **vector != [0.0; 3]);
        let figures = ImportFieldFigures {
            direction: direction.name().to_owned(),
            voxels_moved: moving.count() as u64,
            largest_mm: exec.run(|| given.longest()),
            min_det_j: displacement.min_det_j(),
            folds: made.certificate.folded.len() as u64,
            inverse_residual_max_voxel: displacement.inverse_residual_max(),
        };
        Ok(StageOutput::new(displacement, &figures))
    }
}
