//! Lattices from the command line: several labels at once, every method of refinement, chains, meshes of other programs,
//! vertices by voxel.
#![allow(clippy::unwrap_used, reason = "a failed step of a test's own preparation is a failed test")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::{TempDir, tempdir};

fn run(at: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ivd"))
        .current_dir(at)
        .args(args)
        .args(["--cache", "off", "--progress", "never"])
        .output()
        .unwrap()
}

fn json(at: &Path, args: &[&str]) -> Value {
    let output = run(at, &[args, &["--json"]].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {said}");
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{args:?}: {e}"))
}

/// Exit code and what was said of a command that fails.
fn refused(at: &Path, args: &[&str]) -> (i32, String) {
    let output = run(at, args);
    assert!(!output.status.success(), "{args:?} worked");
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// A folder with a head of 40³, its label truth as a volume file, and the lattice of its skin.
fn head() -> TempDir {
    let folder = tempdir().unwrap();
    let at = folder.path();
    json(at, &["phantom", "head", "--size", "40", "--noise", "0", "-o", "head.ivd", "--truth", "truth.nrrd"]);
    json(at, &["lattice", "head.ivd", "--iso", "60", "-o", "lattice.ivd"]);
    folder
}

fn is_closed(metrics: &Value) -> bool {
    metrics["boundary_edges"] == 0 && metrics["non_manifold_edges"] == 0
}

#[test]
fn several_labels_give_a_closed_lattice_each() {
    let folder = head();
    let at = folder.path();
    let made = json(at, &["import", "truth.nrrd", "--labels", "-o", "labels.ivd"]);
    assert_eq!(made["output"]["kind"], "labels");
    let words = ["lattice", "head.ivd", "--labels", "labels.ivd", "--parts", "all", "-o", "parts"];
    let found = json(at, &words);
    let parts = found["parts"].as_array().unwrap();
    assert_eq!(parts.len() as u64, made["metrics"]["k"].as_u64().unwrap());
    for part in parts {
        assert!(is_closed(&part["metrics"]) && part["metrics"]["degenerate_triangles"] == 0, "{part}");
        assert!(part["metrics"]["volume_mm3"].as_f64().unwrap() > 0.0);
        assert!(at.join(part["output"]["path"].as_str().unwrap()).is_file());
    }
    // Two of them alone: the same seams, and only these two files.
    let words = ["lattice", "labels.ivd", "--labels", "labels.ivd", "--parts", "2,1", "-o", "two"];
    assert_eq!(json(at, &words)["parts"].as_array().unwrap().len(), 2);
    assert_eq!(std::fs::read_dir(at.join("two")).unwrap().count(), 2);
}

#[test]
fn what_cannot_be_cut_into_parts_is_said() {
    let folder = head();
    let at = folder.path();
    json(at, &["import", "truth.nrrd", "--labels", "-o", "labels.ivd"]);
    let parts = |list: &str| {
        refused(at, &["lattice", "head.ivd", "--labels", "labels.ivd", "--parts", list, "-o", "parts"])
    };
    for (list, said) in
        [("1,x", "`x`"), ("1,1", "twice"), ("0", "no data"), ("70000", "`70000`"), ("1,999", "label 999")]
    {
        let (code, text) = parts(list);
        assert!(code == 2 && text.contains(said), "{list}: {code} {text}");
        assert!(!at.join("parts").exists(), "{list} left a folder");
    }
    let words = ["lattice", "head.ivd", "--labels", "head.ivd", "--parts", "all", "-o", "parts"];
    let (code, text) = refused(at, &words);
    assert!(code == 2 && text.contains("import --labels"), "{code} {text}");
    std::fs::write(at.join("file"), "x").unwrap();
    let words = ["lattice", "head.ivd", "--labels", "labels.ivd", "--parts", "all", "-o", "file"];
    let (code, text) = refused(at, &words);
    assert!(code == 2 && text.contains("folder"), "{code} {text}");
}

#[test]
fn every_method_keeps_a_subset_and_tells_its_error() {
    let folder = head();
    let at = folder.path();
    let whole = json(at, &["lattice", "head.ivd", "--iso", "60", "-o", "lattice.ivd"]);
    let before = whole["metrics"]["triangles"].as_u64().unwrap();
    for method in ["collapse", "decimate", "loop", "merge", "sample"] {
        let words = ["refine", "lattice.ivd", "--method", method, "--level", "1", "-o", "coarse.ivd"];
        let metrics = &json(at, &words)["metrics"];
        assert_eq!(metrics["subset"], true, "{method}");
        assert!(is_closed(metrics), "{method}: {metrics}");
        let triangles = metrics["triangles"].as_u64().unwrap();
        assert!(triangles > 0 && triangles < before * 2 / 3, "{method}: {triangles} of {before}");
        let bound = metrics["max_error_mm"].as_f64().unwrap();
        let apart = json(at, &["compare", "lattice.ivd", "coarse.ivd"]);
        let measured = apart["hausdorff"].as_f64().unwrap();
        assert!(bound >= measured && bound > 0.0, "{method}: told {bound}, measured {measured}");
    }
}

#[test]
fn locked_places_and_counts_are_kept() {
    let folder = head();
    let at = folder.path();
    let place = json(at, &["info", "lattice.ivd", "--vertex", "100"])["vertices"][0].clone();
    let world: Vec<String> = place["world"].as_array().unwrap().iter().map(ToString::to_string).collect();
    let lock = format!("pick={};radius=4", world.join(","));
    let words = ["refine", "lattice.ivd", "--count", "400", "--lock", &lock, "-o", "coarse.ivd"];
    let metrics = json(at, &words)["metrics"].clone();
    assert!(metrics["locked"].as_u64().unwrap() > 3 && metrics["triangles"] == 400, "{metrics}");
    let voxel: Vec<String> = place["voxel"].as_array().unwrap().iter().map(ToString::to_string).collect();
    let back = json(at, &["info", "coarse.ivd", "--voxel", &voxel.join(",")]);
    let kept = back["voxels"][0]["vertices"].as_array().unwrap();
    assert!(kept.iter().any(|v| v["world"] == place["world"]), "{back}");
    let far = ["refine", "lattice.ivd", "--lock", "pick=900,0,0;radius=1", "-o", "no.ivd"];
    let (code, text) = refused(at, &far);
    assert!(code == 2 && text.contains("the nearest is"), "{code} {text}");
}

#[test]
fn a_chain_holds_levels_that_can_be_taken_out() {
    let folder = head();
    let at = folder.path();
    let made = json(at, &["refine", "lattice.ivd", "--chain", "1,2", "-o", "chain.ivd"]);
    let levels = made["metrics"]["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 2);
    let told = json(at, &["info", "chain.ivd"])["content"]["coarser"].clone();
    assert_eq!(told[1]["triangles"], levels[1]["triangles"]);
    json(at, &["export", "chain.ivd", "--level", "2", "-o", "second.ply"]);
    let ply = std::fs::read(at.join("second.ply")).unwrap();
    let header = String::from_utf8_lossy(&ply[..600]).into_owned();
    assert!(header.contains(&format!("element vertex {}", levels[1]["vertices"])), "{header}");
    let (code, text) = refused(at, &["export", "chain.ivd", "--level", "3", "-o", "third.ply"]);
    assert!(code == 2 && text.contains("levels 0 to 2"), "{code} {text}");
    let (code, _) = refused(at, &["refine", "lattice.ivd", "--chain", "2,1", "-o", "no.ivd"]);
    assert_eq!(code, 2);
    let (code, text) =
        refused(at, &["refine", "lattice.ivd", "--method", "sample", "--chain", "1,2", "-o", "no.ivd"]);
    assert!(code == 2 && text.contains("another method"), "{code} {text}");
}

#[test]
fn a_mesh_comes_back_as_the_lattice_that_it_was() {
    let folder = head();
    let at = folder.path();
    let before = json(at, &["info", "lattice.ivd"])["content"].clone();
    for ending in ["ply", "vtp", "obj", "stl", "glb"] {
        let mesh = format!("mesh.{ending}");
        json(at, &["export", "lattice.ivd", "-o", &mesh]);
        let found = json(at, &["lattice", "head.ivd", "--mesh", &mesh, "-o", "back.ivd"]);
        assert!(is_closed(&found["metrics"]), "{ending}");
        assert_eq!(found["metrics"]["vertices"], before["vertices"], "{ending}");
        let apart = json(at, &["compare", "lattice.ivd", "back.ivd"]);
        let off = apart["hausdorff"].as_f64().unwrap();
        assert!(off < 1e-3, "{ending}: {off} mm");
    }
    std::fs::write(at.join("bad.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n").unwrap();
    let (code, text) = refused(at, &["lattice", "head.ivd", "--mesh", "bad.obj", "-o", "no.ivd"]);
    assert!(code == 3 && text.contains("bad.obj"), "{code} {text}");
    std::fs::write(at.join("open.obj"), "v 10 10 10\nv 11 10 10\nv 10 11 10\nf 1 2 3\n").unwrap();
    let (code, text) = refused(at, &["lattice", "head.ivd", "--mesh", "open.obj", "-o", "no.ivd"]);
    assert!(code == 3 && text.contains("border"), "{code} {text}");
}

#[test]
fn vertices_and_voxels_lead_to_one_another() {
    let folder = head();
    let at = folder.path();
    let one = json(at, &["info", "lattice.ivd", "--vertex", "7"]);
    let voxel: Vec<String> =
        one["vertices"][0]["voxel"].as_array().unwrap().iter().map(ToString::to_string).collect();
    let back = json(at, &["info", "lattice.ivd", "--voxel", &voxel.join(",")]);
    let found = back["voxels"][0]["vertices"].as_array().unwrap();
    assert!(found.contains(&one["vertices"][0]), "{back}");
    let (code, text) = refused(at, &["info", "lattice.ivd", "--vertex", "99999999"]);
    assert!(code == 2 && text.contains("99999999"), "{code} {text}");
    let (code, text) = refused(at, &["info", "lattice.ivd", "--voxel", "50,0,0"]);
    assert!(code == 2 && text.contains("border layer"), "{code} {text}");
    let (code, text) = refused(at, &["info", "head.ivd", "--vertex", "1"]);
    assert!(code == 2 && text.contains("volume"), "{code} {text}");
}
