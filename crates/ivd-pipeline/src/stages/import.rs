use std::collections::BTreeMap;
use std::path::PathBuf;

use ivd_artefact::{Artefact, ContentHash, Kind};
use ivd_core::Exec;
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

    /// Every file of the volume, by content; where they lie doesn't matter.
    fn sources(&self) -> Result<BTreeMap<String, ContentHash>, Error> {
        let ImportSource::File { path, options } = &self.source else { return Ok(BTreeMap::new()) };
        let files = ivd_volume::sources(path, options).map_err(stage_error!("import"))?;
        let mut hasher = blake3::Hasher::new();
        for file in &files {
            let one = blake3::Hasher::new()
                .update_mmap_rayon(file)
                .map_err(|e| Error::io("reading", file, e))?
                .finalize();
            hasher.update(one.as_bytes());
            // The ending decides the format where the bytes don't.
            hasher.update(file.extension().map_or(&[][..], |e| e.as_encoded_bytes()));
            hasher.update(&[0]);
        }
        Ok(BTreeMap::from([("source".to_owned(), ContentHash(*hasher.finalize().as_bytes()))]))
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
        Ok(Product::new(Artefact::Volume(volume), metrics))
    }
}
