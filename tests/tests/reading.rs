//! No more of a volume is read than a scene looks at, and damage matters where it is looked at.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::time::Duration;

use ivd_artefact::CHUNK;
use ivd_pipeline::{PipelineReport, State};
use ivd_tests::{Bench, in_state, record};

/// 256³ voxels of 8 bits: four chunks of 64 layers.
const SIDE: usize = 256;
const SCENE: &str = r#"
schema = 1
[input]
file = "ball.raw"
[input.raw]
dims = [256, 256, 256]
type = "u8"
[lattice]
iso = 100.0
[refine]
level = 1
[deform]
stiffness = 50.0
[[deform.handle]]
pick = [-128.0, -128.0, 243.0]
force = [0.0, 0.0, 2.0]
radius = 12.0
[output]
lattice = "lattice.ply"
lattice_deformed = "deformed.ply"
"#;

/// A soft ball of 20 voxels in the last of the four chunks.
fn bench() -> Bench {
    let bench = Bench::new(SCENE);
    let value = |i: usize| {
        let at = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
        let from = [at[0].abs_diff(128), at[1].abs_diff(128), at[2].abs_diff(224)];
        let distance = from.iter().map(|d| (d * d) as f64).sum::<f64>().sqrt();
        (240.0 - 7.0 * distance).max(0.0) as u8
    };
    let voxels: Vec<u8> = (0..SIDE.pow(3)).map(value).collect();
    std::fs::write(bench.folder().join("ball.raw"), voxels).unwrap();
    bench
}

fn read(report: &PipelineReport, stage: &str) -> u64 {
    record(report, stage, "").bytes_read
}

fn hash(report: &PipelineReport, stage: &str) -> String {
    record(report, stage, "").output.as_ref().unwrap().hash.clone()
}

/// Flips a bit in a chunk of the cached volume's voxels.
fn damage(report: &PipelineReport, chunk: usize) {
    let path = record(report, "import", "").output.as_ref().unwrap().path.clone().unwrap();
    let voxels = ivd_artefact::peek(&path).unwrap().sections[0].offset as usize;
    let mut bytes = std::fs::read(&path).unwrap();
    // A layer that the surface passes, in the chunk of the ball.
    bytes[voxels + chunk * CHUNK + (30 * SIDE + 128) * SIDE + 128] ^= 0x40;
    std::fs::write(&path, bytes).unwrap();
}

#[test]
fn a_second_isovalue_reads_the_layers_of_its_surface_and_no_others() {
    let bench = bench();
    std::thread::sleep(Duration::from_millis(2100));
    let all = SIDE.pow(3) as u64;
    let first = bench.run(&[]).unwrap();
    assert_eq!(read(&first, "import"), all, "the source file, once");

    let second = bench.run(&["lattice.iso=120.0"]).unwrap();
    assert_eq!(record(&second, "import", "").state, State::Cached);
    let index = 9 * (SIDE as u64 / 8).pow(3);
    assert_eq!(read(&second, "import"), index, "the brick index alone, and nothing of the source file");
    assert_eq!(read(&second, "lattice"), CHUNK as u64, "one of four chunks");

    let moved = bench.run(&["lattice.iso=120.0", "deform.handle.0.radius=9.0"]).unwrap();
    assert_eq!(in_state(&moved, State::Ran), ["deform"]);
    assert_eq!(read(&moved, "import"), index, "another motion doesn't look at the volume");
}

#[test]
fn damage_that_nobody_looks_at_changes_nothing_and_any_other_is_made_good() {
    let isovalues = |iso: &str| format!("lattice.iso={iso}");
    let sound = bench();
    let expected: Vec<String> =
        ["80.0", "90.0", "110.0"].map(|iso| hash(&sound.run(&[&isovalues(iso)]).unwrap(), "lattice")).into();

    let bench = bench();
    let first = bench.run(&[]).unwrap();
    damage(&first, 0);
    let report = bench.run(&[&isovalues("80.0")]).unwrap();
    assert_eq!(record(&report, "import", "").state, State::Cached);
    assert_eq!(hash(&report, "lattice"), expected[0]);

    damage(&first, 3);
    let report = bench.run(&[&isovalues("90.0")]).unwrap();
    let import = record(&report, "import", "");
    assert_eq!(import.state, State::Ran);
    assert!(import.why.contains("can't be trusted"), "{}", import.why);
    assert_eq!(hash(&report, "lattice"), expected[1]);

    let report = bench.run(&[&isovalues("110.0")]).unwrap();
    assert_eq!(record(&report, "import", "").state, State::Cached, "the entry was made good");
    assert_eq!(hash(&report, "lattice"), expected[2]);
}
