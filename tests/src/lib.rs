//! Tests that cross crates live in `tests/`; this library holds what they share.
#![forbid(unsafe_code)]

pub mod stability;

use std::path::{Path, PathBuf};

use ivd_artefact::Cache;
use ivd_budget::{Budget, BudgetedReport};
use ivd_core::Exec;
use ivd_pipeline::{Error, PipelineOptions, PipelineReport, StageRecord, State, scene};

/// The project's root folder.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the test crate lies in the project").to_owned()
}

/// A scene in a folder of its own, with its outputs and its cache.
pub struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    /// Writes the scene.
    pub fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("scene.toml"), text).expect("the temporary folder is writable");
        Self { folder }
    }

    /// A path in the folder of the outputs.
    pub fn out(&self, name: &str) -> PathBuf {
        self.folder.path().join("out").join(name)
    }

    /// The folder that the scene lies in.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Folder of the cache.
    pub fn cache(&self) -> PathBuf {
        self.folder.path().join("cache")
    }

    /// Runs the scene with overrides.
    ///
    /// # Errors
    /// The pipeline's.
    pub fn run(&self, overrides: &[&str]) -> Result<PipelineReport, Error> {
        self.run_with(overrides, &PipelineOptions::default(), &Exec::default())
    }

    /// Runs the scene with overrides, options (their output folder is replaced) and a context.
    ///
    /// # Errors
    /// The pipeline's.
    pub fn run_with(
        &self,
        overrides: &[&str],
        options: &PipelineOptions,
        exec: &Exec,
    ) -> Result<PipelineReport, Error> {
        self.run_within(overrides, options, &Budget::default(), exec).map(|report| report.run)
    }

    /// As [`Bench::run_with`], within a budget.
    ///
    /// # Errors
    /// The pipeline's.
    pub fn run_within(
        &self,
        overrides: &[&str],
        options: &PipelineOptions,
        budget: &Budget,
        exec: &Exec,
    ) -> Result<BudgetedReport, Error> {
        let overrides: Vec<scene::Override> =
            overrides.iter().map(|o| o.parse().expect("a well-formed override")).collect();
        let loaded = scene::load(&self.folder.path().join("scene.toml"), &overrides)?;
        let options = PipelineOptions { out: self.folder.path().join("out"), ..options.clone() };
        let cache = Cache::open(self.cache()).expect("the temporary folder is writable");
        ivd_budget::run(&loaded, &options, budget, &cache, exec)
    }
}

/// The record of a stage; of a picture where a variant is named.
pub fn record<'a>(report: &'a PipelineReport, stage: &str, variant: &str) -> &'a StageRecord {
    report
        .stages
        .iter()
        .find(|r| r.stage == stage && r.variant == variant)
        .unwrap_or_else(|| panic!("no record of {stage} {variant}"))
}

/// Names of the stages in a state, pictures as `render before`.
pub fn in_state(report: &PipelineReport, state: State) -> Vec<String> {
    let named = report.stages.iter().filter(|r| r.state == state);
    named.map(|r| format!("{} {}", r.stage, r.variant).trim().to_owned()).collect()
}
