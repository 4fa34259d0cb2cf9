//! Free forms through the program: single stages, a scene, and what is refused.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use serde_json::Value;

use crate::call::{ivd, json};

const PUSH: &str = "kind=translate;centre=20,20,20;radius=60;core=0.8;by=0,3,4";

fn ball(at: &Path) -> Value {
    json(at, &["phantom", "sphere", "--size", "40", "-o", "v.ivd"]);
    json(at, &["lattice", "v.ivd", "--iso", "128", "-o", "l.ivd"])
}

#[test]
fn shapes_move_a_lattice_alone_and_after_a_handle() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let vertices = ball(at)["metrics"]["vertices"].clone();
    let alone = json(at, &["deform", "l.ivd", "--shape", PUSH, "-o", "alone.ivd"]);
    assert_eq!(alone["metrics"]["vertices_moved"], vertices);
    assert_eq!(alone["metrics"]["steps"], 0);
    assert!((alone["metrics"]["max_displacement_mm"].as_f64().unwrap() - 5.0).abs() < 1e-9);
    // The handle's vertex goes (0, 3, 4) further than the handle takes it.
    let handle = "vertex=0;move=0,3,4;radius=9";
    let both = json(at, &["deform", "l.ivd", "--handle", handle, "--shape", PUSH, "-o", "both.ivd"]);
    assert!(both["metrics"]["steps"].as_u64().unwrap() > 0);
    assert!((both["metrics"]["max_displacement_mm"].as_f64().unwrap() - 10.0).abs() < 1e-9);
    // There and back.
    let pull = PUSH.replace("0,3,4", "0,-3,-4");
    let back = json(at, &["deform", "l.ivd", "--shape", PUSH, "--shape", &pull, "-o", "back.ivd"]);
    assert!(back["metrics"]["max_displacement_mm"].as_f64().unwrap() < 1e-9);
}

#[test]
fn every_solver_takes_a_handle_to_its_place_and_says_what_its_reach_cuts_off() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ball(at);
    json(at, &["refine", "l.ivd", "--level", "1", "-o", "r.ivd"]);
    let handle = "pick=34,20,20;move=3,0,0;radius=14";
    for solver in ["ring", "dynamics", "projective", "xpbd"] {
        let words = ["deform", "r.ivd", "--handle", handle, "--solver", solver, "-o", "m.ivd"];
        let told = json(at, &words);
        let number =
            |key: &str| told["metrics"][key].as_f64().unwrap_or_else(|| panic!("{solver}: {key}: {told}"));
        assert!((number("max_displacement_mm") - 3.0).abs() < 1e-9, "{solver}: {told}");
        assert!(number("vertices_moved") > 10.0 && number("energy_last").is_finite(), "{solver}");
        assert_eq!(told["metrics"]["truncation"].is_null(), solver == "ring", "{solver}: {told}");
    }
    // What the ring reads is not the springs' to read, and the other way round.
    std::fs::write(at.join("p.toml"), "epsilon = 0.1\n").unwrap();
    let words =
        ["deform", "r.ivd", "--handle", handle, "--solver", "dynamics", "--params", "p.toml", "-o", "x.ivd"];
    let refused = ivd(at, &words);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8(refused.stderr).unwrap().contains("epsilon"));
}

#[test]
fn a_scene_with_springs_and_the_smoothest_map_needs_no_octree() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\n[lattice]\niso = 128.0\n[refine]\nlevel = 1\n\
        [deform]\nsolver = \"projective\"\n[[deform.handle]]\npick = [34, 20, 20]\nmove = [2, 0, 0]\nradius = 14.0\n\
        [map]\nmethod = \"biharmonic\"\n[output]\nvolume = \"pulled.nii.gz\"\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let told = json(at, &["pipeline", "scene.toml", "--out", "out"]);
    let stage =
        |name: &str| told["stages"].as_array().unwrap().iter().find(|s| s["stage"] == name).unwrap().clone();
    assert_eq!(stage("octree")["state"], "not_needed");
    assert_eq!(stage("map")["metrics"]["folds"], 0);
    assert!(
        stage("map")["metrics"]["followed"]["misfit_rms_voxel"].as_f64().unwrap() < 0.2,
        "{}",
        stage("map")
    );
    assert!(at.join("out/pulled.nii.gz").exists());
}

#[test]
fn a_twist_goes_from_the_lattice_to_the_voxels() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ball(at);
    json(at, &["octree", "l.ivd", "-o", "o.ivd"]);
    let twist = "kind=twist;centre=20,20,20;axis=1,0,0;radius=19;core=0.3;rate=2";
    json(at, &["deform", "l.ivd", "--shape", twist, "-o", "m.ivd"]);
    let map = json(at, &["map", "l.ivd", "o.ivd", "m.ivd", "-o", "d.ivd"]);
    assert_eq!(map["metrics"]["folds"], 0);
    assert!(map["metrics"]["voxels_moved"].as_u64().unwrap() > 0);
    json(at, &["warp", "v.ivd", "d.ivd", "-o", "twisted.ivd"]);
    // Turning a ball about its axis leaves it where it was, to what interpolation loses at its rim.
    let change = json(at, &["compare", "v.ivd", "twisted.ivd"]);
    assert!(change["rms"].as_f64().unwrap() < 4.0, "{change}");
}

#[test]
fn a_scene_takes_shapes_without_handles() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\n[lattice]\niso = 128.0\n\
        [[deform.shape]]\nkind = \"stretch\"\ncentre = [20, 20, 20]\nradius = 19.0\nfactor = 1.2\n\
        [output]\nvolume = \"stretched.nii.gz\"\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let told = json(at, &["pipeline", "scene.toml", "--out", "out"]);
    let deform = told["stages"].as_array().unwrap().iter().find(|s| s["stage"] == "deform").unwrap();
    assert_eq!(deform["state"], "ran");
    assert!(deform["metrics"]["vertices_moved"].as_u64().unwrap() > 0);
    assert!(at.join("out/stretched.nii.gz").exists());
}

#[test]
fn a_report_tells_what_each_class_gains_or_loses() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 32\n[segment]\nmethod = \"kmvs\"\nk = 2\n\
        [boundary]\nclass = \"densest\"\n[lattice]\niso = \"boundary\"\n[render]\nsize = [64, 64]\nmode = \"mip\"\n\
        [[deform.shape]]\nkind = \"scale\"\ncentre = [16, 16, 16]\nradius = 15.0\nalong = 1.2\nacross = 1.2\n\
        [output]\nreport = true\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    json(at, &["pipeline", "scene.toml", "--out", "out"]);
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    let table = page.split("<th>change [mm³]</th>").nth(1).unwrap().split("</table>").next().unwrap();
    let changes: Vec<f64> =
        table.split("</td><td>").filter_map(|cell| cell.split("</td>").next()?.parse::<f64>().ok()).collect();
    // Two classes: volume at rest, change, percent; the ball grows by what the air loses.
    assert_eq!(changes.len(), 6, "{table}");
    assert!(changes[4] > 100.0 && (changes[1] + changes[4]).abs() < 0.01 * changes[4], "{table}");
}

#[test]
fn what_a_shape_does_not_read_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (shape, word) in [
        ("kind=translate;centre=1,2,3;radius=4;by=1,0,0;angle=3", "angle"),
        ("kind=bend;centre=1,2,3;radius=4;rate=3", "spine"),
        ("kind=melt;centre=1,2,3;radius=4", "melt"),
    ] {
        let output = ivd(at, &["deform", "l.ivd", "--shape", shape, "-o", "m.ivd"]);
        assert_eq!(output.status.code(), Some(2), "{shape}");
        let words = String::from_utf8(output.stderr).unwrap();
        assert!(words.contains(word), "{shape}: {words}");
    }
    let neither = ivd(at, &["deform", "l.ivd", "-o", "m.ivd"]);
    assert_eq!(neither.status.code(), Some(2));
}

/// Two parts: a ball of class 2 in air of class 1.
fn labelled(at: &Path) {
    ball(at);
    json(at, &["segment", "v.ivd", "--method", "kmvs", "--k", "2", "-o", "labels.ivd"]);
    json(at, &["octree", "l.ivd", "-o", "o.ivd"]);
    json(at, &["deform", "l.ivd", "--handle", "pick=34,20,20;move=-2,0,0;radius=12", "-o", "m.ivd"]);
}

#[test]
fn finite_elements_know_materials_by_class() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    labelled(at);
    let map = |more: &[&str]| {
        let words = ["map", "l.ivd", "o.ivd", "m.ivd", "--method", "fem", "--cell", "2", "-o", "d.ivd"];
        json(at, &[&words[..], more].concat())["metrics"].clone()
    };
    let plain = map(&[]);
    assert_eq!(plain["folds"], 0);
    let solved = &plain["solved"];
    assert!(
        solved["nodes"].as_u64().unwrap() > 100 && solved["residual"].as_f64().unwrap() <= 1e-5,
        "{solved}"
    );
    // Air as hard as the ball resists the push from outside.
    std::fs::write(at.join("p.toml"), "[material.1]\nyoung = 1.0\n").unwrap();
    let hard = map(&["--params", "p.toml", "--labels", "labels.ivd"]);
    assert_eq!(hard["folds"], 0);
    assert_ne!(hard["min_det_j"], plain["min_det_j"]);
    let scene = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 40\n[segment]\nmethod = \"kmvs\"\nk = 2\n\
        [lattice]\niso = 128.0\n[refine]\nlevel = 0\n\
        [[deform.handle]]\npick = [34, 20, 20]\nmove = [-2, 0, 0]\nradius = 12.0\n\
        [map]\nmethod = \"fem\"\ncell = 2\n[map.material.1]\nyoung = 1.0\n[map.material.2]\npoisson = 0.2\n\
        [output]\nvolume = \"pushed.nii.gz\"\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let told = json(at, &["pipeline", "scene.toml", "--out", "out"]);
    let stage =
        |name: &str| told["stages"].as_array().unwrap().iter().find(|s| s["stage"] == name).unwrap().clone();
    assert_eq!(stage("segment")["state"], "ran");
    assert_eq!(stage("octree")["state"], "not_needed");
    assert_eq!(stage("map")["metrics"]["folds"], 0);
}

#[test]
fn what_a_map_can_do_nothing_with_is_refused_or_said() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    labelled(at);
    let map = |method: &str, params: &str, more: &[&str]| {
        std::fs::write(at.join("p.toml"), params).unwrap();
        let words =
            ["map", "l.ivd", "o.ivd", "m.ivd", "--method", method, "--params", "p.toml", "-o", "d.ivd"];
        let output = ivd(at, &[&words[..], more].concat());
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for (method, params, word) in [
        ("octree", "[material.1]\nyoung = 2.0\n", "material"),
        ("biharmonic", "poisson = 0.3\n", "poisson"),
        ("fem", "[material.1]\nyoung = 2.0\n", "--labels"),
        ("fem", "[material.bone]\nyoung = 2.0\n", "material.bone"),
        ("fem", "[material.1]\nyoung = -2.0\n", "young"),
        ("fem", "[material.1]\npoisson = 0.5\n", "poisson"),
        ("fem", "[material.20]\nyoung = 2.0\n", "no class 20"),
        ("fem", "[material.1]\nyoung = 2.0\n[material.01]\nyoung = 3.0\n", "twice"),
    ] {
        let labels: &[&str] = if word == "--labels" { &[] } else { &["--labels", "labels.ivd"] };
        let (code, words) = map(method, params, labels);
        assert!(code == Some(2) && words.contains(word), "{method} {params}: {code:?} {words}");
    }
    let (code, words) = map("fem", "poisson = 0.3\n", &["--labels", "labels.ivd"]);
    assert!(code == Some(0) && words.contains("no effect"), "{words}");
}
