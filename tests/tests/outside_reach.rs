//! A deformed volume is the input outside the handles' reach, and the input altogether where nothing pushes.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use ivd_artefact::Artefact;
use ivd_core::Volume;
use ivd_map::MapFigures;
use ivd_pipeline::PipelineReport;
use ivd_tests::{Bench, record};

const SCENE: &str = include_str!("../scenes/outside_reach.toml");

fn volume(report: &PipelineReport, stage: &str) -> Volume {
    let path = record(report, stage, "").output.as_ref().unwrap().path.clone().unwrap();
    match ivd_artefact::read(path).unwrap().artefact {
        Artefact::Volume(volume) => volume,
        other => panic!("{stage} gave {:?}", other.kind()),
    }
}

#[test]
fn voxels_out_of_reach_keep_their_bits_and_some_within_change() {
    let bench = Bench::new(SCENE);
    let report = bench.run(&[]).unwrap();
    let (before, after) = (volume(&report, "import"), volume(&report, "warp"));
    assert_eq!(before.grid(), after.grid());
    let moved = record(&report, "map", "").figures::<MapFigures>().unwrap().voxels_moved;
    let changed: Vec<usize> =
        (0..before.grid().len()).filter(|&i| before.voxels().get(i) != after.voxels().get(i)).collect();
    assert!(!changed.is_empty() && changed.len() as u64 <= 2 * moved);
    for i in changed {
        let [x, y, z] = before.grid().index(i).0.map(|c| c as f64);
        let distance = ((x - 24.0).powi(2) + (y - 38.0).powi(2) + (z - 24.0).powi(2)).sqrt();
        // Reach, the default margin of a quarter to a half of it, the move itself, and the snap to a vertex.
        assert!(distance < 16.0 * 2.0 + 3.0 + 6.0, "voxel {:?} changed at {distance} mm", [x, y, z]);
    }
}

#[test]
fn a_motion_of_nothing_gives_the_input_bit_for_bit() {
    let bench = Bench::new(&SCENE.replace("move = [0.0, 3.0, 0.0]", "force = [0.0, 0.0, 0.0]"));
    let report = bench.run(&[]).unwrap();
    assert_eq!(volume(&report, "import").voxels().as_bytes(), volume(&report, "warp").voxels().as_bytes());
    assert_eq!(record(&report, "map", "").figures::<MapFigures>().unwrap().voxels_moved, 0);
}
