//! Displacements without a lattice, through the program: single stages, a scene, and what is refused.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use serde_json::Value;

use crate::call::{json, refused};

const TURN: &str = "kind=rotate;centre=20,20,20;radius=18;angle=30";
const BACK: &str = "kind=rotate;centre=20,20,20;radius=18;angle=-30";
const CUT: &str = "kind=cut;centre=20,20,20;normal=0,0,1;radius=14;open=4";
const MAIL: &str = "kind=chain;centre=20,20,32;grip=3;by=0,0,3";

#[test]
fn steps_go_on_from_one_another_and_from_a_displacement() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "torus", "--size", "40", "-o", "v.ivd"]);
    let turned = json(at, &["space", "v.ivd", "--step", TURN, "-o", "d.ivd"]);
    assert_eq!((&turned["stage"], &turned["output"]["kind"]), (&"space".into(), &"displacement".into()));
    let metrics = &turned["metrics"];
    assert!(metrics["voxels_moved"].as_u64().unwrap() > 10_000, "{metrics}");
    assert!(
        metrics["min_det_j"].as_f64().unwrap() > 0.5 && metrics["folds"] == 0 && metrics["parts"] == 1,
        "{metrics}"
    );
    assert!(metrics["inverse_residual_max_voxel"].as_f64().unwrap() < 1e-2, "{metrics}");
    // There and back, in one run and from a displacement on: the torus has come to where it was.
    json(at, &["space", "v.ivd", "--step", BACK, "--after", "d.ivd", "-o", "back.ivd"]);
    json(at, &["space", "v.ivd", "--step", TURN, "--step", BACK, "-o", "both.ivd"]);
    for displacement in ["back.ivd", "both.ivd"] {
        json(at, &["warp", "v.ivd", displacement, "-o", "w.ivd"]);
        let apart = json(at, &["compare", "v.ivd", "w.ivd"]);
        assert!(apart["max"].as_f64().unwrap() < 1e-3, "{displacement}: {apart}");
    }
}

#[test]
fn a_cut_opens_a_volume_and_says_that_it_has_two_sides() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd", "--truth", "t.ivd"]);
    let cut = json(at, &["space", "t.ivd", "--step", CUT, "-o", "d.ivd"]);
    assert_eq!(cut["metrics"]["two_sided"], true);
    let opened = cut["metrics"]["voxels_vacated"].as_u64().unwrap();
    assert!(opened > 400, "{cut}");
    // The ball goes apart: in the mouth of the cut there is nothing of it, and the rest is what it was but for what is squeezed where it fades out.
    let voxels = |file: &str| {
        let classes = json(at, &["info", file])["content"]["classes"].as_array().cloned().unwrap();
        classes.iter().find(|c| c["id"] == 1).unwrap()["voxels"].as_u64().unwrap()
    };
    json(at, &["warp", "t.ivd", "d.ivd", "-o", "w.ivd"]);
    let [before, after] = ["t.ivd", "w.ivd"].map(|file| voxels(file) as f64);
    assert!(((after + opened as f64) / before - 1.0).abs() < 0.02, "{before} {after} {opened}");
    let apart = json(at, &["compare", "t.ivd", "w.ivd"]);
    assert_ne!(apart["equal"], true, "{apart}");
    json(at, &["export", "d.ivd", "-o", "d.json"]);
    let told: Value = serde_json::from_slice(&std::fs::read(at.join("d.json")).unwrap()).unwrap();
    assert_eq!(told["two_sided"], true);
    let (code, said) = refused(at, &["space", "v.ivd", "--step", TURN, "--after", "d.ivd", "-o", "x.ivd"]);
    assert!(code == 2 && said.contains("has a cut") && said.contains("warp first"), "{code} {said}");
    assert!(!at.join("x.ivd").exists());
}

#[test]
fn chain_mail_knows_classes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd", "--truth", "t.ivd"]);
    let soft = json(at, &["space", "v.ivd", "--step", MAIL, "-o", "soft.ivd"]);
    // The ball gives way by nothing: it goes along whole, and more moves.
    let stiff = format!("{MAIL};material.1=shrink:1,stretch:1,shear:0");
    let words = ["space", "v.ivd", "--step", &stiff, "--labels", "t.ivd", "-o", "stiff.ivd"];
    let whole = json(at, &words);
    let moved = |told: &Value| told["metrics"]["voxels_moved"].as_u64().unwrap();
    assert!(moved(&whole) > moved(&soft), "{} {}", moved(&whole), moved(&soft));
    json(at, &["warp", "t.ivd", "stiff.ivd", "-o", "w.ivd"]);
    let apart = json(at, &["compare", "t.ivd", "w.ivd"]);
    assert!(apart.to_string().contains("dice"), "{apart}");
    let (code, said) = refused(at, &["space", "v.ivd", "--step", &stiff, "-o", "x.ivd"]);
    assert!(code == 2 && said.contains("no labels"), "{code} {said}");
}

#[test]
fn a_scene_without_a_lattice_moves_and_one_with_both_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = |deform: &str| {
        format!(
            "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\n[lattice]\niso = 128.0\n{deform}\n\
             [[space.step]]\nkind = \"cut\"\ncentre = [20, 20, 20]\nnormal = [0, 0, 1]\nradius = 14\nopen = 4\n\
             [output]\nvolume = \"opened.nii.gz\"\ndisplacement = \"field.nrrd\"\nreport = true\n"
        )
    };
    std::fs::write(at.join("scene.toml"), scene("")).unwrap();
    let told = json(at, &["pipeline", "scene.toml", "--out", "out"]);
    let state = |told: &Value, name: &str| {
        let stages = told["stages"].as_array().unwrap();
        stages.iter().find(|s| s["stage"] == name).map_or(Value::Null, |s| s["state"].clone())
    };
    for (stage, expected) in
        [("space", "ran"), ("warp", "ran"), ("deform", "not_needed"), ("map", "not_needed")]
    {
        assert_eq!(state(&told, stage), expected, "{stage}");
    }
    let deform = "[deform]\n[[deform.handle]]\npick = [20, 20, 33]\nmove = [0, 0, 2]\nradius = 9.0";
    std::fs::write(at.join("both.toml"), scene(deform)).unwrap();
    let told = json(at, &["pipeline", "both.toml", "--out", "both"]);
    for stage in ["deform", "map", "space", "warp"] {
        assert_eq!(state(&told, stage), "ran", "{stage}");
    }
    let (code, said) = refused(at, &["pipeline", "both.toml", "--out", "no", "--max-error", "1"]);
    assert!(code == 2 && said.contains("space.step"), "{code} {said}");
    // Without steps the stage isn't named.
    let still = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 16\n[lattice]\niso = 128.0\n[output]\nlattice = \"l.ply\"\n";
    std::fs::write(at.join("still.toml"), still).unwrap();
    assert_eq!(state(&json(at, &["pipeline", "still.toml", "--out", "still"]), "space"), Value::Null);
}

#[test]
fn what_folds_or_misses_is_told_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "sphere", "--size", "24", "-o", "v.ivd"]);
    for (steps, code, word) in [
        (&["kind=bend;centre=12,12,12;radius=11;rate=60;spine=1,0,0"][..], 5, "folds"),
        (&["kind=rotate;centre=500,0,0;radius=3;angle=4"], 2, "no voxel"),
        (&["kind=chain;centre=500,0,0;grip=3;by=1,0,0"], 2, "outside the volume"),
        (&[CUT, CUT], 2, "one at most"),
        (&["kind=rotate;centre=1,2,3;radius=3"], 2, "angle"),
        (&[], 2, "nothing to do"),
    ] {
        let mut words = vec!["space", "v.ivd", "-o", "x.ivd"];
        for step in steps {
            words.extend(["--step", step]);
        }
        let (found, said) = refused(at, &words);
        assert!(found == code && said.contains(word), "{steps:?}: {found} {said}");
        assert!(!at.join("x.ivd").exists(), "{steps:?}");
    }
}
