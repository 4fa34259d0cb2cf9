//! `ivd bench` as a user runs it.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;
use std::process::{Command, Output};

fn bench(out: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command
        .args(["bench", "lattice", "--size", "16", "--repeats", "2", "--json", "--out"])
        .arg(out)
        .args(words);
    command.output().unwrap()
}

#[test]
fn a_bench_writes_its_files_and_finds_a_planted_loss_of_accuracy() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("first"), folder.path().join("second"));
    let done = bench(&first, &[]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let told: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(told["stages"][0]["points"], 6);
    for name in ["bench.json", "bench.csv", "bench.html"] {
        assert!(first.join(name).is_file(), "{name}");
    }
    let old = first.join("bench.json");
    let done = bench(&second, &["--plant", "inexact", "--compare", old.to_str().unwrap()]);
    let told: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let changes = told["comparison"]["changes"].as_array().unwrap();
    assert_eq!(told["comparison"]["compared"], 6);
    let losses = changes.iter().filter(|c| c["what"] == "error").collect::<Vec<_>>();
    assert!(losses.len() == 6 && losses.iter().all(|c| c["ratio"].as_f64().unwrap() > 1.4), "{changes:?}");
}

#[test]
fn a_wrong_stage_and_a_wrong_old_bench_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let wrong = bench(&out, &["octree"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("`octree`"));
    let file = folder.path().join("old.json");
    std::fs::write(&file, "{}").unwrap();
    let wrong = bench(&out, &["--compare", file.to_str().unwrap()]);
    assert_eq!(wrong.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("old.json"));
    assert_eq!(bench(&out, &["--compare", "nowhere.json"]).status.code(), Some(7));
    assert!(!out.exists(), "nothing was written");
}
