//! Budgets: a wall time that a run may take, and an error that its result may have.
//!
//! Knobs are set from the recorded [`fronts`] (Pareto fronts of time against error). The scene's values are the requested ones. A time budget takes coarser
//! values if those are predicted to take too long, and stops the work at the deadline. An error budget takes the cheapest refinement and time
//! steps that are predicted to hold it, measures what came of them, and takes finer ones until the measured error holds.
//!
//! [`run`] runs a scene within a [`Budget`]. It lies above the pipeline, which only asks whatever controls a run
//! ([`ivd_pipeline::Control`]) before each stage.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]
#![cfg_attr(not(test), deny(clippy::unreachable, clippy::wildcard_enum_match_arm))]

mod choose;
mod controller;
pub mod fronts;
mod hold;
mod knobs;
mod measure;
mod predict;
mod run;
mod search;
mod work;

use std::collections::{BTreeMap, BTreeSet};

use ivd_lattice::refine::Target;
use ivd_pipeline::Error;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use run::{BudgetedReport, run};
pub use work::{Amounts, rate_name};

/// Levels of refinement that budgets choose from, finest first: level L keeps 4⁻ᴸ of the lattice.
pub const LEVELS: [f64; 9] = [0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0];

/// What a level of [`LEVELS`] asks of refinement: a share of the triangles where it isn't whole.
pub fn target(level: f64) -> Target {
    if level.fract() == 0.0 { Target::Level(level as u8) } else { Target::Ratio(0.25_f64.powf(level)) }
}

/// What a run may take and how far its result may be from the unrefined, finely stepped one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Budget {
    /// Wall time of the whole run (s).
    pub max_time_s: Option<f64>,
    /// Error of the result (mm).
    pub max_error_mm: Option<f64>,
    /// Keys of the scene that must stay as they are, such as `refine.level`.
    pub pinned: BTreeSet<String>,
    /// Wall times (s) of stages at their default settings, predicted instead of what was recorded and whatever stages take
    /// here; those left out take none. For tests, which no record and no machine should decide.
    #[doc(hidden)]
    pub times: Option<BTreeMap<String, f64>>,
}

impl Budget {
    /// Whether there is one.
    pub fn is_set(&self) -> bool {
        self.max_time_s.is_some() || self.max_error_mm.is_some()
    }

    /// # Errors
    /// A usage error for a time or an error that isn't a positive number.
    pub fn check(&self) -> Result<(), Error> {
        let positive = |name: &str, unit: &str, value: Option<f64>| match value {
            Some(v) if !(v.is_finite() && v > 0.0) => {
                Err(Error::usage("pipeline", format!("{name} {v}: give a number of {unit} above 0")))
            }
            _ => Ok(()),
        };
        positive("--max-time", "seconds", self.max_time_s)?;
        positive("--max-error", "millimetres", self.max_error_mm)
    }
}

/// A knob that a budget moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The stage.
    pub stage: String,
    /// The knob, as the scene calls it.
    pub knob: String,
    /// The scene's value.
    pub from: Value,
    /// The value taken.
    pub to: Value,
    /// Why.
    pub why: String,
}

impl Choice {
    /// The choice in one line.
    pub fn summary(&self) -> String {
        format!("{}.{}: {} → {}, {}", self.stage, self.knob, self.from, self.to, self.why)
    }
}

/// What a budget did: the object `budget` of `ivd pipeline --json`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct BudgetReport {
    /// The time that was allowed (s).
    pub max_time_s: Option<f64>,
    /// The error that was allowed (mm).
    pub max_error_mm: Option<f64>,
    /// Knobs that were moved.
    pub choices: Vec<Choice>,
    /// Wall time of the whole run as predicted at the last choice (s); absent where nothing was to be chosen.
    pub predicted_s: Option<f64>,
    /// Wall time that it took (s).
    pub wall_s: f64,
    /// Whether both held.
    pub kept: bool,
    /// Sum of the parts (mm), where an error was allowed.
    pub error_mm: Option<f64>,
    /// The parts of the error (mm).
    pub error_parts: BTreeMap<String, f64>,
}

impl BudgetReport {
    /// What was chosen and how it ended, a line each.
    pub fn summary(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.choices.iter().map(|c| format!("budget: {}", c.summary())).collect();
        if let Some(most) = self.max_time_s {
            let predicted = self.predicted_s.map_or_else(String::new, |s| format!(", {s:.3} s predicted"));
            lines.push(format!("budget: {:.3} s of {most} s{predicted}", self.wall_s));
        }
        if let (Some(most), Some(error)) = (self.max_error_mm, self.error_mm) {
            let parts = self.error_parts.iter().map(|(name, mm)| format!("{name} {mm:.4}"));
            let parts = parts.collect::<Vec<_>>().join(", ");
            lines.push(format!("budget: {error:.4} mm of {most} mm ({parts})"));
        }
        lines
    }
}
