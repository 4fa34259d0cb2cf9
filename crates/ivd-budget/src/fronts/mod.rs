//! What the settings of stages cost and how far they are from the truth, as `ivd bench --record` wrote it down.
//!
//! A [`Front`] is a stage's sweep on a generated input; [`Rates`] are the times of every stage of a plain scene, by amounts
//! of work, so that times can be told for another scene. Both are data of this repository (`fixtures/fronts`): the defaults
//! are held to them by a test, and budgets choose by them.

mod amounts;
mod rates;

use std::collections::BTreeMap;
use std::sync::OnceLock;

use ivd_pipeline::Error;
use serde::{Deserialize, Serialize};

pub use amounts::{Spread, Work};
pub use rates::{Rate, Rates};

/// Errors are sums in floating point: closer ones are equal.
const ROUNDING: f64 = 1.001;

/// The recorded sweep of a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Front {
    /// Version of this layout: 1.
    pub schema: u32,
    /// The stage.
    pub stage: String,
    /// The input, in words.
    pub input: String,
    /// What the results were held against.
    pub truth: String,
    /// What the error measures.
    pub measure: String,
    /// Its unit.
    pub unit: String,
    /// What a point's cost counts, where work is counted; without it the cost is processor time.
    pub counted: Option<String>,
    /// Edge of the input's voxels (mm), where the error is a length.
    pub voxel_mm: Option<f64>,
    /// The input's amount of work.
    pub work: Work,
    /// Worker threads.
    pub threads: usize,
    /// Times that every setting was timed.
    pub repeats: usize,
    /// The settings.
    pub points: Vec<FrontPoint>,
}

/// A recorded setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrontPoint {
    /// What was asked for; points of different tasks don't compete.
    pub task: String,
    /// The knobs.
    pub knobs: BTreeMap<String, String>,
    /// Whether these were the defaults.
    pub default: bool,
    /// Processor time of all threads (s).
    pub cpu_s: Spread,
    /// Wall time (s).
    pub wall_s: Spread,
    /// Work counted: the same on every machine.
    pub counted: Option<f64>,
    /// Distance from the truth.
    pub error: f64,
    /// The same in voxels of the input, where it is a length.
    pub error_voxels: Option<f64>,
    /// What else was counted.
    pub counters: BTreeMap<String, f64>,
}

impl FrontPoint {
    /// What it costs: work where that is counted, else processor time (s).
    pub fn cost(&self) -> f64 {
        self.counted.unwrap_or(self.cpu_s.median)
    }

    /// A knob that is a number.
    pub fn knob(&self, name: &str) -> Option<f64> {
        self.knobs.get(name)?.parse().ok()
    }

    /// The task and the knobs in one line.
    pub fn label(&self) -> String {
        let knobs = self.knobs.iter().map(|(name, value)| format!("{name} {value}"));
        let task = (!self.task.is_empty()).then(|| self.task.clone());
        task.into_iter().chain(knobs).collect::<Vec<_>>().join(", ")
    }

    /// Whether it beats `other`: no worse in cost and error, better in one of them. Times count as less only where not even
    /// the slowest run of the one is as slow as the fastest of the other; counted work has no noise.
    pub fn beats(&self, other: &Self) -> bool {
        if self.task != other.task {
            return false;
        }
        let errs_less = self.error * ROUNDING < other.error;
        let errs_no_more = self.error <= other.error * ROUNDING;
        match (self.counted, other.counted) {
            (Some(own), Some(its)) => own <= its && errs_no_more && (own < its || errs_less),
            _ => self.cpu_s.most < other.cpu_s.least && errs_no_more,
        }
    }
}

impl Front {
    /// The point of a setting.
    pub fn find(&self, task: &str, knobs: &BTreeMap<String, String>) -> Option<&FrontPoint> {
        self.points.iter().find(|p| p.task == task && p.knobs == *knobs)
    }

    /// A point that beats this one.
    pub fn beaten(&self, point: &FrontPoint) -> Option<&FrontPoint> {
        self.points.iter().find(|other| other.beats(point))
    }

    /// Checks a default that the code has today against the record.
    ///
    /// # Errors
    /// A sentence: it isn't in the record, isn't marked there, or another setting beats it.
    pub fn check_default(&self, task: &str, knobs: &BTreeMap<String, String>) -> Result<(), String> {
        let Some(point) = self.find(task, knobs).filter(|p| p.default) else {
            return Err(format!(
                "{}: today's default, {task} {knobs:?}, isn't the recorded one; record again (`just fronts`)",
                self.stage
            ));
        };
        match self.beaten(point) {
            None => Ok(()),
            Some(better) => Err(format!(
                "{}: the default, {} (cost {:.4e}, error {:.4e} {unit}), is beaten by {} (cost {:.4e}, error {:.4e} {unit}); \
                 move the default, or record again",
                self.stage,
                point.label(),
                point.cost(),
                point.error,
                better.label(),
                better.cost(),
                better.error,
                unit = self.unit,
            )),
        }
    }
}

/// A recorded file, read.
macro_rules! recorded {
    ($name:literal) => {
        serde_json::from_str(include_str!(concat!("../../../../fixtures/fronts/", $name, ".json")))
            .map_err(|problem| format!(concat!("the record of ", $name, " can't be read: {}"), problem))
    };
}

/// The fronts of this repository, in the order of the pipeline.
///
/// # Errors
/// [`Error::Limit`] where one can't be read.
pub fn recorded() -> Result<&'static [Front], Error> {
    static FRONTS: OnceLock<Result<Vec<Front>, String>> = OnceLock::new();
    let found = FRONTS.get_or_init(|| {
        [
            recorded!("segment"),
            recorded!("segment-kmvs"),
            recorded!("segment-emvs"),
            recorded!("segment-msvs"),
            recorded!("segment-hvs"),
            recorded!("atf"),
            recorded!("lattice"),
            recorded!("refine"),
            recorded!("refine-methods"),
            recorded!("solvers"),
            recorded!("deform"),
            recorded!("map"),
            recorded!("map-methods"),
            recorded!("deformation"),
            recorded!("warp"),
            recorded!("render"),
        ]
        .into_iter()
        .collect()
    });
    found.as_deref().map_err(|problem| Error::Limit(problem.clone()))
}

/// The times of a plain scene's stages of this repository.
///
/// # Errors
/// [`Error::Limit`] where they can't be read.
pub fn recorded_rates() -> Result<&'static Rates, Error> {
    static RATES: OnceLock<Result<Rates, String>> = OnceLock::new();
    let found = RATES.get_or_init(|| recorded!("stages"));
    found.as_ref().map_err(|problem| Error::Limit(problem.clone()))
}

#[cfg(test)]
mod tests;
