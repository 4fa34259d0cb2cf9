//! Every default is on its stage's recorded front.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::collections::BTreeMap;
use std::sync::Mutex;

use ivd_bench::{Knobs, NAMES, ON_REQUEST, Setting, experiments};
use ivd_budget::fronts::{FrontPoint, recorded};
use ivd_core::Exec;

/// A default that the code has today.
#[derive(Clone)]
struct Today {
    task: String,
    knobs: Knobs,
}

/// All of a stage. The size of the input doesn't change what they are. Found once: an experiment makes its truth first.
fn defaults(stage: &'static str) -> Vec<Today> {
    static FOUND: Mutex<BTreeMap<&str, Vec<Today>>> = Mutex::new(BTreeMap::new());
    let of = |stage| {
        let settings = experiments(stage, 16, &Exec::default()).unwrap().into_iter().flat_map(|e| e.settings);
        let known = |setting: Setting| Today { task: setting.task, knobs: setting.knobs };
        settings.filter(|s| s.default).map(known).collect()
    };
    FOUND.lock().unwrap().entry(stage).or_insert_with(|| of(stage)).clone()
}

#[test]
fn every_default_is_recorded_and_no_other_setting_beats_it() {
    let mut wrong = Vec::new();
    for stage in NAMES.into_iter().chain(ON_REQUEST) {
        let front = recorded().unwrap().iter().find(|f| f.stage == stage).unwrap();
        let today = defaults(stage);
        wrong.extend(today.iter().filter_map(|s| front.check_default(&s.task, &s.knobs).err()));
        let marked = front.points.iter().filter(|p| p.default).count();
        assert_eq!(marked, today.len(), "{stage}: as many defaults are recorded as there are; `just fronts`");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Error at a time on a curve through points (s, error), by powers in between; `None` beyond its ends.
fn between(curve: &[[f64; 2]], time: f64) -> Option<f64> {
    let above = curve.iter().position(|p| p[0] >= time)?;
    let [[t, e], [u, f]] = [curve[above.checked_sub(1)?], curve[above]];
    let share = (time / t).ln() / (u / t).ln();
    Some(e * (f / e).powf(share))
}

#[test]
fn the_quasi_newton_solver_is_below_the_others_at_every_time_that_both_have() {
    let front = recorded().unwrap().iter().find(|f| f.stage == "solvers").unwrap();
    let curve = |task: &str, solver: &str| {
        let of = |p: &&FrontPoint| p.task == task && p.knobs["solver"] == solver;
        let mut points: Vec<[f64; 2]> =
            front.points.iter().filter(of).map(|p| [p.cpu_s.median, p.error]).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points
    };
    for task in ["balance", "a step of 20 ms"] {
        let own = curve(task, "projective");
        for solver in ["local-global", "xpbd"] {
            let compared: Vec<_> = curve(task, solver)
                .into_iter()
                .filter_map(|[time, error]| Some((time, error, between(&own, time)?)))
                .collect();
            assert!(compared.len() >= 3, "{task}, {solver}: {} times in common", compared.len());
            for (time, error, own) in compared {
                assert!(own < error, "{task} after {time} s: {own} above it, {solver} {error}");
            }
        }
    }
}

/// Stages whose default errs: half of nothing is not better.
#[test]
fn a_default_that_is_moved_or_beaten_is_found_in_every_stage_with_one() {
    for stage in [
        "segment",
        "segment-emvs",
        "segment-msvs",
        "segment-hvs",
        "atf",
        "refine",
        "refine-methods",
        "deform",
        "map",
        "render",
    ] {
        let mut front = recorded().unwrap().iter().find(|f| f.stage == stage).unwrap().clone();
        let today = defaults(stage).remove(0);
        // Another value than the recorded one.
        let mut moved = today.knobs.clone();
        for value in moved.values_mut() {
            value.push('9');
        }
        assert!(front.check_default(&today.task, &moved).unwrap_err().contains("record again"), "{stage}");
        // A setting that errs half as much and costs half as much.
        let mut better = front.find(&today.task, &today.knobs).unwrap().clone();
        better.knobs = moved;
        better.default = false;
        better.error *= 0.5;
        better.counted = better.counted.map(|work| 0.5 * work);
        let time = &mut better.cpu_s;
        (time.least, time.median, time.most) = (0.2 * time.least, 0.2 * time.least, 0.2 * time.least);
        front.points.push(better);
        assert!(front.check_default(&today.task, &today.knobs).unwrap_err().contains("beaten"), "{stage}");
    }
}
