//! Budgets: what a time and an error make of a scene. Nothing here depends on how fast a machine is or was when the fronts
//! were recorded: times are generous, absurd, or predicted from figures given here.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::sync::Arc;
use std::time::Duration;

use ivd_artefact::Cache;
use ivd_budget::{Budget, BudgetReport, BudgetedReport};
use ivd_core::{Classified, ErrorClass, Exec, Observer};
use ivd_lattice::refine::{LevelFigures, RefineFigures};
use ivd_pipeline::{Error, PipelineOptions, PipelineReport, compare};
use ivd_render::RenderFigures;
use ivd_tests::{Bench, record};
use serde_json::Value;

const HEAD: &str = include_str!("../scenes/budgets.toml");

fn time(seconds: f64) -> Budget {
    Budget { max_time_s: Some(seconds), ..Budget::default() }
}

fn error(mm: f64) -> Budget {
    Budget { max_error_mm: Some(mm), ..Budget::default() }
}

/// A time (s), where motion, map and both pictures are predicted to take `each` (s), and the rest nothing.
fn slow(each: f64, seconds: f64) -> Budget {
    let times = ["deform", "map", "render before", "render after"].map(|stage| (stage.to_owned(), each));
    Budget { times: Some(times.into()), ..time(seconds) }
}

/// Runs a scene with overrides within a budget.
fn within(bench: &Bench, overrides: &[&str], budget: &Budget) -> Result<BudgetedReport, Error> {
    bench.run_within(overrides, &PipelineOptions::default(), budget, &Exec::default())
}

fn hashes(report: &PipelineReport) -> Vec<Option<String>> {
    report.stages.iter().map(|s| s.output.as_ref().map(|o| o.hash.clone())).collect()
}

/// Files in the output folder, of whatever name.
fn files(bench: &Bench) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(bench.out("")) else { return Vec::new() };
    entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// The figures of the refined lattice.
fn refined(report: &PipelineReport) -> LevelFigures {
    record(report, "refine", "").figures::<RefineFigures>().unwrap().last
}

#[test]
fn a_generous_time_changes_nothing() {
    let (plain, timed) = (Bench::new(HEAD), Bench::new(HEAD));
    let wish = within(&plain, &[], &Budget::default()).unwrap();
    let found = within(&timed, &[], &time(1e6)).unwrap();
    assert_eq!(hashes(&wish.run), hashes(&found.run));
    assert!(wish.budget.is_none());
    let budget = found.budget.unwrap();
    assert!(budget.choices.is_empty() && budget.kept && budget.predicted_s.unwrap() > 0.0, "{budget:?}");
}

#[test]
fn a_time_that_the_wish_is_predicted_to_miss_makes_settings_coarser_and_says_so() {
    // Nothing fits into an hour, as predicted; here it is done in seconds.
    let slow = slow(1e6, 3600.0);
    let bench = Bench::new(HEAD);
    let wish = bench.run(&[]).unwrap();
    let coarse = Bench::new(&format!("{HEAD}report = true\n"));
    let BudgetedReport { run: found, budget } = within(&coarse, &[], &slow).unwrap();
    let page = std::fs::read_to_string(coarse.out("report.html")).unwrap();
    assert!(page.contains("budget: refine.level: 2 → "));
    let budget = budget.unwrap();
    let moved: Vec<(&str, &str)> =
        budget.choices.iter().map(|c| (c.stage.as_str(), c.knob.as_str())).collect();
    for knob in [("refine", "level"), ("deform", "steps"), ("render", "step"), ("render", "termination")] {
        assert!(moved.contains(&knob), "{moved:?}");
    }
    let triangles = |r: &PipelineReport| refined(r).triangles;
    assert!(triangles(&found) < triangles(&wish));
    let samples = |r: &PipelineReport| {
        record(r, "render", "before").figures::<RenderFigures>().unwrap().samples_per_pixel
    };
    assert!(samples(&found) < samples(&wish));
    // What the cache has costs nothing: the wish is taken as it is.
    let again = within(&bench, &[], &slow).unwrap();
    assert!(again.budget.as_ref().unwrap().choices.is_empty(), "{:?}", again.budget);
    assert_eq!(hashes(&again.run), hashes(&wish));
}

#[test]
fn no_more_is_given_away_than_the_time_asks_for() {
    // One stage with a knob, so that the first prediction is the last.
    let picture = HEAD.replace("[render]", "[render]\nmode = \"mip\"");
    let picture = picture.split("[output]").next().unwrap().to_owned() + "[output]\nimages = [\"before\"]\n";
    let run = |seconds| within(&Bench::new(&picture), &[], &slow(1e9, seconds)).unwrap().budget.unwrap();
    let generous = run(1e15);
    assert!(generous.choices.is_empty());
    // A little less than the wish needs: one step down the front, not all the way.
    let less = run(generous.predicted_s.unwrap());
    let least = run(3600.0);
    let step = |of: &BudgetReport| {
        of.choices.iter().find(|c| c.knob == "step").map_or(0.5, |c| c.to.as_f64().unwrap())
    };
    assert!(!less.choices.is_empty() && less.predicted_s.unwrap() < generous.predicted_s.unwrap());
    assert!(step(&less) < step(&least), "{less:?} {least:?}");
}

#[test]
fn a_knob_that_is_pinned_stays() {
    let pinned = ["render.step".to_owned(), "refine.level".to_owned()].into();
    let slow = Budget { pinned, ..slow(1e6, 3600.0) };
    let found = within(&Bench::new(HEAD), &[], &slow).unwrap();
    let budget = found.budget.unwrap();
    assert!(!budget.choices.iter().any(|c| c.stage == "refine" || c.knob == "step"), "{budget:?}");
}

#[test]
fn a_time_that_nothing_keeps_ends_with_a_limit_and_leaves_nothing() {
    let bench = Bench::new(HEAD);
    let failed = within(&bench, &[], &time(1e-9)).unwrap_err();
    assert_eq!(failed.error_class(), ErrorClass::Limit);
    assert!(failed.to_string().contains("--max-time"), "{failed}");
    assert!(files(&bench).is_empty(), "{:?}", files(&bench));
}

/// Holds a task up until a deadline of three seconds has passed, however fast the machine is.
struct Slow(&'static str);

impl Observer for Slow {
    fn begin(&self, task: &'static str, _total: u64) {
        if task == self.0 {
            std::thread::sleep(Duration::from_millis(3100));
        }
    }
}

#[test]
fn a_deadline_in_the_midst_leaves_whole_files_alone_and_the_caller_free() {
    let bench = Bench::new(HEAD);
    let exec = Exec::default().with_observer(Arc::new(Slow("ring")));
    let failed = bench.run_within(&[], &PipelineOptions::default(), &time(3.0), &exec).unwrap_err();
    assert_eq!(failed.error_class(), ErrorClass::Limit);
    assert!(failed.to_string().contains("the time is up"), "{failed}");
    assert!(files(&bench).iter().all(|f| f == "lattice.ply"), "{:?}", files(&bench));
    // The flag of the caller was not raised: the same context goes on.
    assert!(exec.check_cancelled().is_ok());
    assert!(bench.run_with(&[], &PipelineOptions::default(), &exec).is_ok());
}

#[test]
fn an_interruption_is_no_deadline() {
    let exec = Exec::default();
    exec.cancel.cancel();
    let failed =
        Bench::new(HEAD).run_within(&[], &PipelineOptions::default(), &time(1e-9), &exec).unwrap_err();
    assert_eq!(failed.error_class(), ErrorClass::Cancelled);
}

#[test]
fn budgets_that_are_no_positive_numbers_are_wrong_usage() {
    for budget in [time(0.0), time(-1.0), time(f64::NAN), error(0.0), error(f64::NAN), error(f64::INFINITY)] {
        let failed = within(&Bench::new(HEAD), &[], &budget).unwrap_err();
        assert_eq!(failed.error_class(), ErrorClass::Usage);
    }
}

/// The result of a stage, read back from the cache.
fn cached(report: &PipelineReport, stage: &str) -> ivd_artefact::Artefact {
    let path = record(report, stage, "").output.as_ref().unwrap().path.clone().unwrap();
    ivd_artefact::read(path).unwrap().artefact
}

/// Distance of lattices and largest difference of fields (mm), measured by the comparison of artefacts.
fn measured(found: &PipelineReport, truth: &PipelineReport) -> (f64, f64) {
    let between = |stage| compare(&cached(found, stage), &cached(truth, stage), &Exec::default()).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let field = between("map");
    let apart = number(&field["forward"]["max"]).max(number(&field["inverse"]["max"]));
    (number(&between("refine")["hausdorff"]), apart)
}

#[test]
fn an_error_that_is_allowed_holds_when_someone_else_measures_it() {
    let bench = Bench::new(HEAD);
    // The truth: nothing refined away, eight times the steps.
    let truth = bench.run(&["refine.level=0", "deform.dt=0.000125"]).unwrap();
    for most in [0.5, 20.0] {
        let BudgetedReport { run: found, budget } = within(&bench, &[], &error(most)).unwrap();
        let budget = budget.unwrap();
        let (lattice, field) = measured(&found, &truth);
        assert!(lattice + field <= most, "{lattice} + {field} > {most}");
        let told = budget.error_mm.unwrap();
        assert!(budget.kept && told <= most);
        let sum: f64 = budget.error_parts.values().sum();
        assert!((sum - told).abs() < 1e-12, "{budget:?}");
        let part = |name: &str| budget.error_parts.get(name).copied().unwrap_or(0.0);
        assert!(lattice <= part("lattice_mm") + 1e-6, "{lattice} {budget:?}");
        assert!(field <= part("motion_mm") + part("steps_mm") + 1e-6, "{field} {budget:?}");
        assert_eq!(part("lattice_mm"), refined(&found).max_error_mm);
    }
}

#[test]
fn a_larger_error_gives_a_coarser_lattice() {
    let bench = Bench::new(HEAD);
    let triangles = |most: f64| {
        let found = within(&bench, &[], &error(most)).unwrap();
        refined(&found.run).triangles
    };
    let (fine, coarse) = (triangles(0.5), triangles(20.0));
    assert!(coarse < fine, "{coarse} {fine}");
}

#[test]
fn an_error_that_nothing_holds_ends_with_a_limit_and_its_figures() {
    let bench = Bench::new(HEAD);
    let failed = within(&bench, &[], &error(1e-12)).unwrap_err();
    assert_eq!(failed.error_class(), ErrorClass::Limit);
    let told = failed.to_string();
    assert!(told.contains("--max-error") && told.contains("steps_mm") && told.contains("level 0"), "{told}");
    assert!(files(&bench).is_empty(), "{:?}", files(&bench));
    // A pinned level can't be made finer.
    let pinned = Budget { pinned: ["refine.level".to_owned()].into(), ..error(0.1) };
    let failed = within(&bench, &["refine.level=3"], &pinned).unwrap_err();
    assert!(failed.error_class() == ErrorClass::Limit && failed.to_string().contains("level 3"), "{failed}");
}

/// Gives every cached result of a stage another name for one of its figures, as a build of the program might that calls it so.
fn rename_figure(bench: &Bench, stage: &str, figure: &str) {
    let mut renamed = 0;
    for entry in Cache::open(bench.cache()).unwrap().entries().unwrap() {
        let mut loaded = ivd_artefact::read(&entry.path).unwrap();
        if loaded.provenance.stage == stage {
            let figures = loaded.metrics.as_object_mut().unwrap();
            let value = figures.remove(figure).unwrap();
            figures.insert(format!("{figure}_renamed"), value);
            ivd_artefact::write_with_metrics(
                &entry.path,
                &loaded.artefact,
                &loaded.provenance,
                &loaded.metrics,
            )
            .unwrap();
            renamed += 1;
        }
    }
    assert!(renamed > 0, "{stage}");
}

#[test]
fn a_figure_that_went_missing_is_an_error_and_never_a_part_of_0() {
    for (stage, figure) in
        [("refine", "max_error_mm"), ("map", "inverse_residual_max_voxel"), ("map", "relaxations")]
    {
        let bench = Bench::new(HEAD);
        within(&bench, &[], &error(0.5)).unwrap();
        rename_figure(&bench, stage, figure);
        let failed = within(&bench, &[], &error(0.5)).unwrap_err();
        assert_eq!(failed.error_class(), ErrorClass::Untrusted, "{failed}");
        let told = failed.to_string();
        assert!(told.starts_with(stage) && told.contains(&format!("`{figure}`")), "{told}");
        // What the message advises.
        let again = PipelineOptions { force: [stage.to_owned()].into(), ..PipelineOptions::default() };
        let again = bench.run_within(&[], &again, &error(0.5), &Exec::default()).unwrap();
        assert!(again.budget.unwrap().kept);
    }
}

#[test]
fn with_both_the_error_holds_and_pictures_give_way() {
    let both = Budget { max_error_mm: Some(0.5), ..slow(1e6, 3600.0) };
    let found = within(&Bench::new(HEAD), &[], &both).unwrap();
    let budget = found.budget.unwrap();
    assert!(budget.error_mm.unwrap() <= 0.5 && budget.kept);
    assert!(budget.choices.iter().any(|c| c.stage == "render"), "{budget:?}");
    let level = budget.choices.iter().find(|c| c.stage == "refine").unwrap();
    assert!(level.to.as_f64() < level.from.as_f64(), "{budget:?}");
}
