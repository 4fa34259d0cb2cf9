//! The bench on a given volume.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

#[path = "../../ivd-io/tests/notes.rs"]
mod notes;

use std::sync::Arc;

use ivd_bench::{Given, Options, run};
use ivd_core::Exec;

use notes::Notes;

#[test]
fn a_given_volume_is_swept_and_what_has_no_truth_on_it_is_named() {
    let size = 32;
    let volume = ivd_phantom::generate(
        &ivd_phantom::Params { size, ..ivd_phantom::Params::default() },
        &Exec::default(),
    )
    .unwrap()
    .volume;
    let given = Given { name: "a head".to_owned(), volume: Arc::new(volume) };
    let options = Options { input: Some(given), repeats: 1, ..Options::default() };
    let notes = Arc::new(Notes::default());
    let bench = run(&options, &Exec::default().with_observer(notes.clone())).unwrap();
    let names: Vec<&str> = bench.stages.iter().map(|s| s.stage.as_str()).collect();
    assert_eq!(names, ["segment", "atf", "lattice", "refine", "deform", "map", "render"]);
    let told = notes.0.lock().unwrap();
    assert!(told.len() == 1 && told[0].starts_with("warp:"), "{told:?}");
    for stage in &bench.stages {
        assert!(stage.input.contains("a head"), "{}", stage.input);
        let errors: Vec<f64> = stage.points.iter().map(|p| p.error).collect();
        assert!(errors.iter().any(|e| *e != errors[0]), "{}: {errors:?}", stage.stage);
    }
    // The truth itself errs by nothing: all voxels, and the unrefined lattice.
    let of = |stage: &str| bench.stages.iter().find(|s| s.stage == stage).unwrap();
    assert!(of("lattice").points.last().unwrap().error < 1e-6);
    assert!(of("refine").points.iter().find(|p| p.task == "level 0").unwrap().error < 1e-6);
    assert_eq!(of("map").points[0].error, 0.0);
}
