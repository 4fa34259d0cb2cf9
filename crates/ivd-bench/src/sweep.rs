use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use ivd_budget::fronts::{Spread, Work};
use ivd_core::Exec;
use ivd_pipeline::resource::MemoryWatch;

use crate::experiment::{Experiment, Scored, Setting};
use crate::record::{Bench, Point, StageBench};
use crate::{Error, Given, NAMES, ON_REQUEST, experiments, given};

/// What is swept.
#[derive(Debug, Clone)]
pub struct Options {
    /// Voxels along the edge of the generated inputs, at least 16.
    pub size: usize,
    /// Times that every setting is run after a first run that doesn't count, at least 1.
    pub repeats: usize,
    /// The stages; empty for all.
    pub stages: Vec<String>,
    /// A volume in place of the generated inputs.
    pub input: Option<Given>,
    /// A fault to be found by whoever compares; for tests of the harness.
    #[doc(hidden)]
    pub plant: Option<Plant>,
}

impl Default for Options {
    fn default() -> Self {
        Self { size: 128, repeats: 5, stages: Vec::new(), input: None, plant: None }
    }
}

impl Options {
    /// Small inputs and few repeats: the shape of the fronts in well under two minutes.
    pub fn quick() -> Self {
        Self { size: 64, repeats: 3, ..Self::default() }
    }
}

/// A fault put in on purpose.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plant {
    /// Everything is done twice.
    Slow,
    /// Every error is half as large again.
    Inexact,
}

/// Sweeps the settings of the stages asked for.
///
/// # Errors
/// [`Error::UnknownStage`] before anything runs; [`Error::Failed`] and [`Error::NoNumber`] name the setting; cancelled.
pub fn run(options: &Options, exec: &Exec) -> Result<Bench, Error> {
    let known = [&NAMES[..], &ON_REQUEST].concat();
    if let Some(name) = options.stages.iter().find(|name| !known.contains(&name.as_str())) {
        let known = known.iter().map(ToString::to_string).collect();
        return Err(Error::UnknownStage { name: name.clone(), known });
    }
    let mut stages = Vec::new();
    for name in known {
        let asked = options.stages.is_empty() && NAMES.contains(&name);
        if asked || options.stages.iter().any(|s| s == name) {
            for experiment in made(name, options, exec)? {
                stages.push(sweep(&experiment, options, exec)?);
            }
        }
    }
    Ok(Bench {
        schema: 1,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        threads: exec.threads(),
        repeats: options.repeats.max(1),
        stages,
    })
}

/// The experiments of a stage on the input that is asked for.
fn made(stage: &str, options: &Options, exec: &Exec) -> Result<Vec<Experiment>, Error> {
    let Some(input) = &options.input else { return experiments(stage, options.size.max(16), exec) };
    let found = given(stage, input, exec)?;
    if found.is_none() {
        let problem = "its truth is a formula that no given volume has; it is left out";
        exec.observer().note(&format!("{stage}: {problem}"));
    }
    Ok(found.into_iter().collect())
}

/// What a setting took and gave.
#[derive(Default)]
struct Taken {
    wall: Vec<f64>,
    cpu: Vec<f64>,
    peak: Option<f64>,
    judgement: Scored,
}

/// Sweeps one experiment. Settings take turns: a run of each, then the next run of each.
///
/// # Errors
/// As [`run`].
pub fn sweep(experiment: &Experiment, options: &Options, exec: &Exec) -> Result<StageBench, Error> {
    let rounds = options.repeats.max(1) + 1;
    exec.observer().begin(experiment.stage, (rounds * experiment.settings.len()) as u64);
    let mut all: Vec<Taken> = experiment.settings.iter().map(|_| Taken::default()).collect();
    for round in 0..rounds {
        for (setting, taken) in experiment.settings.iter().zip(&mut all) {
            exec.check_cancelled()?;
            once(experiment, setting, options.plant, taken, round == 0, exec)?;
            exec.observer().advance(experiment.stage, 1);
        }
    }
    exec.observer().end(experiment.stage);
    let points = experiment.settings.iter().zip(all).map(|(setting, taken)| Point {
        knobs: setting.knobs.clone(),
        task: setting.task.clone(),
        default: setting.default,
        wall_s: Spread::of(&taken.wall),
        cpu_s: Spread::of(&taken.cpu),
        peak_rss_mb: taken.peak,
        counters: taken.judgement.counters,
        error: taken.judgement.error,
        on_front: false,
    });
    let mut stage = StageBench {
        stage: experiment.stage.to_owned(),
        input: experiment.input.clone(),
        truth: experiment.truth.to_owned(),
        measure: experiment.measure.to_owned(),
        unit: experiment.unit.to_owned(),
        counted: experiment.counted.map(str::to_owned),
        voxel_mm: experiment.voxel_mm,
        work: Work { what: experiment.work.0.to_owned(), amount: experiment.work.1 },
        points: points.collect(),
    };
    stage.mark_front();
    Ok(stage)
}

/// Runs a setting once. The first run warms up and is judged; the others are timed.
fn once(
    experiment: &Experiment,
    setting: &Setting,
    plant: Option<Plant>,
    taken: &mut Taken,
    first: bool,
    exec: &Exec,
) -> Result<(), Error> {
    let name = || (experiment.stage.to_owned(), setting.label());
    let failed = |problem: crate::experiment::Problem| {
        let (stage, knobs) = name();
        Error::Failed { stage, knobs, problem: problem.to_string() }
    };
    let memory = first.then(MemoryWatch::start);
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let judge = (setting.run)(exec).map_err(failed)?;
    if plant == Some(Plant::Slow) {
        drop((setting.run)(exec).map_err(failed)?);
    }
    let (wall, cpu) = (wall.elapsed(), cpu.elapsed());
    if !first {
        taken.wall.push(seconds(wall));
        taken.cpu.push(seconds(cpu));
        return Ok(());
    }
    taken.peak = memory.and_then(MemoryWatch::stop).map(|peak| peak.resident);
    let mut judgement = judge().map_err(failed)?;
    if plant == Some(Plant::Inexact) {
        judgement.error *= 1.5;
    }
    if !judgement.error.is_finite() {
        let (stage, knobs) = name();
        return Err(Error::NoNumber { stage, knobs, value: judgement.error });
    }
    taken.judgement = judgement;
    Ok(())
}

/// A duration, never 0, so that it can be divided by and drawn on a logarithmic axis.
fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64().max(1e-9)
}
