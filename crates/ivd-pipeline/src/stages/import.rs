use std::path::{Path, PathBuf};

use ivd_artefact::Kind;
use ivd_core::op::{Slots as _, object, schema_of};
use ivd_core::{Artefact, Exec, Labels, Mask, TransferFunction, Volume, slots};
use ivd_io::volume::ReadOptions;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::grid_of::{GridTaken, on_grid_of};
use crate::{Error, Facts, Inputs, Metrics, Stage, StageOutput};

/// Name of the stage.
pub const IMPORT: &str = "import";

/// Where an imported volume comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum ImportSource {
    /// A file or folder of any format that ivd-io reads, or a volume's artefact.
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the format doesn't say.
        options: ReadOptions,
        /// A file whose grid is taken as it is, in place of its own.
        grid_of: Option<PathBuf>,
    },
    /// A generated volume.
    Phantom(ivd_phantom::Params),
}

/// Reads a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// Where from.
    pub source: ImportSource,
}

/// What an imported volume comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportFigures {
    /// Voxels along x, y and z.
    #[schemars(extend("x-unit" = "voxels"))]
    pub dims: [usize; 3],
    /// Distance of voxels along x, y and z.
    #[schemars(extend("x-unit" = "mm"))]
    pub spacing: [f64; 3],
    /// Type that its values are stored in.
    #[serde(rename = "type")]
    pub stored: String,
    /// Least and greatest value, where any voxel has one.
    #[schemars(extend("x-unit" = "real units"))]
    pub range: Option<[f64; 2]>,
    /// Voxels without data.
    #[schemars(extend("x-unit" = "voxels"))]
    pub missing: u64,
    /// Voxels of the grid.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels: usize,
    /// Whether the file says where the voxels lie in the patient: elsewhere left and right are an assumption.
    #[serde(default)]
    pub patient_space: bool,
    /// The file's own grid, where that of another was taken in its place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid_taken: Option<GridTaken>,
}

impl Stage for Import {
    fn facts(&self) -> Facts {
        Facts {
            name: IMPORT,
            revision: 5,
            inputs: &[],
            output: Some(Kind::Volume),
            figures: schema_of::<ImportFigures>,
        }
    }

    fn params(&self) -> Value {
        match &self.source {
            ImportSource::File { options, grid_of: None, .. } => json!({ "file": object(options) }),
            ImportSource::File { options, grid_of: Some(_), .. } => {
                json!({ "file": object(options), "grid_of": true })
            }
            ImportSource::Phantom(params) => json!({ "phantom": object(params) }),
        }
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        let ImportSource::File { path, options, grid_of } = &self.source else { return Ok(Vec::new()) };
        let mut files = files_of(path, options).map_err(Error::of_scan(IMPORT))?;
        if let Some(other) = grid_of {
            files.extend(files_of(other, &ReadOptions::default()).map_err(Error::in_stage(IMPORT))?);
        }
        Ok(files)
    }

    fn remark(&self, figures: &Metrics) -> Result<Option<String>, Error> {
        Ok(figures.read::<ImportFigures>(self.name())?.remark())
    }

    fn run(&self, _inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let volume = match &self.source {
            ImportSource::File { path, options, .. } if ivd_artefact::is_artefact(path) => {
                of_artefact(path, options)?
            }
            ImportSource::File { path, options, .. } => {
                ivd_io::volume::read(path, options, exec).map_err(Error::of_scan(IMPORT))?
            }
            ImportSource::Phantom(params) => {
                // Generated bodies lie as scans do: x to the right, y to the front, z to the head.
                ivd_phantom::generate(params, exec).map_err(Error::in_stage(IMPORT))?.volume
            }
        };
        if let ImportSource::File { path, grid_of: Some(other), .. } = &self.source {
            let laid = on_grid_of(&volume, path, other, exec)?;
            let grid_taken = Some(GridTaken::of(volume.grid(), laid.grid()));
            let figures = ImportFigures { grid_taken, ..ImportFigures::of(&laid, exec)? };
            return Ok(StageOutput::new(laid, &figures));
        }
        let figures = ImportFigures::of(&volume, exec)?;
        Ok(StageOutput::new(volume, &figures))
    }
}

/// The files that a volume is read from.
fn files_of(path: &Path, options: &ReadOptions) -> Result<Vec<PathBuf>, ivd_io::volume::Error> {
    if ivd_artefact::is_artefact(path) {
        return Ok(vec![path.to_owned()]);
    }
    ivd_io::volume::sources(path, options)
}

/// The volume of an artefact, which says itself how it is laid out.
fn of_artefact(path: &Path, options: &ReadOptions) -> Result<Volume, Error> {
    let told = |problem: &str| Err(Error::usage(IMPORT, format!("{}: {problem}", path.display())));
    if *options != ReadOptions::default() {
        return told(
            "an artefact says itself how it is laid out; leave out raw, axes, spacing, frame and series",
        );
    }
    let artefact = ivd_artefact::read(path).map_err(Error::in_stage(IMPORT))?.artefact;
    let kind = artefact.kind();
    if let Artefact::Volume(volume) = artefact {
        return Ok(volume);
    }
    told(&format!("an artefact of kind {kind}; give a volume"))
}

impl ImportFigures {
    /// What a person should know: that another file's grid is believed.
    fn remark(&self) -> Option<String> {
        self.grid_taken.as_ref().map(GridTaken::told)
    }

    /// Those of a volume.
    pub(super) fn of(volume: &Volume, exec: &Exec) -> Result<Self, ivd_core::Error> {
        volume.find_bricks(exec)?;
        Ok(Self {
            dims: volume.grid().dims(),
            spacing: volume.grid().spacing(),
            stored: volume.voxel_type().name().to_owned(),
            range: exec.run(|| volume.range()),
            missing: exec.run(|| volume.missing()),
            voxels: volume.grid().len(),
            patient_space: volume.grid().in_patient(),
            grid_taken: None,
        })
    }
}

/// Takes a volume of whole numbers for labels: a segmentation that another program wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImportLabels;

slots! {
    /// What is taken for labels, or what they lie on.
    pub(super) struct Given<'a> { volume: &'a Volume }
}

/// What imported labels come to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportLabelsFigures {
    /// Voxels along x, y and z.
    #[schemars(extend("x-unit" = "voxels"))]
    pub dims: [usize; 3],
    /// Distance of voxels along x, y and z.
    #[schemars(extend("x-unit" = "mm"))]
    pub spacing: [f64; 3],
    /// Number of classes.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub k: usize,
    /// Voxels of the grid.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 2))]
    pub voxels: usize,
}

/// What is known of an import of labels beside a volume, whose figures have this schema.
pub(super) fn facts_of_labels(figures: fn() -> &'static Value) -> Facts {
    Facts { name: IMPORT, revision: 1, inputs: Given::SLOTS, output: Some(Kind::Labels), figures }
}

impl Stage for ImportLabels {
    fn facts(&self) -> Facts {
        facts_of_labels(schema_of::<ImportLabelsFigures>)
    }

    fn params(&self) -> Value {
        json!({ "labels": true })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let Given { volume } = inputs.take(self.name())?;
        let labels = exec.run(|| Labels::from_volume(volume))?;
        let figures = ImportLabelsFigures::of(&labels);
        Ok(StageOutput::new(labels, &figures))
    }
}

impl ImportLabelsFigures {
    /// Those of labels.
    pub(super) fn of(labels: &Labels) -> Self {
        let grid = labels.grid();
        Self { dims: grid.dims(), spacing: grid.spacing(), k: labels.classes().len(), voxels: grid.len() }
    }
}

/// Takes a volume for a mask: what isn't 0 is inside. A part that another program drew.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImportMask;

/// What an imported mask comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportMaskFigures {
    /// Voxels inside.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels: u64,
}

impl Stage for ImportMask {
    fn facts(&self) -> Facts {
        Facts {
            name: IMPORT,
            revision: 1,
            inputs: Given::SLOTS,
            output: Some(Kind::Mask),
            figures: schema_of::<ImportMaskFigures>,
        }
    }

    fn params(&self) -> Value {
        json!({ "mask": true })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        let Given { volume } = inputs.take(self.name())?;
        let mask = exec.run(|| Mask::from_volume(volume))?;
        let figures = ImportMaskFigures { voxels: mask.count() };
        Ok(StageOutput::new(mask, &figures))
    }
}

/// Reads a transfer function of ours or of another program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportTransfer {
    /// The file.
    pub path: PathBuf,
}

/// What an imported transfer function comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportTransferFigures {
    /// Rows of the table: that for every label, and those for labels of their own.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub rows: usize,
    /// Samples of a row.
    #[schemars(extend("x-unit" = "1"))]
    pub resolution: usize,
    /// Values of the first and the last sample.
    #[schemars(extend("x-unit" = "value"))]
    pub range: [f64; 2],
}

impl Stage for ImportTransfer {
    fn facts(&self) -> Facts {
        Facts {
            name: IMPORT,
            revision: 1,
            inputs: &[],
            output: Some(Kind::Transfer),
            figures: schema_of::<ImportTransferFigures>,
        }
    }

    fn params(&self) -> Value {
        json!({ "transfer": true })
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        Ok(vec![self.path.clone()])
    }

    fn run(&self, _inputs: &Inputs, _exec: &Exec) -> Result<StageOutput, Error> {
        let transfer: TransferFunction =
            ivd_io::transfer::read(&self.path).map_err(Error::in_stage(IMPORT))?;
        let figures = ImportTransferFigures {
            rows: transfer.classes().len(),
            resolution: transfer.resolution(),
            range: transfer.range(),
        };
        Ok(StageOutput::new(transfer, &figures))
    }
}
