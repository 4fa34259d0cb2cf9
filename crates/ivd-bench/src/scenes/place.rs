//! A scene in a temporary folder, with a cache of its own.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use ivd_artefact::Cache;
use ivd_core::{Exec, Grid, Volume};
use ivd_field::warp::{self, WarpFigures};
use ivd_lattice::extract::{self, LatticeFigures};
use ivd_map::MapFigures;
use ivd_pipeline::scene::{self, Loaded, Override};
use ivd_pipeline::stages::{IMPORT, ImportFigures};
use ivd_pipeline::{PipelineOptions, PipelineReport, StageRecord, State, figures_of};
use ivd_render::{DifferenceFigures, MovedFigures, RenderFigures, RenderParams};
use ivd_segment::CommonFigures;
use serde::Deserialize;
use serde::de::DeserializeOwned;

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
            ivd_io::volume::write(&folder.path().join("head.nrrd"), &volume(size, content, exec)?, exec)?;
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
    let params = ivd_phantom::Params { size, noise, ..ivd_phantom::Params::default() };
    let head = ivd_phantom::generate(&params, exec)?.volume;
    Ok(Volume::new(grid, head.voxels().clone())?)
}

impl Run {
    pub(super) fn record(&self, stage: &str) -> Option<&StageRecord> {
        self.report.stages.iter().find(|r| r.stage == stage)
    }

    /// The figures of a stage that did its work.
    pub(super) fn figures<F: DeserializeOwned>(&self, stage: &str) -> Result<F, Error> {
        let found = figures_of(&self.report.stages, stage).map_err(|e| failed(stage, &e.into()))?;
        found.ok_or_else(|| failed(stage, &"it wasn't needed".into()))
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
        let all = self.figures::<ImportFigures>(IMPORT)?.voxels as f64;
        let ran = self.report.stages.iter().filter(|r| r.state == State::Ran);
        let each = ran.map(|r| visited(r, all).map_err(|e| failed(&r.stage, &e.into())));
        each.into_iter().try_fold([0.0; 2], |[a, b], found| found.map(|[c, d]| [a + c, b + d]))
    }
}

/// Voxels that a stage looked at and at least had to, of all that there are.
type Looked = fn(&StageRecord, f64) -> Result<[f64; 2], ivd_pipeline::Error>;

/// How many voxels a stage looks at: the two ends of every crossed edge for a lattice, what moves for a map. Where no less is known to
/// do, the same twice; stages that aren't listed look at none.
const LOOKED: [(&str, Looked); 8] = [
    (IMPORT, |_, all| Ok([all; 2])),
    (ivd_atf::STAGE.name, |_, all| Ok([all; 2])),
    (ivd_boundary::STAGE.name, |_, all| Ok([all; 2])),
    (ivd_segment::STAGE.name, |record, all| {
        Ok([record.figures::<CommonFigures>()?.visited_fraction * all; 2])
    }),
    (extract::STAGE.name, |record, all| {
        let found: LatticeFigures = record.figures()?;
        let least = (2.0 * found.vertices as f64).min(all);
        // The mask is looked at whole.
        let isolated = record.inputs.contains_key("mask");
        Ok([if isolated { all } else { in_bricks(found.bricks_active, all).max(least) }, least])
    }),
    (ivd_map::STAGE.name, |record, all| {
        let found: MapFigures = record.figures()?;
        Ok([in_bricks(found.bricks_touched, all), found.voxels_moved as f64])
    }),
    (warp::STAGE.name, |record, _| Ok([record.figures::<WarpFigures>()?.voxels_resampled as f64; 2])),
    (ivd_render::STAGE.name, |record, _| {
        // A difference of pictures casts no rays.
        let Pictured::Drawn(found) = record.figures()? else { return Ok([0.0; 2]) };
        let RenderParams { size, .. } = record.params()?;
        Ok([found.samples_per_pixel * (size[0] * size[1]) as f64; 2])
    }),
];

/// Figures of a picture, of the difference of two, or of how far what is seen has moved.
#[derive(Deserialize)]
#[serde(untagged)]
enum Pictured {
    Drawn(RenderFigures),
    #[allow(dead_code, reason = "told apart by its fields")]
    Apart(DifferenceFigures),
    #[allow(dead_code, reason = "told apart by its fields")]
    Moved(MovedFigures),
}

/// Voxels of so many bricks.
fn in_bricks(bricks: u64, all: f64) -> f64 {
    (512.0 * bricks as f64).min(all)
}

/// Voxels that a stage looked at, and at least had to.
fn visited(record: &StageRecord, all: f64) -> Result<[f64; 2], ivd_pipeline::Error> {
    let looked = LOOKED.iter().find(|(stage, _)| *stage == record.stage);
    looked.map_or(Ok([0.0; 2]), |(_, looked)| looked(record, all))
}
