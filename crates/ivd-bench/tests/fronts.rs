//! Every default is on its stage's recorded front.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use ivd_bench::{NAMES, ON_REQUEST, Setting, experiments};
use ivd_core::Exec;
use ivd_pipeline::fronts::recorded;

/// The defaults that the code has today. The size of the input doesn't change what they are.
fn defaults(stage: &str) -> Vec<Setting> {
    let experiments = experiments(stage, 16, &Exec::default()).unwrap();
    experiments.into_iter().flat_map(|e| e.settings).filter(|s| s.default).collect()
}

#[test]
fn every_default_is_recorded_and_no_other_setting_beats_it() {
    let mut wrong = Vec::new();
    for stage in NAMES.into_iter().chain(ON_REQUEST) {
        let front = recorded().iter().find(|f| f.stage == stage).unwrap();
        let today = defaults(stage);
        wrong.extend(today.iter().filter_map(|s| front.check_default(&s.task, &s.knobs).err()));
        let marked = front.points.iter().filter(|p| p.default).count();
        assert_eq!(marked, today.len(), "{stage}: as many defaults are recorded as there are; `just fronts`");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
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
        let mut front = recorded().iter().find(|f| f.stage == stage).unwrap().clone();
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
