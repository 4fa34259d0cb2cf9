//! `--max-time` and `--max-error` as a user meets them: exit codes, what is said and where.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;
use std::process::{Command, Output};

const SCENE: &str = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 32\n[lattice]\niso = 127.5\n\
    [[deform.handle]]\npick = [26.0, 16.0, 16.0]\nmove = [2.0, 0.0, 0.0]\nradius = 10.0\n\
    [output]\nlattice = \"lattice.ply\"\ndisplacement = \"inverse.nrrd\"\n";

fn pipeline(folder: &Path, words: &[&str]) -> Output {
    std::fs::write(folder.join("scene.toml"), SCENE).unwrap();
    Command::new(env!("CARGO_BIN_EXE_ivd"))
        .current_dir(folder)
        .args(["pipeline", "scene.toml", "--out", "out", "--cache", "off"])
        .args(words)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_budget_that_is_no_budget_is_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    for words in [["--max-time", "0"], ["--max-time", "-1"], ["--max-time", "NaN"], ["--max-error", "0"]] {
        let failed = pipeline(folder.path(), &words);
        assert_eq!(failed.status.code(), Some(2), "{words:?}");
        assert!(text(&failed.stderr).contains(words[0]), "{}", text(&failed.stderr));
    }
    assert!(!folder.path().join("out").exists());
}

#[test]
fn a_time_that_nothing_keeps_ends_with_4_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let failed = pipeline(folder.path(), &["--max-time", "1e-9", "--json"]);
    assert_eq!(failed.status.code(), Some(4));
    let told: serde_json::Value = serde_json::from_slice(&failed.stdout).unwrap();
    assert_eq!(told["error"]["exit_code"], 4);
    assert!(text(&failed.stderr).contains("--max-time") && !folder.path().join("out").exists());
}

#[test]
fn choices_are_told_on_stderr_and_in_json_and_stdout_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let plain = pipeline(folder.path(), &[]);
    let held = pipeline(folder.path(), &["--max-error", "0.05"]);
    assert!(held.status.success(), "{}", text(&held.stderr));
    let paths =
        |out: &Output| text(&out.stdout).lines().map(|l| l.split(' ').next().unwrap().to_owned()).collect();
    let (a, b): (Vec<String>, Vec<String>) = (paths(&plain), paths(&held));
    assert_eq!(a, b);
    assert!(text(&held.stderr).contains("budget: refine.level: 2 →"), "{}", text(&held.stderr));
    assert!(!text(&pipeline(folder.path(), &["--max-error", "0.05", "-q"]).stderr).contains("budget"));
    let explained = text(&pipeline(folder.path(), &["--max-error", "0.05", "--explain"]).stdout);
    assert!(explained.contains("mm of 0.05 mm"), "{explained}");
    let json = pipeline(folder.path(), &["--max-error", "0.05", "--json"]);
    let told: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    let budget = &told["budget"];
    assert_eq!(budget["kept"], true);
    assert!(budget["error_mm"].as_f64().unwrap() <= 0.05 && budget["wall_s"].as_f64().unwrap() > 0.0);
    assert_eq!(budget["choices"][0]["stage"], "refine");
    // What --set gives stays: then nothing holds so small an error.
    let pinned = pipeline(folder.path(), &["--max-error", "0.05", "--set", "refine.level=3"]);
    assert_eq!(pinned.status.code(), Some(4), "{}", text(&pinned.stderr));
}
