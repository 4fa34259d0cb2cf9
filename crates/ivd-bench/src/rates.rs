use std::collections::BTreeMap;
use std::path::Path;

use ivd_artefact::Cache;
use ivd_budget::fronts::{Rate, Rates, Spread, Work};
use ivd_budget::{Amounts, rate_name};
use ivd_core::Exec;
use ivd_pipeline::scene::{self, Loaded};
use ivd_pipeline::{PipelineOptions, PipelineReport};

use crate::Error;

/// The scene of the demo.
const SCENE: &str = include_str!("../../../fixtures/scenes/head.toml");
/// Outputs that it doesn't name, so that writing them is timed too.
const OUTPUTS: [&str; 3] = [
    "output.labels=labels.nii.gz",
    "output.displacement=inverse.nrrd",
    "output.lattice_extracted=extracted.ply",
];

/// Times of every stage of the demo's scene, and of writing its outputs, by amounts of work.
///
/// # Errors
/// What the pipeline runs into.
pub fn rates(repeats: usize, exec: &Exec) -> Result<Rates, Error> {
    let folder = tempfile::tempdir().map_err(|e| failed(&e))?;
    let overrides = OUTPUTS.map(|text| text.parse().expect("written right"));
    let scene = scene::parse(SCENE, &overrides).expect("a test reads it");
    let loaded = Loaded { scene, folder: ".".into(), file: "head.toml".into() };
    let mut times: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut amounts = Amounts::default();
    for round in 0..=repeats.max(1) {
        let report = once(&loaded, &folder.path().join(round.to_string()), exec)?;
        amounts = Amounts::of_report(&loaded.scene, &report).map_err(|e| failed(&e))?;
        let outputs = report.outputs.iter().map(|o| (rate_name("write", &o.name), o.wall_s));
        let stages = report.stages.iter().map(|s| (rate_name(&s.stage, &s.variant), s.wall_s));
        // The first run warms up.
        for (name, seconds) in stages.chain(outputs).filter(|_| round > 0) {
            times.entry(name).or_default().push(seconds);
        }
    }
    let stages = times.into_iter().filter(|(_, t)| t.iter().any(|&s| s > 0.0)).map(|(name, times)| {
        let (what, amount) = amounts.of(&name);
        (name, Rate { wall_s: Spread::of(&times), work: Work { what: what.to_owned(), amount } })
    });
    Ok(Rates {
        schema: 1,
        input: "the demo's scene: a head phantom of 128³ voxels".to_owned(),
        threads: exec.threads(),
        repeats,
        stages: stages.collect(),
    })
}

fn once(loaded: &Loaded, out: &Path, exec: &Exec) -> Result<PipelineReport, Error> {
    let options = PipelineOptions { out: out.to_owned(), ..PipelineOptions::default() };
    ivd_pipeline::run(loaded, &options, &Cache::disabled(), exec).map_err(|e| failed(&e))
}

fn failed(problem: &dyn std::error::Error) -> Error {
    Error::Failed {
        stage: "pipeline".to_owned(),
        knobs: "the demo's scene".to_owned(),
        problem: problem.to_string(),
    }
}
