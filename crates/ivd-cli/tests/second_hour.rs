//! What someone meets who goes on: a run that fails after one that didn't, and files of other programs that don't fit.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use serde_json::Value;

use crate::call::{ivd, json, refused};

/// A ball of radius 14 mm about (19.5, 19.5, 19.5), pressed in at the front.
const SCENE: &str = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\n[lattice]\niso = 128.0\n[refine]\nlevel = 1\n\
    [[deform.handle]]\npick = [20.0, 33.0, 20.0]\nmove = [0.0, -2.0, 0.0]\nradius = 12.0\n[output]\nvolume = \"out.nii.gz\"\nreport = true\n";

/// Runs a scene; its exit code, what it says, and its JSON.
fn pipeline(at: &Path, scene: &str, words: &[&str]) -> (i32, String, Value) {
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let fixed = ["pipeline", "scene.toml", "--out", "out", "--json"];
    let output = ivd(at, &[&fixed[..], words].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    (output.status.code().unwrap(), told, serde_json::from_slice(&output.stdout).unwrap())
}

#[test]
fn a_run_that_fails_names_the_outputs_of_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let folds = SCENE.replace("-2.0", "-12.0").replace("12.0\n[output]", "3.0\n[output]");
    let wrong = SCENE.replace("radius", "raduis");
    let (code, told, object) = pipeline(at, &folds, &[]);
    assert!(code == 5 && !told.contains("earlier"), "nothing was there: {told}");
    assert!(object["error"].get("left_over").is_none(), "{object}");
    let (code, told, _) = pipeline(at, SCENE, &[]);
    assert!(code == 0 && !told.contains("earlier"), "{told}");
    for (scene, wanted) in [(&folds, 5), (&wrong, 2)] {
        let (code, told, object) = pipeline(at, scene, &[]);
        assert_eq!(code, wanted, "{told}");
        let note = told.lines().last().unwrap();
        for words in
            ["note: this run wrote none of", "out/report.html (of 2", "out/out.nii.gz (of 2", " UTC)"]
        {
            assert!(note.contains(words), "{words}: {note}");
        }
        let left = object["error"]["left_over"].as_array().unwrap();
        let names: Vec<&str> = left.iter().map(|file| file["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["volume", "report"]);
        assert!(!object["error"]["message"].as_str().unwrap().contains("earlier"), "{object}");
    }
    // What a failed run wrote before it failed is its own.
    let more = folds.replace("report = true", "report = true\nimages = [\"before\"]");
    let (code, told, _) = pipeline(at, &more, &[]);
    assert!(code == 5 && told.contains("out/report.html") && !told.contains("before.png"), "{told}");
    // Who asks for no outputs, and who succeeds, isn't told of any.
    assert!(!pipeline(at, &folds, &["--until", "map"]).1.contains("earlier"));
    assert!(!pipeline(at, SCENE, &[]).1.contains("earlier"));
}
