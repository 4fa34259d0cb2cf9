//! A scene does what its outputs need, and nothing twice.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::sync::Arc;

use ivd_core::{Classified, Device, Exec};
use ivd_pipeline::{PipelineOptions, State};
use ivd_tests::{Bench, in_state, record};

const SCENE: &str = include_str!("../scenes/skipping.toml");

const OUTPUTS: [&str; 6] =
    ["before.png", "after.png", "difference.png", "deformed.nii.gz", "lattice.ply", "report.html"];

#[test]
fn the_same_run_again_is_cached_throughout_and_touches_no_file() {
    let bench = Bench::new(SCENE);
    let first = bench.run(&[]).unwrap();
    assert!(in_state(&first, State::Cached).is_empty());
    let times = || OUTPUTS.map(|name| std::fs::metadata(bench.out(name)).unwrap().modified().unwrap());
    let before = times();
    let second = bench.run(&[]).unwrap();
    assert!(in_state(&second, State::Ran).is_empty(), "ran: {:?}", in_state(&second, State::Ran));
    assert_eq!(before, times());
    assert!(second.outputs.iter().all(|o| !o.written));
    for (a, b) in first.stages.iter().zip(&second.stages) {
        assert_eq!(a.output.as_ref().map(|o| &o.hash), b.output.as_ref().map(|o| &o.hash), "{}", a.stage);
        assert_eq!(a.metrics.figures, b.metrics.figures, "figures come with the cached entry");
    }
}

#[test]
fn the_backend_on_record_is_the_one_that_ran_whatever_was_asked_for() {
    let bench = Bench::new(SCENE);
    let exec = Exec::default().with_device(Arc::new(Device::new("one that knows no kernel")));
    let asked = bench.run_with(&[], &PipelineOptions::default(), &exec).unwrap();
    assert!(asked.stages.iter().all(|s| s.backend == "cpu"));
    let plain = bench.run(&[]).unwrap();
    assert!(
        in_state(&plain, State::Ran).is_empty(),
        "one work, one cache key: {:?}",
        in_state(&plain, State::Ran)
    );
}

#[test]
fn a_new_stiffness_reruns_what_depends_on_it_and_nothing_before() {
    let bench = Bench::new(SCENE);
    bench.run(&[]).unwrap();
    let again = bench.run(&["deform.stiffness=20"]).unwrap();
    // The picture before leaves room for what moves: it shares its camera with that after.
    assert_eq!(
        in_state(&again, State::Ran),
        [
            "deform",
            "map",
            "warp",
            "render before",
            "render after",
            "render difference",
            "render moved",
            "report"
        ]
    );
    let why = &record(&again, "deform", "").why;
    assert!(why.contains("stiffness") && why.contains("50") && why.contains("20"), "{why}");
}

#[test]
fn a_flipped_byte_in_an_entry_recomputes_that_stage_alone() {
    let bench = Bench::new(SCENE);
    let first = bench.run(&[]).unwrap();
    for stage in ["segment", "refine", "map"] {
        let path = record(&first, stage, "").output.as_ref().unwrap().path.clone().unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.len() - 3;
        bytes[at] ^= 0x10;
        std::fs::write(&path, bytes).unwrap();
        let again = bench.run(&[]).unwrap();
        assert_eq!(in_state(&again, State::Ran), [stage]);
        assert!(record(&again, stage, "").why.contains("can't be trusted"));
    }
}

#[test]
fn without_pictures_and_report_nothing_is_coloured_or_drawn() {
    let bench = Bench::new(SCENE);
    let report = bench.run(&["output.images=[]", "output.report=false"]).unwrap();
    assert_eq!(
        in_state(&report, State::NotNeeded),
        ["atf", "render before", "render after", "render difference", "render moved", "report"]
    );
}

#[test]
fn a_given_isovalue_without_a_class_never_segments_even_for_pictures() {
    let text = SCENE.replace("[boundary]\nclass = \"densest\"\n", "[lattice]\niso = 127.5\n");
    let bench = Bench::new(&text);
    let report = bench.run(&[]).unwrap();
    assert_eq!(in_state(&report, State::NotNeeded), ["segment", "boundary"]);
    assert!(record(&report, "segment", "").why.contains("isovalue"));
}

#[test]
fn an_output_that_no_stage_makes_is_refused_by_name() {
    let text = SCENE
        .replace("[boundary]\nclass = \"densest\"\n", "[lattice]\niso = 127.5\n")
        .replace("report = true", "mask = \"mask.nrrd\"");
    let error = Bench::new(&text).run(&[]).unwrap_err();
    assert!(error.to_string().contains("output.mask") && error.to_string().contains("boundary"), "{error}");
    assert_eq!(error.error_class(), ivd_core::ErrorClass::Usage);
}

#[test]
fn a_lattice_alone_needs_no_motion() {
    let bench = Bench::new(SCENE);
    let report = bench.run(&["output.images=[]", "output.report=false", "output.volume=false"]);
    // `false` is no file name: the scene says so.
    assert!(report.is_err());
    let text = SCENE.replace("volume = \"deformed.nii.gz\"\n", "").replace("report = true", "");
    let bench = Bench::new(&text);
    let report = bench.run(&["output.images=[]"]).unwrap();
    assert_eq!(in_state(&report, State::Ran), ["import", "segment", "boundary", "lattice", "refine"]);
}

#[test]
fn a_stage_that_reran_to_the_same_content_stops_the_chain() {
    let bench = Bench::new(SCENE);
    bench.run(&[]).unwrap();
    // Holes are filled in a ball that has none: the mask is the same.
    let again = bench.run(&["boundary.fill_holes=false"]).unwrap();
    assert_eq!(in_state(&again, State::Ran), ["boundary", "report"]);
}

#[test]
fn force_and_until_do_what_they_say() {
    let bench = Bench::new(SCENE);
    bench.run(&[]).unwrap();
    let options = PipelineOptions { force: ["lattice".to_owned()].into(), ..Default::default() };
    let forced = bench.run_with(&[], &options, &Exec::default()).unwrap();
    assert_eq!(in_state(&forced, State::Ran), ["lattice"]);

    let bench = Bench::new(SCENE);
    let options = PipelineOptions { until: Some("lattice".to_owned()), ..Default::default() };
    let report = bench.run_with(&[], &options, &Exec::default()).unwrap();
    assert_eq!(in_state(&report, State::Ran), ["import", "segment", "boundary", "lattice"]);
    assert!(!bench.out("lattice.ply").exists());
    let options = PipelineOptions { until: Some("lattise".to_owned()), ..Default::default() };
    assert!(bench.run_with(&[], &options, &Exec::default()).is_err());
}

#[test]
fn a_dry_run_does_nothing() {
    let bench = Bench::new(SCENE);
    let options = PipelineOptions { dry_run: true, ..Default::default() };
    let report = bench.run_with(&[], &options, &Exec::default()).unwrap();
    assert!(report.outputs.is_empty() && !bench.out("").exists());
    assert!(record(&report, "map", "").why.contains("needed for"));
}

#[test]
fn content_hashes_are_the_same_for_any_number_of_threads() {
    let hashes = |threads: usize| {
        let report = Bench::new(SCENE)
            .run_with(&[], &PipelineOptions::default(), &Exec::default().with_threads(threads))
            .unwrap();
        let stages = report.stages.into_iter().filter(|r| r.stage != "report");
        stages.map(|r| (r.stage, r.output.map(|o| o.hash))).collect::<Vec<_>>()
    };
    let one = hashes(1);
    for threads in [2, 2, 3] {
        assert_eq!(one, hashes(threads), "{threads} threads");
    }
}
