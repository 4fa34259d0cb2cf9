use std::path::PathBuf;

use ivd_artefact::Kind;
use ivd_core::{Exec, Labels, Volume};
use ivd_volume::{ReadOptions, phantom};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::{Error, Inputs, Product, Slot, Stage};

/// Where an imported volume comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum ImportSource {
    /// A file or folder of any format that ivd-volume reads.
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the format doesn't say.
        options: ReadOptions,
    },
    /// A generated volume.
    Phantom(phantom::Params),
}

/// Reads a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// Where from.
    pub source: ImportSource,
}

impl Stage for Import {
    fn name(&self) -> &'static str {
        "import"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        &[]
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Volume)
    }

    fn params(&self) -> Value {
        match &self.source {
            ImportSource::File { options, .. } => json!({ "file": super::json(options) }),
            ImportSource::Phantom(params) => json!({ "phantom": super::json(params) }),
        }
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        match &self.source {
            ImportSource::File { path, options } => {
                ivd_volume::sources(path, options).map_err(stage_error!("import"))
            }
            ImportSource::Phantom(_) => Ok(Vec::new()),
        }
    }

    fn run(&self, _inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume = match &self.source {
            ImportSource::File { path, options } => {
                ivd_volume::read(path, options, exec).map_err(stage_error!("import"))?
            }
            ImportSource::Phantom(params) => {
                phantom::generate(params, exec).map_err(stage_error!("import"))?.volume
            }
        };
        let metrics = json!({
            "dims": volume.grid().dims(),
            "spacing": volume.grid().spacing(),
            "type": volume.voxel_type().name(),
            "range": exec.run(|| volume.range()),
            "missing": exec.run(|| volume.missing()),
            "voxels": volume.grid().len(),
        });
        Ok(Product::new(volume, metrics))
    }
}

/// Takes a volume of whole numbers for labels: a segmentation that another program wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImportLabels;

impl Stage for ImportLabels {
    fn name(&self) -> &'static str {
        "import"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("volume", &[Kind::Volume])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Labels)
    }

    fn params(&self) -> Value {
        json!({ "labels": true })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume: &Volume = inputs.value("volume").expect("checked by the runner");
        let labels = exec.run(|| Labels::from_volume(volume))?;
        let metrics = json!({
            "dims": volume.grid().dims(),
            "spacing": volume.grid().spacing(),
            "k": labels.classes().len(),
            "voxels": volume.grid().len(),
        });
        Ok(Product::new(labels, metrics))
    }
}
