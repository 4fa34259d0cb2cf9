//! A scene in a temporary folder, with a cache of its own.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use ivd_artefact::Cache;
use ivd_core::{Exec, Grid, Volume};
use ivd_pipeline::scene::{self, Loaded, Override};
use ivd_pipeline::{PipelineOptions, PipelineReport, StageRecord, State};
use ivd_volume::phantom;

use crate::Error;
use crate::experiment::Problem;

/// Edge of the head's cube (mm), whatever its number of voxels.
pub(super) const EDGE_MM: f64 = 128.0;

/// A folder with a volume, a scene and a cache.
pub(super) struct Place {
    folder: tempfile::TempDir,
    name: String,
}

/// What a volume holds.
#[derive(Debug, Clone, Copy)]
pub(super) enum Content {
    /// Zeros.
    Empty,
    /// A head with noise.
    Head,
    /// The same without.
    SmoothHead,
}

/// A run of a scene.
pub(super) struct Run {
    pub(super) report: PipelineReport,
    pub(super) wall_s: f64,
    pub(super) cpu_s: f64,
}

impl Place {
    /// Writes a volume of `size` voxels along an edge and a scene over it.
    pub(super) fn new(
        name: &str,
        size: usize,
        content: Content,
        scene: &str,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let made = || -> Result<tempfile::TempDir, Problem> {
            let folder = tempfile::tempdir()?;
            ivd_volume::write(&folder.path().join("head.nrrd"), &volume(size, content, exec)?, exec)?;
            let text = format!("schema = 1\n[input]\nfile = \"head.nrrd\"\n{scene}");
            ivd_pipeline::write_text(&folder.path().join("scene.toml"), &text)?;
            Ok(folder)
        };
        let folder = made().map_err(|problem| failed(name, &problem))?;
        Ok(Self { folder, name: name.to_owned() })
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Runs the scene; `cached`: on this place's cache, else on none.
    pub(super) fn run(
        &self,
        overrides: &[&str],
        until: Option<&str>,
        cached: bool,
        exec: &Exec,
    ) -> Result<Run, Error> {
        let run = || -> Result<Run, Problem> {
            let overrides: Result<Vec<Override>, String> = overrides.iter().map(|o| o.parse()).collect();
            let loaded: Loaded = scene::load(&self.folder.path().join("scene.toml"), &overrides?)?;
            let until = until.map(str::to_owned);
            let options = PipelineOptions { out: self.out(), until, ..PipelineOptions::default() };
            let cache =
                if cached { Cache::open(self.folder.path().join("cache"))? } else { Cache::disabled() };
            let (wall, cpu) = (Instant::now(), ProcessTime::now());
            let report = ivd_pipeline::run(&loaded, &options, &cache, exec)?;
            Ok(Run { report, wall_s: wall.elapsed().as_secs_f64(), cpu_s: cpu.elapsed().as_secs_f64() })
        };
        run().map_err(|problem| failed(&self.name, &problem))
    }
}

/// Waits until a volume's file that was just written is old enough that the cache may remember its hash: until then it may
/// change again unseen.
pub(super) fn settle() {
    std::thread::sleep(Duration::from_millis(2100));
}

fn failed(name: &str, problem: &Problem) -> Error {
    Error::Failed { stage: "scenes".to_owned(), knobs: name.to_owned(), problem: problem.to_string() }
}

/// The volume with the spacing that makes its cube [`EDGE_MM`] wide.
fn volume(size: usize, content: Content, exec: &Exec) -> Result<Volume, Problem> {
    let grid = Grid::with_spacing([size; 3], [EDGE_MM / size as f64; 3])?;
    let noise = match content {
        Content::Empty => return Ok(Volume::new(grid, vec![0_u8; size.pow(3)].into())?),
        Content::Head => None,
        Content::SmoothHead => Some(0.0),
    };
    let params = phantom::Params { size, noise, ..phantom::Params::default() };
    let head = phantom::generate(&params, exec)?.volume;
    Ok(Volume::new(grid, head.voxels().clone())?)
}

impl Run {
    pub(super) fn record(&self, stage: &str) -> Option<&StageRecord> {
        self.report.stages.iter().find(|r| r.stage == stage)
    }

    /// A number among a stage's figures.
    pub(super) fn figure(&self, stage: &str, name: &str) -> Result<f64, Error> {
        let missing = || ivd_pipeline::Error::Figure { stage: stage.to_owned(), figure: name.to_owned() };
        self.record(stage)
            .map_or_else(|| Err(missing()), |r| r.figure(name))
            .map_err(|e| failed(stage, &e.into()))
    }

    /// Largest resident memory of any stage (MiB).
    pub(super) fn peak_rss_mb(&self) -> Option<f64> {
        self.report.stages.iter().filter_map(|r| r.peak_rss_mb).reduce(f64::max)
    }

    /// Bytes that were read of files.
    pub(super) fn bytes_read(&self) -> u64 {
        self.report.stages.iter().map(|r| r.bytes_read).sum()
    }

    /// Names of the stages that did their work, pictures as `render before`.
    pub(super) fn ran(&self) -> Vec<String> {
        let ran = self.report.stages.iter().filter(|r| r.state == State::Ran && r.stage != "report");
        ran.map(|r| format!("{} {}", r.stage, r.variant).trim().to_owned()).collect()
    }

    /// Voxels (of pictures: samples) that the stages which did their work looked at, and how many of these their outputs
    /// need at least.
    pub(super) fn visited(&self) -> Result<[f64; 2], Error> {
        let all = self.figure("import", "voxels")?;
        let ran = self.report.stages.iter().filter(|r| r.state == State::Ran);
        let each = ran.map(|r| visited(r, all).map_err(|e| failed(&r.stage, &e.into())));
        each.into_iter().try_fold([0.0; 2], |[a, b], found| found.map(|[c, d]| [a + c, b + d]))
    }
}

/// Voxels that a stage looked at, and at least had to: the two ends of every crossed edge for a lattice, what moves for a
/// map. Where no less is known to do, the same twice.
fn visited(record: &StageRecord, all: f64) -> Result<[f64; 2], ivd_pipeline::Error> {
    let figure = |name| record.figure(name);
    let cubes = |bricks: f64| (512.0 * bricks).min(all);
    Ok(match record.stage.as_str() {
        "import" | "atf" | "boundary" => [all; 2],
        "segment" => [figure("visited_fraction")? * all; 2],
        "lattice" => {
            let least = (2.0 * figure("vertices")?).min(all);
            // The mask is looked at whole.
            let isolated = record.inputs.contains_key("mask");
            [if isolated { all } else { cubes(figure("bricks_active")?).max(least) }, least]
        }
        "map" => [cubes(figure("bricks_touched")?), figure("voxels_moved")?],
        "warp" => [figure("voxels_resampled")?; 2],
        // A difference of pictures casts no rays.
        "render" if record.variant != "difference" => {
            let size = |name: &str| {
                let missing =
                    || ivd_pipeline::Error::Figure { stage: record.stage.clone(), figure: name.to_owned() };
                record.params.pointer(name).and_then(serde_json::Value::as_f64).ok_or_else(missing)
            };
            let pixels = size("/size/0")? * size("/size/1")?;
            [figure("samples_per_pixel")? * pixels; 2]
        }
        _ => [0.0; 2],
    })
}
