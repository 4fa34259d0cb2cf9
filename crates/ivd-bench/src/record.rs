use std::collections::BTreeMap;

use ivd_budget::fronts::{Spread, Work};
use serde::{Deserialize, Serialize};

use crate::experiment::{Knobs, label};

/// A finished bench. Fields without a value on this system are absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bench {
    /// Version of this layout: 1.
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// Worker threads.
    pub threads: usize,
    /// Times that every setting was run.
    pub repeats: usize,
    /// The stages, in the order of the pipeline.
    pub stages: Vec<StageBench>,
}

/// A stage's points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageBench {
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
    /// The counter that tells what a point costs, where work is counted; without it that is processor time.
    #[serde(default)]
    pub counted: Option<String>,
    /// Edge of the input's voxels (mm), where the error is a length.
    #[serde(default)]
    pub voxel_mm: Option<f64>,
    /// The input's amount of work.
    #[serde(default)]
    pub work: Work,
    /// The points.
    pub points: Vec<Point>,
}

/// A setting's cost and error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// The knobs.
    pub knobs: Knobs,
    /// What was asked for; empty where there is one task.
    pub task: String,
    /// Whether these are the defaults.
    pub default: bool,
    /// Wall time (s).
    pub wall_s: Spread,
    /// Processor time of all threads (s).
    pub cpu_s: Spread,
    /// Largest resident memory while it ran (MiB), that of the program with the inputs of all settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_rss_mb: Option<f64>,
    /// Work done.
    pub counters: BTreeMap<String, f64>,
    /// Distance from the truth.
    pub error: f64,
    /// Whether no other point of the task is as good in both processor time and error and better in one.
    pub on_front: bool,
}

impl Point {
    /// The task and the knobs in one line.
    pub fn label(&self) -> String {
        label(&self.task, &self.knobs)
    }
}

impl StageBench {
    /// Marks the points on the front of their task.
    pub fn mark_front(&mut self) {
        let beaten: Vec<bool> = self.points.iter().map(|point| self.beaten_by(point).is_some()).collect();
        for (point, beaten) in self.points.iter_mut().zip(beaten) {
            point.on_front = !beaten;
        }
    }

    /// A point of the same task that costs no more and errs no more than `point`, and less in one of them.
    pub fn beaten_by(&self, point: &Point) -> Option<&Point> {
        let cost = |p: &Point| p.cpu_s.median;
        self.points.iter().find(|other| {
            other.task == point.task
                && cost(other) <= cost(point)
                && other.error <= point.error
                && (cost(other) < cost(point) || other.error < point.error)
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn point(knob: &str, cpu: f64, error: f64) -> Point {
        let time = Spread { least: 0.9 * cpu, median: cpu, most: 1.1 * cpu };
        Point {
            knobs: [("step".to_owned(), knob.to_owned())].into(),
            task: String::new(),
            default: knob == "1",
            wall_s: time,
            cpu_s: time,
            peak_rss_mb: None,
            counters: BTreeMap::new(),
            error,
            on_front: false,
        }
    }

    pub(crate) fn stage(points: Vec<Point>) -> StageBench {
        let word = str::to_owned;
        let mut stage = StageBench {
            stage: word("render"),
            input: word("a ball"),
            truth: word("a short step"),
            measure: word("difference"),
            unit: word("of 1"),
            counted: None,
            voxel_mm: None,
            work: Work::default(),
            points,
        };
        stage.mark_front();
        stage
    }

    #[test]
    fn the_front_holds_what_nothing_beats_in_both() {
        let s = stage(vec![
            point("2", 1.0, 4.0),
            point("1", 2.0, 2.0),
            point("0.9", 2.5, 2.0),
            point("0.5", 4.0, 1.0),
            point("0.4", 5.0, 3.0),
        ]);
        assert_eq!(s.points.iter().map(|p| p.on_front).collect::<Vec<_>>(), [true, true, false, true, false]);
        assert_eq!(s.beaten_by(&s.points[4]).unwrap().knobs["step"], "1");
    }

    #[test]
    fn points_of_different_tasks_do_not_compete() {
        let mut other = point("1", 1.0, 1.0);
        other.task = "level 2".to_owned();
        let s = stage(vec![point("2", 2.0, 2.0), other]);
        assert!(s.points.iter().all(|p| p.on_front));
    }

    #[test]
    fn a_spread_is_of_the_sorted_times() {
        assert_eq!(Spread::of(&[3.0, 1.0, 2.0]), Spread { least: 1.0, median: 2.0, most: 3.0 });
    }
}
