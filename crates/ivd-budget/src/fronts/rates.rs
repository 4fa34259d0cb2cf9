use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::amounts::{Spread, Work};

/// Wall times of the stages of a plain scene, and of writing its outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rates {
    /// Version of this layout: 1.
    pub schema: u32,
    /// The scene, in words.
    pub input: String,
    /// Worker threads.
    pub threads: usize,
    /// Times that the scene was run.
    pub repeats: usize,
    /// A rate for every stage, and for every kind of output file under `write` and its key.
    pub stages: BTreeMap<String, Rate>,
}

/// What a stage took for an amount of work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// Wall time (s).
    pub wall_s: Spread,
    /// The amount of work.
    pub work: Work,
}

impl Rates {
    /// Wall time (s) of a stage for an amount of work, by the record's fastest run, which other programs disturbed least; 0 for
    /// a stage that isn't in it.
    pub fn seconds(&self, stage: &str, amount: f64) -> f64 {
        let rate = |r: &Rate| r.wall_s.least / r.work.amount.max(1.0) * amount;
        self.stages.get(stage).map_or(0.0, rate)
    }
}
