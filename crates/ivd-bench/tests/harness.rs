//! The harness finds what it is there to find: planted faults, and the shape of every stage's front.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use ivd_bench::{Bench, NAMES, Options, Plant, compare, experiments, page, run, table};
use ivd_core::Exec;

fn swept(stages: &[&str], plant: Option<Plant>) -> Bench {
    let stages = stages.iter().map(ToString::to_string).collect();
    run(&Options { size: 32, repeats: 1, stages, plant, ..Options::default() }, &Exec::default()).unwrap()
}

#[test]
fn every_stage_has_five_points_that_differ_in_error_and_says_what_it_measures() {
    let bench = swept(&[], None);
    assert_eq!(bench.stages.iter().map(|s| s.stage.as_str()).collect::<Vec<_>>(), NAMES);
    for stage in &bench.stages {
        let mut errors: Vec<f64> = stage.points.iter().map(|p| p.error).collect();
        errors.sort_by(f64::total_cmp);
        errors.dedup();
        assert!(errors.len() >= 5, "{}: {errors:?}", stage.stage);
        assert!(stage.points.iter().any(|p| p.on_front) && !stage.unit.is_empty(), "{}", stage.stage);
        assert!(stage.points.iter().filter(|p| p.default).count() <= 1, "{}", stage.stage);
    }
    // What is written down is what was measured, and can be read again.
    let text = serde_json::to_string(&bench).unwrap();
    assert_eq!(serde_json::from_str::<Bench>(&text).unwrap(), bench);
    let points: usize = bench.stages.iter().map(|s| s.points.len()).sum();
    assert_eq!(table(&bench).lines().count(), points + 1);
    assert_eq!(page(&bench).matches("<svg").count(), NAMES.len());
}

#[test]
fn finer_grids_and_shorter_steps_err_less() {
    let bench = swept(&["lattice", "warp", "render"], None);
    let errors = |stage: &str, of: &dyn Fn(&ivd_bench::Point) -> bool| -> Vec<f64> {
        let stage = bench.stages.iter().find(|s| s.stage == stage).unwrap();
        stage.points.iter().filter(|p| of(p)).map(|p| p.error).collect()
    };
    for stage in ["lattice", "warp"] {
        let falling = errors(stage, &|_| true);
        assert!(falling.first().unwrap() > &(4.0 * falling.last().unwrap()), "{stage}: {falling:?}");
    }
    let rising = errors("render", &|p| p.knobs["termination"] == "0.99");
    assert!(rising.first().unwrap() < rising.last().unwrap(), "render, by step: {rising:?}");
}

#[test]
fn a_planted_loss_of_accuracy_is_found_and_nothing_else() {
    let (old, new) = (swept(&["atf", "lattice"], None), swept(&["atf", "lattice"], Some(Plant::Inexact)));
    let wrong = |found: &ivd_bench::Comparison| found.changes.iter().filter(|c| c.what == "error").count();
    let found = compare(&old, &new);
    assert_eq!(wrong(&found), found.compared);
    assert!(
        found.changes.iter().filter(|c| c.what == "error").all(|c| c.worse() && (c.ratio - 1.5).abs() < 1e-9)
    );
    assert_eq!(wrong(&compare(&old, &swept(&["atf", "lattice"], None))), 0);
}

#[test]
fn a_stage_without_a_bench_is_named_before_anything_runs() {
    let options = Options { stages: vec!["octree".to_owned()], ..Options::quick() };
    let message = run(&options, &Exec::default()).unwrap_err().to_string();
    assert!(message.contains("`octree`") && message.contains("render"), "{message}");
    assert!(experiments("octree", 16, &Exec::default()).unwrap().is_empty());
}
