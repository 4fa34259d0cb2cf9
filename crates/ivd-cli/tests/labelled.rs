//! Scenes with labels of other programs: what single commands make of the same values, byte for byte.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::Path;

use serde_json::Value;

use crate::call::{json, refused};

const SCENE: &str = "schema = 1\n[input]\nfile = \"v.nrrd\"\nlabels = \"organs.nii.gz\"\n[boundary]\nclass = 3\n\
    [[deform.handle]]\npick = [16.0, 27.0, 16.0]\nmove = [0.0, -3.0, 0.0]\nradius = 12.0\n";
const OUTPUT: &str = "[output]\nvolume = \"v.nrrd\"\nlabels = \"rest.nrrd\"\nlabels_deformed = \"l.nrrd\"\n\
    mask_deformed = \"m.nrrd\"\ndisplacement = \"d.nrrd\"\n";

/// A head, and its parts as another program would have labelled them.
fn begin(at: &Path) {
    json(at, &["phantom", "head", "--size", "32", "-o", "v.ivd", "--truth", "t.ivd"]);
    json(at, &["export", "v.ivd", "-o", "v.nrrd"]);
    json(at, &["export", "t.ivd", "-o", "organs.nii.gz"]);
}

fn write(at: &Path, scene: &str) {
    std::fs::write(at.join("scene.toml"), scene).unwrap();
}

fn run(at: &Path) -> Value {
    json(at, &["pipeline", "scene.toml", "--out", "out"])
}

/// The states of a stage's places, with their variants.
fn states(told: &Value, stage: &str) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let all = told["stages"].as_array().unwrap().iter().filter(|record| record["stage"] == stage);
    all.map(|record| (text(&record["variant"]), text(&record["state"]))).collect()
}

#[test]
fn labels_of_a_file_stand_in_for_a_segmentation_and_go_along_with_the_scan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    write(at, &format!("{SCENE}{OUTPUT}"));
    let told = run(at);
    assert_eq!(states(&told, "segment"), [(String::new(), "not_needed".to_owned())], "{told}");
    let why = told["stages"].as_array().unwrap().iter().find(|record| record["stage"] == "segment").unwrap();
    assert_eq!(why["why"], "input.labels gives the labels");
    let made = |stage: &str, variant: &str| {
        let all = told["stages"].as_array().unwrap();
        let is = |record: &&Value| {
            record["stage"] == stage && record["variant"].as_str().unwrap_or_default() == variant
        };
        all.iter().find(is).unwrap()["output"]["path"].as_str().unwrap().to_owned()
    };
    let displacement = made("map", "");
    json(at, &["import", "organs.nii.gz", "--labels", "--like", "v.ivd", "-o", "organs.ivd"]);
    json(at, &["boundary", "v.ivd", "--labels", "organs.ivd", "--class", "3", "-o", "part.ivd"]);
    let bytes = |file: &str| std::fs::read(at.join(file)).unwrap();
    for (input, output) in [("organs.ivd", "out/l.nrrd"), ("part.ivd", "out/m.nrrd"), ("v.ivd", "out/v.nrrd")]
    {
        json(at, &["warp", input, &displacement, "-o", "w.ivd"]);
        json(at, &["export", "w.ivd", "-o", "w.nrrd"]);
        assert!(bytes("w.nrrd") == bytes(output), "{output}");
    }
    json(at, &["export", "organs.ivd", "-o", "w.nrrd"]);
    assert!(bytes("w.nrrd") == bytes("out/rest.nrrd") && bytes("out/l.nrrd") != bytes("out/rest.nrrd"));
    // Nothing that goes along is told of where no output asks for it, and nothing is done again.
    write(at, &format!("{SCENE}[output]\nlabels_deformed = \"l.nrrd\"\n"));
    let told = run(at);
    let warps = [("", "not_needed"), ("labels", "cached")].map(|(a, b)| (a.to_owned(), b.to_owned()));
    assert_eq!(states(&told, "warp"), warps, "{told}");
}

#[test]
fn the_densest_of_labels_is_that_of_the_highest_values_in_the_scan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    write(at, &format!("{}[output]\nmask = \"m.nrrd\"\n", SCENE.replace("class = 3", "class = \"densest\"")));
    let told = run(at);
    let boundary = told["stages"].as_array().unwrap().iter().find(|record| record["stage"] == "boundary");
    let classes = json(at, &["info", "t.ivd"])["content"]["classes"].as_array().unwrap().clone();
    let densest =
        classes.iter().max_by(|a, b| a["mean"].as_f64().unwrap().total_cmp(&b["mean"].as_f64().unwrap()));
    assert_eq!(boundary.unwrap()["metrics"]["class"], densest.unwrap()["id"]);
    assert_ne!(
        densest.unwrap()["id"],
        classes.last().unwrap()["id"],
        "the highest number isn't the brightest"
    );
}

#[test]
fn labels_that_can_not_be_meant_are_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    begin(at);
    json(at, &["import", "organs.nii.gz", "--mask", "-o", "mask.ivd"]);
    json(at, &["phantom", "sphere", "--size", "16", "-o", "far.ivd"]);
    std::fs::write(at.join("far.nrrd"), far()).unwrap();
    let output = "[output]\nlabels_deformed = \"l.nrrd\"\n";
    let still = SCENE.split("[[deform").next().unwrap();
    for (scene, wanted, says) in [
        (format!("{SCENE}[segment]\nk = 4\n{output}"), 2, "[segment]"),
        (format!("{still}{output}"), 2, "output.labels_deformed"),
        (SCENE.replace("\"organs", "\"/organs") + output, 2, "input.labels"),
        (SCENE.replace("organs.nii.gz", "mask.ivd") + output, 2, "give labels"),
        (SCENE.replace("organs.nii.gz", "gone.nii.gz") + output, 3, "gone.nii.gz"),
        (SCENE.replace("organs.nii.gz", "far.nrrd") + output, 2, "share no place"),
        (format!("{SCENE}{}", output.replace("l.nrrd", "l.png")), 2, "output.labels_deformed"),
    ] {
        write(at, &scene);
        let (code, told) = refused(at, &["pipeline", "scene.toml", "--out", "out"]);
        assert!(told.contains(says), "{scene}\n{told}");
        assert_eq!(code, wanted, "{told}");
    }
}

/// Labels that lie where no voxel of the scan does.
fn far() -> Vec<u8> {
    let head = "NRRD0004\ntype: uchar\ndimension: 3\nspace: right-anterior-superior\nsizes: 2 2 2\n\
        space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (500,0,0)\nencoding: raw\n\n";
    [head.as_bytes(), &[1; 8]].concat()
}
