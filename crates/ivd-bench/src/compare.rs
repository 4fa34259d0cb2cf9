use serde::{Deserialize, Serialize};

use crate::record::{Bench, Point, StageBench};

/// What changed from an old bench to a new one.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Comparison {
    /// Points in both.
    pub compared: usize,
    /// Points of the new bench that the old one hasn't.
    pub new: usize,
    /// Points that changed by more than the noise.
    pub changes: Vec<Change>,
}

/// A point that changed by more than the noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The stage.
    pub stage: String,
    /// Its setting.
    pub setting: String,
    /// `processor time` or `error`.
    pub what: String,
    /// New over old.
    pub ratio: f64,
    /// The least and the largest ratio that the runs leave open; twice the same for an error, which has no noise.
    pub bounds: [f64; 2],
}

impl Change {
    /// Whether it is one for the worse.
    pub fn worse(&self) -> bool {
        self.ratio > 1.0
    }
}

/// Times must differ by this factor beyond their spread to count: a machine is never twice the same.
const SLACK: f64 = 1.15;
/// Errors are sums in floating point, and some of them of parallel work.
const ROUNDING: f64 = 1.001;

/// Holds a bench against an old one. Times compare only on the same machine with the same number of threads; errors always.
///
/// A time has changed where even the two runs that are closest to each other (the fastest of the slower bench, the slowest of the
/// faster one) differ by more than 15 %.
pub fn compare(old: &Bench, new: &Bench) -> Comparison {
    let mut found = Comparison::default();
    for stage in &new.stages {
        let before = old.stages.iter().find(|s| s.stage == stage.stage && s.input == stage.input);
        for point in &stage.points {
            let same = |p: &&Point| p.knobs == point.knobs && p.task == point.task;
            let Some(old_point) = before.and_then(|s: &StageBench| s.points.iter().find(same)) else {
                found.new += 1;
                continue;
            };
            found.compared += 1;
            let changed = |what: &str, ratio, bounds| Change {
                stage: stage.stage.clone(),
                setting: point.label(),
                what: what.to_owned(),
                ratio,
                bounds,
            };
            let (was, is) = (old_point.cpu_s, point.cpu_s);
            let bounds = [is.least / was.most, is.most / was.least];
            if bounds[0] > SLACK || bounds[1] < 1.0 / SLACK {
                found.changes.push(changed("processor time", is.median / was.median, bounds));
            }
            if point.error > old_point.error * ROUNDING || old_point.error > point.error * ROUNDING {
                let ratio = point.error / old_point.error;
                found.changes.push(changed("error", ratio, [ratio; 2]));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::{point, stage};

    fn bench(points: Vec<Point>) -> Bench {
        Bench { schema: 1, version: String::new(), threads: 2, repeats: 3, stages: vec![stage(points)] }
    }

    #[test]
    fn noise_is_no_change_and_a_doubled_time_is() {
        let old = bench(vec![point("1", 1.0, 0.5), point("2", 1.0, 0.5)]);
        assert!(compare(&old, &bench(vec![point("1", 1.15, 0.5)])).changes.is_empty());
        let found = compare(&old, &bench(vec![point("1", 2.0, 0.5), point("4", 2.0, 0.5)]));
        assert_eq!((found.compared, found.new), (1, 1));
        let change = &found.changes[0];
        assert_eq!((change.what.as_str(), change.ratio, change.worse()), ("processor time", 2.0, true));
        assert!(change.bounds[0] < 2.0 && change.bounds[1] > 2.0);
        assert!(!compare(&bench(vec![point("1", 2.0, 0.5)]), &old).changes[0].worse());
    }

    #[test]
    fn a_lost_accuracy_is_a_change_whatever_the_time() {
        let old = bench(vec![point("1", 1.0, 0.5)]);
        let found = compare(&old, &bench(vec![point("1", 1.0, 0.51)]));
        assert_eq!(found.changes.len(), 1);
        assert_eq!((found.changes[0].what.as_str(), found.changes[0].setting.as_str()), ("error", "step 1"));
        let exact = bench(vec![point("1", 1.0, 0.0)]);
        assert!(compare(&exact, &exact).changes.is_empty());
        assert!(compare(&exact, &old).changes[0].worse());
    }
}
