//! How a scene is run.

use std::collections::BTreeSet;
use std::path::PathBuf;

use crate::Error;
use crate::plan::{NodeId, stage_names};

/// How a scene is run.
#[derive(Debug, Clone, Default)]
pub struct PipelineOptions {
    /// Folder of the outputs.
    pub out: PathBuf,
    /// A volume in place of the scene's.
    pub input: Option<PathBuf>,
    /// Stop after this stage; outputs aren't written.
    pub until: Option<String>,
    /// Stages that run even where the cache has their result.
    pub force: BTreeSet<String>,
    /// Tell what would be done, without doing it.
    pub dry_run: bool,
}

impl PipelineOptions {
    /// Checks what no scene has a say in.
    ///
    /// # Errors
    /// A usage error where `force` names what is no stage.
    pub fn check(&self) -> Result<(), Error> {
        for stage in &self.force {
            if stage != "report" && stage != NodeId::IMPORT.stage && crate::list::stage(stage).is_none() {
                let known = stage_names();
                return Err(Error::usage("pipeline", format!("--force {stage}: stages are {known}, report")));
            }
        }
        Ok(())
    }
}
